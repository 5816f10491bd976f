#include <ise/packet/detail/schema_text.hpp>

#include <fmt/format.h>

namespace ise::detail {

namespace {
class text_writer {
public:
    explicit text_writer(text_style style) : style_(style) {}

    void type(const type_description& t) {
        switch (t.kind) {
            case type_kind::enumeration: return enumeration(t);
            case type_kind::structure: return structure(t);
            case type_kind::vector:
            case type_kind::set:
            case type_kind::map:
            case type_kind::optional:
            case type_kind::variant:
            case type_kind::tuple: return put("{}<", name_of(t.kind)), members(t), put(">");
            case type_kind::array: return put("array<"), type(t.members[0].type), put(",{}>", t.length);
            case type_kind::time_span:
            case type_kind::instant:
                return put("{}<{},{}/{}>", name_of(t.kind), name_of(t.number), t.period_num, t.period_den);
            case type_kind::opaque: return put("opaque<{},{}>", t.name, t.version);
            default: put("{}", name_of(t.kind));
        }
    }
    std::string text;

private:
    template <class... T>
    void put(fmt::format_string<T...> format, T&&... values) {
        text += fmt::format(format, std::forward<T>(values)...);
    }

    void named(std::string_view word, const std::string& name) {
        put("{}", word);
        if (style_ != text_style::fingerprint && !name.empty()) put(" {}", name);
    }

    void members(const type_description& t) {
        for (std::size_t i = 0; i < t.members.size(); ++i) {
            if (i != 0) put("{}", style_ == text_style::pretty ? ", " : ",");
            type(t.members[i].type);
        }
    }

    void enumeration(const type_description& t) {
        named("enum", t.name);
        put(":{}{{", name_of(t.number));
        for (std::size_t i = 0; i < t.enumerators.size(); ++i) {
            const auto& e = t.enumerators[i];
            if (i != 0) put("{}", style_ == text_style::pretty ? ", " : ",");
            if (t.number == type_kind::u64) put("{}={}", e.name, static_cast<std::uint64_t>(e.value));
            else put("{}={}", e.name, e.value);
        }
        put("}}");
    }

    void structure(const type_description& t) {
        named("struct", t.name);
        if (style_ == text_style::pretty && t.members.empty()) return put(" {{}}");
        put("{}", style_ == text_style::pretty ? " {\n" : "{");
        ++depth_;
        for (std::size_t i = 0; i < t.members.size(); ++i) {
            const auto& field = t.members[i];
            if (style_ == text_style::pretty) {
                put("{:{}}{}: ", "", 2 * depth_, field.name);
                type(field.type);
                put("\n");
                continue;
            }
            if (i != 0) put(",");
            put("{}:", field.name);
            type(field.type);
            if (style_ == text_style::full && field.preset) {
                put("=");
                for (std::byte b : *field.preset) put("{:02x}", std::to_integer<unsigned>(b));
            }
        }
        --depth_;
        if (style_ == text_style::pretty) put("{:{}}", "", 2 * depth_);
        put("}}");
    }

    text_style style_;
    std::size_t depth_ = 0;
};
} // namespace

std::string text_of(const type_description& type, text_style style) {
    text_writer w(style);
    w.type(type);
    return std::move(w.text);
}

} // namespace ise::detail
