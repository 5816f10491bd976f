#pragma once
#include <ise/packet/detail/names.hpp>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace ise {

/// The values among which the enumerators of E are looked for: [min, max], and every single bit above (flags).
/// Specialise it for an enum with values beyond; enumerators outside travel as numbers without a name.
template <class E>
struct enum_range {
    static constexpr int min = -16; ///< the least value looked at
    static constexpr int max = 255; ///< the greatest, but for single bits
};

/// A name and its value.
struct enumerator {
    /// As it is written in C++.
    std::string name;
    std::int64_t value; ///< of an enum over std::uint64_t: the same 64 bits
    /// Same name, same value.
    bool operator==(const enumerator&) const = default;
};

namespace detail {

template <class E, E... values>
constexpr std::string_view words_of_values() noexcept {
    return __PRETTY_FUNCTION__;
}

/// The values that may be enumerators, in their order: `span` of them from `low` on, then the single bits above.
struct candidate_values {
    std::int64_t low;
    std::size_t span, first_bit, bits;

    constexpr std::size_t size() const noexcept { return span + bits - first_bit; }
    constexpr std::int64_t operator[](std::size_t i) const noexcept {
        return i < span ? low + static_cast<std::int64_t>(i)
                        : static_cast<std::int64_t>(std::uint64_t{1} << (first_bit + i - span));
    }
};

template <class E>
constexpr candidate_values make_candidates() noexcept {
    using number = std::underlying_type_t<E>;
    using limits = std::numeric_limits<number>;
    constexpr std::int64_t low =
        std::max<std::int64_t>(enum_range<E>::min, std::is_signed_v<number> ? std::int64_t{limits::min()} : 0);
    constexpr std::int64_t high =
        sizeof(number) == 8 ? std::int64_t{enum_range<E>::max}
                            : std::min<std::int64_t>(enum_range<E>::max, static_cast<std::int64_t>(limits::max()));
    const std::size_t bits = limits::digits;
    return {low, static_cast<std::size_t>(high - low + 1),
            std::min<std::size_t>(bits, std::bit_width(static_cast<std::uint64_t>(high < 0 ? 0 : high))), bits};
}

template <class E>
inline constexpr candidate_values candidates = make_candidates<E>();

/// Splits the compiler's list "{mode::a, (mode)1, …}" and keeps those that have a name.
std::vector<enumerator> named_values(std::string_view words, const candidate_values& values);

template <class E, std::size_t... I>
std::vector<enumerator> find_enumerators(std::index_sequence<I...>) {
    return named_values(words_of_values<E, static_cast<E>(candidates<E>[I])...>(), candidates<E>);
}

} // namespace detail

/// The enumerators of E within `enum_range<E>`, by ascending value (flags behind); of two names for one value, the
/// compiler's choice.
template <class E>
const std::vector<enumerator>& enumerators() {
    static const std::vector<enumerator> found =
        detail::find_enumerators<E>(std::make_index_sequence<detail::candidates<E>.size()>());
    return found;
}

} // namespace ise
