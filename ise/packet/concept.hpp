#pragma once
#include <ise/packet/detail/support.hpp>

#include <type_traits>

/// Which types can be packets, and the compile errors for those that cannot.
namespace ise {

namespace detail {

enum class refusal {
    none,
    long_double,
    wide_character,
    wide_integer,
    pointer,
    reference,
    steady_time,
    view,
    loose_enum,
    bool_enum,
    union_type,
    recursive,
    uncountable,
    too_many_fields,
    base_and_fields,
    bit_field,
    constant,
    no_default,
    hidden,
    unknown
};

/// The type that is refused, and why.
template <class T, refusal reason>
struct refused {
    using type = T;
    static constexpr refusal why = reason;
};
using accepted = refused<void, refusal::none>;

template <class First>
constexpr First first_refusal(First) {
    return {};
}
template <class First, class Second, class... Rest>
constexpr auto first_refusal(First, Second, Rest...) {
    if constexpr (First::why != refusal::none) {
        return First{};
    } else {
        return first_refusal(Second{}, Rest{}...);
    }
}

template <class T, class... Outer>
constexpr auto find_refusal();

template <class... Outer, class... T>
constexpr auto find_refusal_among(type_list<T...>) {
    return first_refusal(accepted{}, find_refusal<T, Outer...>()...);
}

/// Where the fields do not lie as their types say, some of them share bytes.
template <class... T>
consteval bool lies_as_declared([[maybe_unused]] std::size_t size, type_list<T...>) {
    std::size_t end = 0;
    [[maybe_unused]] auto place = [&](std::size_t bytes, std::size_t align, bool is_empty) {
        end = is_empty ? end : (end + align - 1) / align * align + bytes;
    };
    (place(sizeof(T), alignof(T), std::is_empty_v<T>), ...);
    return size >= end;
}

template <class T, class... Outer>
constexpr auto find_refusal_in_fields() {
    if constexpr (has_base_and_members<T>) {
        return refused<T, refusal::base_and_fields>{};
    } else if constexpr (!countable_fields<T>) {
        return refused<T, refusal::uncountable>{};
    } else if constexpr (field_count<T> > max_fields) {
        return refused<T, refusal::too_many_fields>{};
    } else if constexpr (!lies_as_declared(sizeof(T), field_list<T>{})) {
        return refused<T, refusal::bit_field>{};
    } else {
        using among = decltype(find_refusal_among<T, Outer...>(field_list<T>{}));
        if constexpr (among::why != refusal::none) {
            return among{};
        } else if constexpr (!std::is_default_constructible_v<T>) {
            return refused<T, refusal::no_default>{};
        } else if constexpr (!std::is_move_assignable_v<T>) {
            // C arrays assign, constants and references do not.
            return refused<T, refusal::constant>{};
        } else {
            return accepted{};
        }
    }
}

/// A text or range that lies elsewhere: std::string_view, std::span.
template <class T>
concept view = std::is_class_v<T> && !std::is_aggregate_v<T> && std::is_trivially_copyable_v<T> && !own_serialize<T> &&
               requires(const T& of) {
    of.data();
    of.size();
};

template <class T>
concept smart_pointer = std::is_class_v<T> && requires(const T& of) {
    typename T::element_type;
    of.get();
    *of;
};

template <class T, class... Outer>
constexpr auto find_refusal() {
    if constexpr ((std::is_same_v<T, Outer> || ...)) {
        return refused<T, refusal::recursive>{};
    } else if constexpr (std::is_reference_v<T>) {
        return refused<T, refusal::reference>{};
    } else if constexpr (std::is_const_v<T> || std::is_volatile_v<T>) {
        return refused<T, refusal::constant>{};
    } else if constexpr (std::is_same_v<T, long double>) {
        return refused<T, refusal::long_double>{};
    } else if constexpr (std::is_same_v<T, wchar_t> || std::is_same_v<T, char8_t> || std::is_same_v<T, char16_t> ||
                         std::is_same_v<T, char32_t>) {
        return refused<T, refusal::wide_character>{};
    } else if constexpr (number<T>) {
        return accepted{};
    } else if constexpr (std::is_arithmetic_v<T>) {
        return refused<T, refusal::wide_integer>{};
    } else if constexpr (std::is_pointer_v<T> || std::is_member_pointer_v<T> || std::is_null_pointer_v<T>) {
        return refused<T, refusal::pointer>{};
    } else if constexpr (std::is_enum_v<T>) {
        if constexpr (!requires { T{0}; }) {
            return refused<T, refusal::loose_enum>{};
        } else if constexpr (std::is_same_v<std::underlying_type_t<T>, bool>) {
            return refused<T, refusal::bool_enum>{};
        } else {
            return accepted{};
        }
    } else if constexpr (std::is_union_v<T>) {
        return refused<T, refusal::union_type>{};
    } else if constexpr (monotonic_time_point<T>) {
        return refused<T, refusal::steady_time>{};
    } else if constexpr (view<T>) {
        return refused<T, refusal::view>{};
    } else if constexpr (smart_pointer<T>) {
        return refused<T, refusal::pointer>{};
    } else if constexpr (parts<T>::known) {
        using among = decltype(find_refusal_among<Outer...>(typename parts<T>::type{}));
        if constexpr (among::why != refusal::none) {
            return among{};
        } else if constexpr (!std::is_default_constructible_v<T>) {
            return refused<T, refusal::no_default>{};
        } else {
            return accepted{};
        }
    } else if constexpr (own_serialize<T>) {
        if constexpr (!std::is_default_constructible_v<T>) {
            return refused<T, refusal::no_default>{};
        } else {
            return accepted{};
        }
    } else if constexpr (reflectable<T>) {
        return find_refusal_in_fields<T, Outer...>();
    } else if constexpr (std::is_class_v<T>) {
        return refused<T, refusal::hidden>{};
    } else {
        return refused<T, refusal::unknown>{};
    }
}

template <class T>
using refusal_of = decltype(find_refusal<T>());

/// Instantiated where a packet is refused: the compiler's note names the packet and the type inside it.
template <class Packet, class Refused, refusal why>
struct explain_refusal {
    static_assert(why != refusal::long_double,
                  "ise: a packet cannot hold a long double, whose size differs between machines: use double");
    static_assert(
        why != refusal::wide_character,
        "ise: a packet cannot hold wchar_t, char8_t, char16_t or char32_t: use char and std::string (UTF-8), or "
        "an integer of fixed width");
    static_assert(why != refusal::wide_integer, "ise: a packet holds integers of at most 64 bits: split it in two");
    static_assert(why != refusal::pointer,
                  "ise: a packet cannot hold a pointer, which means nothing to another process: use the value itself, "
                  "std::optional, or std::vector");
    static_assert(why != refusal::reference, "ise: a packet cannot hold a reference: use the value itself");
    static_assert(
        why != refusal::steady_time,
        "ise: a packet cannot hold a time point of a steady clock, which means nothing on another machine: use "
        "a std::chrono::system_clock time point or a duration");
    static_assert(why != refusal::view, "ise: a packet cannot hold a view, which owns nothing: use std::string instead "
                                        "of std::string_view, std::vector "
                                        "instead of std::span");
    static_assert(why != refusal::loose_enum,
                  "ise: the size of this enum is the compiler's choice: give it a type, enum mode : std::uint8_t {…}");
    static_assert(why != refusal::bool_enum, "ise: an enum over bool cannot grow: use std::uint8_t beneath it");
    static_assert(why != refusal::union_type, "ise: a packet cannot hold a union: use std::variant");
    static_assert(why != refusal::recursive,
                  "ise: a packet cannot contain itself: use indices into a std::vector instead, or an opaque type with "
                  "a cereal serialize (ise::opaque_type)");
    static_assert(why != refusal::uncountable,
                  "ise: the fields of this struct cannot be counted: it has a reference, a field that nothing converts "
                  "to, or private parts. Use values, or give it a cereal serialize");
    static_assert(why != refusal::too_many_fields, "ise: a struct has at most 64 fields: group some in nested structs");
    static_assert(why != refusal::base_and_fields,
                  "ise: a packet cannot have a base and fields of its own: make the base its first field");
    static_assert(
        why != refusal::bit_field,
        "ise: a packet cannot have bit-fields or packed fields: use integers of fixed width and std::vector or "
        "an enum for flags");
    static_assert(why != refusal::constant, "ise: a packet is decoded into, its fields cannot be const or references");
    static_assert(why != refusal::no_default,
                  "ise: a packet needs a default value, T{} must compile: give this type or the field a default");
    static_assert(why != refusal::hidden,
                  "ise: this class is no aggregate and brings no cereal serialize: make it a plain struct (no "
                  "constructors, no private parts), or give it a public serialize(archive)");
    static_assert(why != refusal::unknown, "ise: this type cannot travel in a packet: use one of those that "
                                           "ise/packet/LAYOUT.md lists");
};
template <class Packet, class Refused>
struct explain_refusal<Packet, Refused, refusal::none> {};

} // namespace detail

/// A type that can be a packet: plain structs of plain values, standard containers of these, and types with a cereal
/// serialize.
template <class T>
concept packet = detail::refusal_of<T>::why == detail::refusal::none;

/// Compiles if T can be a packet; otherwise the compile error names the obstacle and the remedy.
template <class T>
consteval bool check_packet() {
    using why = detail::refusal_of<T>;
    (void)sizeof(detail::explain_refusal<T, typename why::type, why::why>);
    return packet<T>;
}

} // namespace ise
