#pragma once
#include <ise/packet/detail/names.hpp>

#include <algorithm>
#include <array>
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

/// Splits the compiler's list "{mode::a, (mode)1, …}" and keeps those that have a name.
std::vector<enumerator> named_values(std::string_view words, const std::int64_t* values, std::size_t count);

template <class E>
struct enum_candidates {
    using number = std::underlying_type_t<E>;
    static constexpr bool is_signed = std::is_signed_v<number>;
    static constexpr std::int64_t low =
        std::max<std::int64_t>(enum_range<E>::min, is_signed ? std::int64_t{std::numeric_limits<number>::min()} : 0);
    static constexpr std::int64_t high =
        sizeof(number) == 8
            ? std::int64_t{enum_range<E>::max}
            : std::min<std::int64_t>(enum_range<E>::max, static_cast<std::int64_t>(std::numeric_limits<number>::max()));
    static constexpr std::size_t bits = sizeof(number) * 8 - (is_signed ? 1 : 0);

    static constexpr std::size_t count_flags() noexcept {
        std::size_t count = 0;
        for (std::size_t bit = 0; bit < bits; ++bit) count += is_flag(bit);
        return count;
    }
    static constexpr bool is_flag(std::size_t bit) noexcept {
        return (std::uint64_t{1} << bit) > static_cast<std::uint64_t>(high < 0 ? 0 : high);
    }

    static constexpr std::size_t span = static_cast<std::size_t>(high - low + 1);
    static constexpr auto values = [] {
        std::array<std::int64_t, span + count_flags()> all{};
        for (std::size_t i = 0; i < span; ++i) all[i] = low + static_cast<std::int64_t>(i);
        std::size_t next = span;
        for (std::size_t bit = 0; bit < bits; ++bit)
            if (is_flag(bit)) all[next++] = static_cast<std::int64_t>(std::uint64_t{1} << bit);
        return all;
    }();
};

template <class E, std::size_t... I>
std::vector<enumerator> find_enumerators(std::index_sequence<I...>) {
    using candidates = enum_candidates<E>;
    return named_values(words_of_values<E, static_cast<E>(candidates::values[I])...>(), candidates::values.data(),
                        sizeof...(I));
}

} // namespace detail

/// The enumerators of E within `enum_range<E>`, by ascending value (flags behind); of two names for one value, the
/// compiler's choice.
template <class E>
const std::vector<enumerator>& enumerators() {
    static const std::vector<enumerator> found =
        detail::find_enumerators<E>(std::make_index_sequence<detail::enum_candidates<E>::values.size()>());
    return found;
}

} // namespace ise
