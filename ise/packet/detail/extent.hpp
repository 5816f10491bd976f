#pragma once
#include <ise/packet/detail/codec_cereal.hpp>

/// How many bytes a packet would take, told from its lengths alone: nothing is encoded.
namespace ise::detail {

template <class T>
std::size_t extent(const T& value);

template <class Range>
std::size_t extent_of_all(const Range& values) {
    std::size_t sum = 0;
    for (const auto& value : values) sum += extent(value);
    return sum;
}

template <class T>
std::size_t extent(const T& value) {
    const auto together = [](const auto&... fields) { return (std::size_t{0} + ... + extent(fields)); };
    if constexpr (codec<T>::fixed) {
        return codec<T>::min_size;
    } else if constexpr (own_serialize<T> || opaque<T>) {
        return sizeof(T); // only its own functions could tell
    } else if constexpr (reflected<T>) {
        return apply_fields(value, together);
    } else if constexpr (std::is_array_v<T>) {
        return extent_of_all(value);
    } else if constexpr (requires { value.valueless_by_exception(); }) {
        return sizeof(typename codec<T>::index) + (value.valueless_by_exception() ? 0 : std::visit(together, value));
    } else if constexpr (requires { value.has_value(); }) {
        return 1 + (value ? extent(*value) : 0);
    } else if constexpr (!requires { value.begin(); }) {
        return std::apply(together, value); // a pair or a tuple
    } else if constexpr (requires { typename T::mapped_type; }) {
        std::size_t sum = codec<T>::min_size;
        for (const auto& [key, mapped] : value) sum += extent(key) + extent(mapped);
        return sum;
    } else if constexpr (codec<typename T::value_type>::fixed) {
        return codec<T>::min_size + value.size() * codec<typename T::value_type>::min_size;
    } else {
        return codec<T>::min_size + extent_of_all(value);
    }
}

} // namespace ise::detail
