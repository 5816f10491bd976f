#include <ise/packet/type.hpp>

#include <algorithm>
#include <limits>

namespace ise {

std::string_view name_of(type_kind kind) noexcept {
    static constexpr std::string_view names[] = {"bool",     "char", "byte", "i8",     "u8",       "i16",     "u16",
                                                 "i32",      "u32",  "i64",  "u64",    "f32",      "f64",     "string",
                                                 "vector",   "set",  "map",  "array",  "optional", "variant", "tuple",
                                                 "duration", "time", "enum", "struct", "opaque"};
    return names[static_cast<std::size_t>(kind)];
}

std::size_t size_of(type_kind scalar) noexcept {
    static constexpr std::uint8_t sizes[] = {1, 1, 1, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
    return sizes[static_cast<std::size_t>(scalar)];
}

namespace {
constexpr std::uint64_t most = std::numeric_limits<std::uint64_t>::max();
std::uint64_t sum(std::uint64_t a, std::uint64_t b) noexcept { return a > most - b ? most : a + b; }
std::uint64_t product(std::uint64_t a, std::uint64_t b) noexcept { return a != 0 && b > most / a ? most : a * b; }
} // namespace

type_description::type_description() = default;
type_description::type_description(const type_description&) = default;
type_description::type_description(type_description&&) noexcept = default;
type_description& type_description::operator=(const type_description&) = default;
type_description& type_description::operator=(type_description&&) noexcept = default;
type_description::~type_description() = default;

void type_description::complete() noexcept {
    min_size = 0;
    fixed_size = false;
    switch (kind) {
        case type_kind::string:
        case type_kind::vector:
        case type_kind::set:
        case type_kind::map:
        case type_kind::opaque: min_size = 4; break;
        case type_kind::optional: min_size = 1; break;
        case type_kind::time_span:
        case type_kind::instant:
            min_size = 8;
            fixed_size = true;
            break;
        case type_kind::enumeration:
            min_size = size_of(number);
            fixed_size = true;
            break;
        case type_kind::array:
            min_size = product(length, members[0].type.min_size);
            fixed_size = length == 0 || members[0].type.fixed_size; // also of texts: nothing is passed over one by one
            break;
        case type_kind::variant: {
            min_size = most;
            for (const auto& member : members) min_size = std::min(min_size, member.type.min_size);
            min_size = sum(min_size, members.size() > 255 ? 2 : 1);
            break;
        }
        case type_kind::tuple:
        case type_kind::structure:
            fixed_size = true;
            for (const auto& member : members) {
                min_size = sum(min_size, member.type.min_size);
                fixed_size = fixed_size && member.type.fixed_size;
            }
            break;
        default: min_size = size_of(kind); fixed_size = true;
    }
    any_bytes =
        fixed_size && (min_size == 0 || (kind != type_kind::boolean &&
                                         std::all_of(members.begin(), members.end(),
                                                     [](const type_member& one) { return one.type.any_bytes; })));
}

} // namespace ise
