#pragma once
#include <ise/core/result.hpp>
#include <ise/packet/codec.hpp>
#include <ise/packet/reflect.hpp>

namespace ise::wire {

/// Reads the body of a control frame from any minor version of the peer: fields that it lacks at the end keep their
/// defaults, fields that it has beyond ours are passed over.
template <class T>
result<T> read_body(bytes_view body) {
    decode_limits limits;
    limits.max_total_bytes = std::size_t{64} << 20;
    detail::reader in(body, limits);
    T value{};
    bool good = true;
    for_each_field(value, [&](std::string_view name, auto& field) {
        if (!good || in.left() == 0) return;
        good = in(field);
        if (!good) in.in_field(name);
    });
    if (!good) return in.take_failure(type_name<T>);
    return value;
}

} // namespace ise::wire
