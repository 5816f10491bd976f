#pragma once
#include <ise/core/error.hpp>
#include <ise/packet/detail/codec_fixed.hpp>

#include <cmath>
#include <cstddef>
#include <string>
#include <string_view>

namespace ise {

/// A unit as an argument of a template: `bounded<double, 0, 40, "m/s">`.
template <std::size_t N>
struct unit_text {
    char letters[N]{}; ///< with the zero at its end

    constexpr unit_text(const char (&text)[N]) { // NOLINT: from a literal
        for (std::size_t i = 0; i < N; ++i) letters[i] = text[i];
    }
    constexpr std::string_view view() const noexcept { return {letters, N - 1}; }
};

namespace detail {
template <class T>
std::string out_of_range(T value, T minimum, T maximum, std::string_view unit);
extern template std::string out_of_range(double, double, double, std::string_view);
extern template std::string out_of_range(std::int64_t, std::int64_t, std::int64_t, std::string_view);
extern template std::string out_of_range(std::uint64_t, std::uint64_t, std::uint64_t, std::string_view);
} // namespace detail

/// A number that is always within its range, ends included: for a field of a packet (`bounded<double, 0, 360,
/// "degrees"> heading = 90;`) or of a component's options, where its range and unit become the parameter's. It converts
/// to its number, and is a plain number on the wire: the range is not part of schema and fingerprint, and may differ
/// between two ends. Decoding a packet or JSON with a value outside fails with errc::malformed and the range. The
/// default value is 0, or the end nearest to it.
template <class T, auto Minimum, auto Maximum, unit_text Unit = "">
class bounded {
    static_assert(detail::number<T> && !std::is_same_v<T, bool> && !std::is_same_v<T, char>,
                  "ise: bounded is for numbers");

public:
    using value_type = T;
    static constexpr T minimum = static_cast<T>(Minimum);
    static constexpr T maximum = static_cast<T>(Maximum);
    static constexpr std::string_view unit = Unit.view();
    static_assert(minimum <= maximum, "ise: the range of a bounded is empty");
    static_assert(std::is_floating_point_v<T> || (minimum == Minimum && maximum == Maximum),
                  "ise: the range of a bounded does not fit its type");

    constexpr bounded() noexcept = default;
    /// Throws errc::invalid_argument with the range.
    constexpr bounded(T value) : value_(value) { // NOLINT: it is a number with a promise
        if (!allows(value)) throw error(errc::invalid_argument, complaint(value));
    }

    constexpr operator T() const noexcept { return value_; } // NOLINT
    constexpr T value() const noexcept { return value_; }
    /// Not NaN either.
    static constexpr bool allows(T value) noexcept { return value >= minimum && value <= maximum; }
    /// "361 is outside of 0 to 360 (degrees)"
    static std::string complaint(T value) {
        using wide = std::conditional_t<std::is_floating_point_v<T>, double,
                                        std::conditional_t<std::is_signed_v<T>, std::int64_t, std::uint64_t>>;
        return detail::out_of_range<wide>(value, minimum, maximum, unit);
    }

private:
    T value_ = minimum > T{} ? minimum : maximum < T{} ? maximum : T{};
};

namespace detail {

template <class T, auto Minimum, auto Maximum, unit_text Unit>
struct parts<bounded<T, Minimum, Maximum, Unit>> : known_parts<T> {};

template <class T, auto Minimum, auto Maximum, unit_text Unit>
struct codec<bounded<T, Minimum, Maximum, Unit>> {
    using limited = bounded<T, Minimum, Maximum, Unit>;
    static constexpr std::size_t min_size = sizeof(T);
    static constexpr bool fixed = true;
    static constexpr bool raw = false; // not every number may become one

    static void put(std::byte* to, limited value) noexcept { store_little(to, value.value()); }
    static bool get(const std::byte* from, limited& value, reader& in) {
        auto number = load_little<T>(from);
        if (!limited::allows(number)) [[unlikely]]
            return in.fail(limited::complaint(number));
        value = limited(number);
        return true;
    }
    static type_description describe() { return codec<T>::describe(); }
};

} // namespace detail

} // namespace ise
