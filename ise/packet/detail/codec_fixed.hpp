#pragma once
#include <ise/packet/detail/codec_scalars.hpp>

#include <memory>

/// Types that hold a number of elements or fields known at compile time.
namespace ise::detail {

// --- arrays -----------------------------------------------------------------------------------------------------
template <class Array, class T, std::size_t N>
struct array_codec {
    static constexpr std::size_t min_size = codec<T>::min_size * N;
    static constexpr bool fixed = codec<T>::fixed;
    static constexpr bool raw = codec<T>::raw && N > 0; // in memory an array of none has bytes

    static void put(std::byte* to, const Array& values) requires fixed {
        if constexpr (raw) {
            std::memcpy(to, &values[0], min_size);
        } else {
            for (std::size_t i = 0; i < N; ++i) codec<T>::put(to + i * codec<T>::min_size, values[i]);
        }
    }
    static bool get(const std::byte* from, Array& values, reader& in) requires fixed {
        if constexpr (raw) {
            std::memcpy(static_cast<void*>(&values[0]), from, min_size);
        } else {
            for (std::size_t i = 0; i < N; ++i)
                if (!codec<T>::get(from + i * codec<T>::min_size, values[i], in)) return in.in_element(i);
        }
        return true;
    }
    static void write(writer to, const Array& values) {
        for (std::size_t i = 0; i < N; ++i) to(values[i]);
    }
    static bool read(reader& in, Array& values) {
        for (std::size_t i = 0; i < N; ++i)
            if (!in(values[i])) [[unlikely]]
                return in.in_element(i);
        return true;
    }
    static type_description describe() {
        type_description type;
        type.kind = type_kind::array;
        type.length = N;
        type.members.push_back({{}, codec<T>::describe(), {}});
        type.complete();
        return type;
    }
};
template <class T, std::size_t N>
struct codec<T[N]> : array_codec<T[N], T, N> {};
template <class T, std::size_t N>
struct codec<std::array<T, N>> : array_codec<std::array<T, N>, T, N> {};

// --- fields one after the other -----------------------------------------------------------------------------------
template <class... F>
struct sequence {
    static constexpr std::size_t min_size = (std::size_t{0} + ... + codec<F>::min_size);
    static constexpr bool fixed = (codec<F>::fixed && ...);
    static constexpr bool raw = (codec<F>::raw && ...);

    static void put([[maybe_unused]] std::byte* to, const F&... fields) {
        ((codec<F>::put(to, fields), to += codec<F>::min_size), ...);
    }
    static bool get([[maybe_unused]] const std::byte* from, [[maybe_unused]] reader& in,
                    [[maybe_unused]] const std::string_view* names, F&... fields) {
        [[maybe_unused]] std::size_t i = 0;
        return ((codec<F>::get(from, fields, in) ? (from += codec<F>::min_size, ++i, true) : in.in_field(names[i])) &&
                ...);
    }
    static void write([[maybe_unused]] writer to, const F&... fields) { to(fields...); }
    static bool read([[maybe_unused]] reader& in, [[maybe_unused]] const std::string_view* names, F&... fields) {
        [[maybe_unused]] std::size_t i = 0;
        return ((in(fields) ? (++i, true) : in.in_field(names[i])) && ...);
    }
};

template <class List>
struct sequence_of;
template <class... F>
struct sequence_of<type_list<F...>> {
    using type = sequence<F...>;
};

template <class F>
void encode_field(buffer& out, const void* value) {
    writer{out}(*static_cast<const F*>(value));
}

template <reflected T>
struct codec<T> {
    using fields = typename sequence_of<field_list<T>>::type;
    static constexpr std::size_t min_size = fields::min_size;
    static constexpr bool fixed = fields::fixed;
    // Without padding the fields lie in memory as on the wire.
    static constexpr bool raw = fields::raw && min_size == sizeof(T) && std::is_trivially_copyable_v<T>;

    static void put(std::byte* to, const T& value) requires fixed {
        apply_fields(value, [to](const auto&... f) { fields::put(to, f...); });
    }
    static bool get(const std::byte* from, T& value, reader& in) requires fixed {
        return apply_fields(value,
                            [&in, from](auto&... f) { return fields::get(from, in, field_names<T>.data(), f...); });
    }
    static void write(writer to, const T& value) {
        apply_fields(value, [to](const auto&... f) { fields::write(to, f...); });
    }
    static bool read(reader& in, T& value) {
        return apply_fields(value, [&in](auto&... f) { return fields::read(in, field_names<T>.data(), f...); });
    }

