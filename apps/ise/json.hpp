#pragma once
#include <ise/packet/detail/text_forms.hpp>
#include <ise/packet/enums.hpp>
#include <ise/packet/reflect.hpp>

#include <chrono>
#include <concepts>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

/// What `--json` prints: each answer is a plain struct whose fields, by reflection, are those of its JSON. Unlike
/// packets (ise/packet/json.hpp) such a struct may contain itself, leave fields out and list values of several types;
/// one with `json()` is printed as what that returns.
namespace ise::cli {

/// A field that is left out where there is nothing; a std::optional is `null` there.
template <class T>
struct if_any : std::optional<T> {
    using std::optional<T>::optional;
};

/// An object whose keys are data, in their order.
template <class T>
using json_object = std::vector<std::pair<std::string, T>>;

/// A value that is JSON already, such as that of a packet.
struct json_text {
    std::string text;
};

namespace json_detail {

template <class T>
inline constexpr bool is_optional = false;
template <class T>
inline constexpr bool is_optional<std::optional<T>> = true;
template <class T>
inline constexpr bool is_left_out = false;
template <class T>
inline constexpr bool is_left_out<if_any<T>> = true;
template <class T>
inline constexpr bool is_length_of_time = false;
template <class Number, class Period>
inline constexpr bool is_length_of_time<std::chrono::duration<Number, Period>> = true;
template <class T>
inline constexpr bool is_list = false;
template <class T>
inline constexpr bool is_list<std::vector<T>> = true;
template <class T>
inline constexpr bool is_object = false;
template <class T>
inline constexpr bool is_object<std::map<std::string, T>> = true;
template <class T>
inline constexpr bool is_object<json_object<T>> = true;
template <class T>
inline constexpr bool is_variant = false;
template <class... T>
inline constexpr bool is_variant<std::variant<T...>> = true;

template <class T>
void append(std::string& to, const T& value);

template <class T>
void append_field(std::string& to, char& before, std::string_view name, const T& value) {
    if constexpr (is_left_out<T>) {
        if (value) append_field(to, before, name, *value);
    } else {
        to += std::exchange(before, ',');
        ise::detail::append_json_string(to, name);
        to += ':';
        append(to, value);
    }
}

// "2.0": whatever the value, a reader sees what kind of number it is.
inline void append_floating(std::string& to, double value) {
    auto from = to.size();
    ise::detail::append_json_number(to, value);
    if (to.find_first_not_of("-0123456789", from) == to.npos) to += ".0";
}

// A length of time is a number of seconds.
template <class T>
void append(std::string& to, const T& value) {
    if constexpr (requires { value.json(); }) {
        append(to, value.json());
    } else if constexpr (std::same_as<T, bool>) {
        to += value ? "true" : "false";
    } else if constexpr (std::integral<T>) {
        to += std::to_string(value);
    } else if constexpr (std::floating_point<T>) {
        append_floating(to, value);
    } else if constexpr (is_length_of_time<T>) {
        append_floating(to, std::chrono::duration<double>(value).count());
    } else if constexpr (std::same_as<T, json_text>) {
        to += value.text;
    } else if constexpr (std::is_enum_v<T>) {
        for (const auto& one : enumerators<T>())
            if (one.value == static_cast<std::int64_t>(value)) return ise::detail::append_json_string(to, one.name);
        to += std::to_string(static_cast<std::int64_t>(value)); // of a newer version
    } else if constexpr (std::convertible_to<const T&, std::string_view>) {
        ise::detail::append_json_string(to, value);
    } else if constexpr (is_optional<T>) {
        if (value) append(to, *value);
        else to += "null";
    } else if constexpr (is_variant<T>) {
        std::visit([&](const auto& one) { append(to, one); }, value);
    } else if constexpr (is_object<T>) {
        char before = '{';
        for (const auto& [name, one] : value) append_field(to, before, name, one);
        to += before == '{' ? "{}" : "}";
    } else if constexpr (is_list<T>) {
        char before = '[';
        for (const auto& one : value) {
            to += std::exchange(before, ',');
            append(to, one);
        }
        to += before == '[' ? "[]" : "]";
    } else {
        static_assert(reflectable<T>, "a plain struct, or a value that JSON has");
        char before = '{';
        for_each_field(value, [&](std::string_view name, const auto& one) { append_field(to, before, name, one); });
        to += before == '{' ? "{}" : "}";
    }
}

} // namespace json_detail

/// The value as one line of JSON, with its end.
template <class T>
std::string json_line(const T& value) {
    std::string text;
    json_detail::append(text, value);
    return text + "\n";
}

} // namespace ise::cli
