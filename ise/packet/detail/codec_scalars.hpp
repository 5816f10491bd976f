#pragma once
#include <ise/packet/detail/describe.hpp>
#include <ise/packet/detail/support.hpp>
#include <ise/packet/detail/wire_archive.hpp>
#include <ise/packet/type.hpp>

/// How the wire archive passes each type, and how the type is described. A codec<T> has
///   min_size, fixed   the fewest bytes of a value; whether every value takes as many
///   raw               whether memory and wire are the same bytes, so that many are one memcpy
///   put, get          (fixed) to and from min_size bytes that are there
///   write, read       (not fixed) by a writer, by a reader
///   describe          the type as data
namespace ise::detail {

template <class T>
struct codec;

template <class T>
inline void writer::write(const T& value) const {
    if constexpr (codec<T>::fixed) {
        codec<T>::put(out_->grow(codec<T>::min_size), value);
    } else {
        codec<T>::write(*this, value);
    }
}

template <class T>
inline bool reader::operator()(T& value) {
    if constexpr (codec<T>::fixed) {
        const std::byte* from = take(codec<T>::min_size);
        if (from || codec<T>::min_size == 0) [[likely]]
            return codec<T>::get(from, value, *this);
        if constexpr (requires { codec<T>::read(*this, value); }) {
            return codec<T>::read(*this, value); // piece by piece, only to name the one that is cut
        } else {
            return fail_short(codec<T>::min_size);
        }
    } else {
        return codec<T>::read(*this, value);
    }
}

template <class T>
constexpr type_kind kind_of_number() {
    if constexpr (std::is_same_v<T, bool>) return type_kind::boolean;
    else if constexpr (std::is_same_v<T, char>) return type_kind::character;
    else if constexpr (std::is_same_v<T, float>) return type_kind::f32;
    else if constexpr (std::is_same_v<T, double>) return type_kind::f64;
    else if constexpr (sizeof(T) == 1) return std::is_signed_v<T> ? type_kind::i8 : type_kind::u8;
    else if constexpr (sizeof(T) == 2) return std::is_signed_v<T> ? type_kind::i16 : type_kind::u16;
    else if constexpr (sizeof(T) == 4) return std::is_signed_v<T> ? type_kind::i32 : type_kind::u32;
    else return std::is_signed_v<T> ? type_kind::i64 : type_kind::u64;
}

template <number T>
struct codec<T> {
    static_assert(sizeof(float) == 4 && sizeof(double) == 8);
    static constexpr std::size_t min_size = sizeof(T);
    static constexpr bool fixed = true;
    static constexpr bool raw = little_endian_machine && !std::is_same_v<T, bool>;

    static void put(std::byte* to, T value) noexcept { store_little(to, value); }
    static bool get(const std::byte* from, T& value, reader&) noexcept {
        value = load_little<T>(from);
        return true;
    }
    static type_description describe() { return describe_scalar(kind_of_number<T>()); }
};

template <>
struct codec<bool> {
    static constexpr std::size_t min_size = 1;
    static constexpr bool fixed = true;
    static constexpr bool raw = false; // only 0 and 1 may become a bool

    static void put(std::byte* to, bool value) noexcept { *to = std::byte{value}; }
    static bool get(const std::byte* from, bool& value, reader& in) {
        if (std::to_integer<unsigned>(*from) > 1) [[unlikely]]
            return in.fail_flag("a bool", std::to_integer<unsigned>(*from));
        value = *from == std::byte{1};
        return true;
    }
    static type_description describe() { return describe_scalar(type_kind::boolean); }
};

template <>
struct codec<std::byte> {
    static constexpr std::size_t min_size = 1;
    static constexpr bool fixed = true;
    static constexpr bool raw = true;

    static void put(std::byte* to, std::byte value) noexcept { *to = value; }
    static bool get(const std::byte* from, std::byte& value, reader&) noexcept {
        value = *from;
        return true;
    }
    static type_description describe() { return describe_scalar(type_kind::byte); }
};

template <class E>
requires std::is_enum_v<E>
struct codec<E> {
    using number = std::underlying_type_t<E>;
    static constexpr std::size_t min_size = sizeof(number);
    static constexpr bool fixed = true;
    static constexpr bool raw = little_endian_machine;

    static void put(std::byte* to, E value) noexcept { store_little(to, static_cast<number>(value)); }
    static bool get(const std::byte* from, E& value, reader&) noexcept {
        value = static_cast<E>(load_little<number>(from)); // unknown enumerators stay numbers
        return true;
    }
    static type_description describe() {
        return describe_enumeration(type_name<E>, kind_of_number<number>(), enumerators<E>());
    }
};

} // namespace ise::detail
