#include <ise/packet/schema.hpp>

#include <ise/packet/detail/schema_text.hpp>
#include <ise/packet/detail/text_forms.hpp>
#include <ise/packet/fingerprint.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise {

namespace {
bool is_name(std::string_view name) {
    return !name.empty() && std::all_of(name.begin(), name.end(), detail::is_name_char);
}

bool is_opaque_name(std::string_view name) {
    return !name.empty() && std::all_of(name.begin(), name.end(), [](char c) {
        return detail::is_name_char(c) || c == '.' || c == ':' || c == '/' || c == '-';
    });
}

// Names that a user's serialize gave (cereal::make_nvp) may hold anything.
void make_names_plain(type_description& type) {
    if (type.kind == type_kind::opaque && !is_opaque_name(type.name))
        throw error(errc::invalid_argument,
                    fmt::format("the name \"{}\" of an opaque type may hold letters, digits and _.:/- "
                                "only: change its ise::opaque_type",
                                type.name));
    for (auto& member : type.members) {
        if (type.kind == type_kind::structure) {
            bool letters = detail::is_utf8(member.name);
            for (char& c : member.name)
                if (!detail::is_name_char(c) || (!letters && static_cast<unsigned char>(c) >= 0x80)) c = '_';
            if (!is_name(member.name)) member.name.assign(1, '_'); // = "_": g++ 12 warns
        }
        make_names_plain(member.type);
    }
}
} // namespace

schema::schema()
    : schema([] {
          type_description nothing;
          nothing.complete();
          return nothing;
      }()) {}

schema::schema(type_description type) {
    make_names_plain(type);
    auto made = std::make_shared<data>();
    made->text = detail::text_of(type, detail::text_style::full);
    made->fingerprint = fingerprint_of(detail::text_of(type, detail::text_style::fingerprint));
    made->name = type.name.empty() ? std::string(name_of(type.kind)) : type.name;
    made->type = std::move(type);
    data_ = std::move(made);
}

std::string schema::pretty() const { return detail::text_of(type(), detail::text_style::pretty); }

std::string short_text(const type_description& type) {
    if ((type.kind == type_kind::structure || type.kind == type_kind::enumeration) && !type.name.empty())
        return fmt::format("{} {}", name_of(type.kind), type.name);
    std::string text = detail::text_of(type, detail::text_style::full);
    constexpr std::size_t most = 120;
    if (text.size() > most) text = text.substr(0, most) + "…";
    return text;
}

} // namespace ise
