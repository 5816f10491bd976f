#include <ise/packet/detail/natural.hpp>

#include <ise/core/error.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>

namespace ise::detail {

namespace {
void check(const buffer& out, std::uint64_t count, const size_limit& limit) {
    if (count > limit.most || out.size() > limit.most - count)
        throw error(errc::too_large,
                    fmt::format("the packet grows beyond {} bytes by its default values ({})", limit.most, limit.name));
}

void zeros(buffer& out, std::uint64_t count, const size_limit& limit) {
    check(out, count, limit);
    if (count != 0) std::memset(out.grow(static_cast<std::size_t>(count)), 0, static_cast<std::size_t>(count));
}

bool all_zero(const type_description& type) {
    return std::none_of(type.members.begin(), type.members.end(),
                        [](const type_member& member) { return member.preset || !all_zero(member.type); });
}
} // namespace

void append_natural(const type_description& type, buffer& out, const size_limit& limit) {
    switch (type.kind) {
        case type_kind::variant:
            zeros(out, type.members.size() > 255 ? 2 : 1, limit);
            append_natural(type.members[0].type, out, limit);
            break;
        case type_kind::tuple:
        case type_kind::structure:
            for (const auto& field : type.members) append_preset(field, out, limit);
            break;
        case type_kind::array: {
            const auto& element = type.members[0].type;
            if (type.min_size == 0 && element.fixed_size) break;
            if (element.fixed_size && all_zero(element)) return zeros(out, type.min_size, limit);
            for (std::uint64_t i = 0; i < type.length; ++i) append_natural(element, out, limit);
            break;
        }
        default: zeros(out, type.min_size, limit);
    }
}

void append_preset(const type_member& field, buffer& out, const size_limit& limit) {
    if (!field.preset) return append_natural(field.type, out, limit);
    check(out, field.preset->size(), limit);
    out.append(*field.preset);
}

bool is_natural(const type_description& type, bytes_view preset) {
    buffer natural;
    try {
        append_natural(type, natural, size_limit(preset.size(), "its preset"));
    } catch (const error&) {
        return false; // longer than the preset
    }
    return std::ranges::equal(natural.view(), preset);
}

} // namespace ise::detail
