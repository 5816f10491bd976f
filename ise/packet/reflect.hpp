#pragma once
#include <ise/packet/detail/bindings.hpp>
#include <ise/packet/detail/field_count.hpp>
#include <ise/packet/detail/names.hpp>

#include <array>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>

/// Plain structs taken apart without macro or registration: how many fields, which types, which names.
namespace ise {

/// What can be taken apart: an aggregate class. (Whether all of its fields can travel is told by `ise::packet`.)
template <class T>
concept reflectable = std::is_class_v<T> && std::is_aggregate_v<T>;

/// The number of fields.
template <reflectable T>
inline constexpr std::size_t field_count = detail::count_fields<T>();

/// Calls `f(field...)` once, with all fields as lvalues in their order.
template <class T, class F>
constexpr decltype(auto) apply_fields(T& value, F&& f) {
    return detail::apply_counted<field_count<std::remove_const_t<T>>>(value, std::forward<F>(f));
}

namespace detail {

template <class... T>
struct type_list {};

struct to_type_list {
    template <class... Fields>
    auto operator()(const Fields&...) const {
        return type_list<std::remove_cv_t<Fields>...>{};
    }
};

template <class T>
using field_list = decltype(apply_fields(std::declval<T&>(), to_type_list{}));

template <class... T>
std::tuple<T...> as_tuple_type(type_list<T...>);

// An object that exists only by its address: a constant pointer to one of its fields has the field's name in it.
template <class T>
struct nowhere {
    const T value;
    nowhere() = delete;
};
#if defined(__clang__)
    #pragma clang diagnostic push
    #pragma clang diagnostic ignored "-Wundefined-var-template"
    #pragma clang diagnostic ignored "-Wundefined-internal"
#endif
template <class T>
extern const nowhere<T> somewhere;

// The pointer behind so many others.
template <std::size_t>
using any_pointer = const void*;
template <class Before>
struct pointer_behind;
template <std::size_t... Before>
struct pointer_behind<std::index_sequence<Before...>> {
    template <class Field>
    static constexpr Field* among(any_pointer<Before>..., Field* wanted, ...) noexcept {
        return wanted;
    }
};

template <class T, std::size_t I>
constexpr auto* field_pointer() noexcept {
    return apply_fields(somewhere<T>.value,
                        [](auto&... fields) { return pointer_behind<std::make_index_sequence<I>>::among(&fields...); });
}

template <class T, std::size_t... I>
constexpr std::array<std::string_view, sizeof...(I)> names_of_fields(std::index_sequence<I...>) noexcept {
    return {pointed_name<field_pointer<T, I>()>()...};
}
#if defined(__clang__)
    #pragma clang diagnostic pop
#endif

} // namespace detail

/// The type of the I-th field.
template <reflectable T, std::size_t I>
using field_type = std::tuple_element_t<I, decltype(detail::as_tuple_type(detail::field_list<T>{}))>;

/// The names of the fields in their order.
template <reflectable T>
inline constexpr std::array<std::string_view, field_count<T>> field_names =
    detail::names_of_fields<T>(std::make_index_sequence<field_count<T>>());

/// Calls `f(name, field)` for every field in order.
template <class T, class F>
constexpr void for_each_field(T& value, F&& f) {
    apply_fields(value, [&f](auto&... fields) {
        [[maybe_unused]] std::size_t i = 0;
        (f(field_names<std::remove_const_t<T>>[i++], fields), ...);
    });
}

/// The type's own name without namespaces and template arguments, for messages only: no part of any fingerprint.
template <class T>
inline constexpr std::string_view type_name = detail::short_type_name(detail::full_type_name<T>());

} // namespace ise