    static type_description describe() {
        std::array<described_field, field_names<T>.size()> fields;
        const T presets{};
        auto next = fields.begin();
        for_each_field(presets, [&next]<class F>(std::string_view name, const F& field) {
            *next++ = {name, &codec<std::remove_cv_t<F>>::describe, &encode_field<F>, std::addressof(field)};
        });
        return describe_structure(type_name<T>, fields);
    }
};

// --- pair and tuple -----------------------------------------------------------------------------------------------
inline constexpr auto tuple_field_names = [] {
    std::array<std::string_view, 16> names{"0", "1", "2", "3", "4", "5", "6", "7", "8", "9"};
    for (std::size_t i = 10; i < names.size(); ++i) names[i] = "9+";
    return names;
}();

template <class Tuple, class... F>
struct tuple_codec {
    using fields = sequence<F...>;
    static_assert(sizeof...(F) <= 16, "ise: a tuple in a packet has at most 16 elements: use a struct");
    static constexpr std::size_t min_size = fields::min_size;
    static constexpr bool fixed = fields::fixed;
    static constexpr bool raw = false;

    static void put(std::byte* to, const Tuple& value) requires fixed {
        std::apply([to](const auto&... f) { fields::put(to, f...); }, value);
    }
    static bool get(const std::byte* from, Tuple& value, reader& in) requires fixed {
        return std::apply([&in, from](auto&... f) { return fields::get(from, in, tuple_field_names.data(), f...); },
                          value);
    }
    static void write(writer to, const Tuple& value) {
        std::apply([to](const auto&... f) { fields::write(to, f...); }, value);
    }
    static bool read(reader& in, Tuple& value) {
        return std::apply([&in](auto&... f) { return fields::read(in, tuple_field_names.data(), f...); }, value);
    }
    static type_description describe() { return describe_parts(type_kind::tuple, {&codec<F>::describe...}); }
};
template <class A, class B>
struct codec<std::pair<A, B>> : tuple_codec<std::pair<A, B>, A, B> {};
template <class... T>
struct codec<std::tuple<T...>> : tuple_codec<std::tuple<T...>, T...> {};

// --- time ---------------------------------------------------------------------------------------------------------
template <class Rep, class Period>
struct codec<std::chrono::duration<Rep, Period>> {
    using duration = std::chrono::duration<Rep, Period>;
    using wide = std::conditional_t<std::is_floating_point_v<Rep>, double, std::int64_t>;
    static constexpr std::size_t min_size = 8;
    static constexpr bool fixed = true;
    static constexpr bool raw = little_endian_machine && std::is_same_v<Rep, wide>;

    static void put(std::byte* to, duration value) noexcept { store_little(to, static_cast<wide>(value.count())); }
    static bool get(const std::byte* from, duration& value, reader& in) {
        wide count = load_little<wide>(from);
        Rep fitting = static_cast<Rep>(count);
        if constexpr (std::is_integral_v<Rep>) {
            if (!std::in_range<Rep>(count)) [[unlikely]]
                return in.fail(std::to_string(count) + " does not fit this duration");
        }
        value = duration(fitting);
        return true;
    }
    static type_description describe() {
        type_description type;
        type.kind = type_kind::time_span;
        type.number = std::is_floating_point_v<Rep> ? type_kind::f64 : type_kind::i64;
        type.period_num = Period::num;
        type.period_den = Period::den;
        type.complete();
        return type;
    }
};

template <class Duration>
struct codec<std::chrono::time_point<std::chrono::system_clock, Duration>> {
    using point = std::chrono::time_point<std::chrono::system_clock, Duration>;
    static constexpr std::size_t min_size = 8;
    static constexpr bool fixed = true;
    static constexpr bool raw = codec<Duration>::raw;

    static void put(std::byte* to, point value) noexcept { codec<Duration>::put(to, value.time_since_epoch()); }
    static bool get(const std::byte* from, point& value, reader& in) {
        Duration since{};
        if (!codec<Duration>::get(from, since, in)) return false;
        value = point(since);
        return true;
    }
    static type_description describe() {
        type_description type = codec<Duration>::describe();
        type.kind = type_kind::instant;
        return type;
    }
};

} // namespace ise::detail
