#include <ise/packet/detail/walk.hpp>

namespace ise::detail {

bool take_count_of(const type_description& type, reader& in, std::size_t& count) {
    if (type.kind == type_kind::string || type.kind == type_kind::opaque) return in.take_count(count, 1, 0, "bytes");
    std::uint64_t element = 0;
    for (const auto& member : type.members) element += member.type.min_size;
    return in.take_count(count, static_cast<std::size_t>(element), 0);
}

bool take_flag(reader& in, bool& flag) {
    const std::byte* raw = in.take(1);
    if (!raw) return in.fail_short(1);
    if (std::to_integer<unsigned>(*raw) > 1)
        return in.fail_flag("the flag of an optional", std::to_integer<unsigned>(*raw));
    flag = *raw == std::byte{1};
    return true;
}

bool take_alternative(const type_description& type, reader& in, std::size_t& index) {
    std::size_t size = type.members.size() > 255 ? 2 : 1;
    const std::byte* raw = in.take(size);
    if (!raw) return in.fail_short(size);
    index = std::to_integer<std::size_t>(raw[0]);
    if (size == 2) index |= std::to_integer<std::size_t>(raw[1]) << 8;
    if (index >= type.members.size()) return in.fail_alternative(index, type.members.size());
    return true;
}

namespace {
bool skip_elements(const type_description& type, reader& in, std::uint64_t count) {
    const auto& element = type.members[0].type;
    if (type.members.size() == 1 && element.any_bytes) {
        std::uint64_t left = in.left();
        if (element.min_size != 0 && count > left / element.min_size) {
            while (in.take(static_cast<std::size_t>(element.min_size))) --count;
            return in.fail_short(static_cast<std::size_t>(element.min_size));
        }
        in.take(static_cast<std::size_t>(count * element.min_size));
        return true;
    }
    for (std::uint64_t i = 0; i < count; ++i)
        for (const auto& member : type.members)
            if (!skip(member.type, in)) return in.in_element(static_cast<std::size_t>(i));
    return true;
}
} // namespace

bool skip(const type_description& type, reader& in) {
    if (type.any_bytes && in.take(static_cast<std::size_t>(type.min_size)))
        return true; // else the field is to be named
    switch (type.kind) {
        case type_kind::boolean: {
            const std::byte* raw = in.take(1);
            if (!raw) return in.fail_short(1);
            if (std::to_integer<unsigned>(*raw) > 1) return in.fail_flag("a bool", std::to_integer<unsigned>(*raw));
            return true;
        }
        case type_kind::string:
        case type_kind::opaque: {
            std::size_t size = 0;
            return take_count_of(type, in, size) && (in.take(size) || true);
        }
        case type_kind::vector:
        case type_kind::set:
        case type_kind::map: {
            std::size_t count = 0;
            return take_count_of(type, in, count) && skip_elements(type, in, count);
        }
        case type_kind::array: return skip_elements(type, in, type.length);
        case type_kind::optional: {
            bool there = false;
            return take_flag(in, there) && (!there || skip(type.members[0].type, in));
        }
        case type_kind::variant: {
            std::size_t index = 0;
            if (!take_alternative(type, in, index)) return false;
            return skip(type.members[index].type, in) || in.in_alternative(index);
        }
        case type_kind::tuple:
        case type_kind::structure:
            for (std::size_t i = 0; i < type.members.size(); ++i)
                if (!skip(type.members[i].type, in))
                    return in.in_field(type.kind == type_kind::tuple ? std::to_string(i) : type.members[i].name);
            return true;
        default: {
            std::size_t size = static_cast<std::size_t>(type.min_size);
            return in.take(size) || in.fail_short(size);
        }
    }
}

} // namespace ise::detail
