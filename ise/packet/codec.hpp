#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>
#include <ise/packet/concept.hpp>
#include <ise/packet/detail/codec_cereal.hpp>
#include <ise/packet/limits.hpp>

// Whoever uses cereal may have types with functions of their own.
#ifdef CEREAL_CEREAL_HPP_
    #include <ise/packet/archive.hpp>
#endif

namespace ise {

/// Appends the bytes of a packet (LAYOUT.md), which are the same with every compiler and processor.
/// Throws `too_large` for a container of 2^32 elements; the buffer then holds a part of the packet.
template <class T>
void encode(const T& value, buffer& out) {
    if constexpr (check_packet<T>()) detail::writer{out}(value);
}

/// A packet as its bytes (LAYOUT.md).
template <class T>
bytes encode(const T& value) {
    buffer out;
    encode(value, out);
    return out.to_bytes();
}

namespace detail {
/// What `encode` appends, of a packet whose memory is just that (`codec<T>::raw`).
template <class T>
bytes_view raw_bytes(const T& packet) noexcept {
    return {static_cast<const std::byte*>(static_cast<const void*>(&packet)), sizeof(T)};
}
template <class T>
bool read_whole(reader& in, T& value) {
    return in(value) && in.finish();
}
/// Where memory and wire are the same bytes there is nothing to go wrong but the length, which the reader tells of.
template <class T>
bool copy_whole(bytes_view input, T& value) {
    if constexpr (codec<T>::raw) {
        if (input.size() != sizeof(T)) return false;
        std::memcpy(static_cast<void*>(&value), input.data(), sizeof(T));
        return true;
    } else {
        return false;
    }
}
} // namespace detail

/// Decodes into an existing value, reusing its memory. All of the input must be consumed.
/// Throws `malformed` naming type, field and cause, or `too_large` beyond the limits; the value is then unspecified.
template <class T>
void decode_into(T& value, bytes_view input, const decode_limits& limits) {
    if constexpr (check_packet<T>()) {
        if (detail::copy_whole(input, value)) return;
        detail::reader in(input, limits);
        if (!detail::read_whole(in, value)) [[unlikely]]
            throw error(in.take_failure(type_name<T>));
    }
}
/// The same with the usual limits.
template <class T>
void decode_into(T& value, bytes_view input) {
    if constexpr (check_packet<T>())
        if (!detail::copy_whole(input, value)) [[unlikely]]
            decode_into(value, input, decode_limits());
}

/// Decodes a packet: as `decode_into`, by value.
template <class T>
T decode(bytes_view input, const decode_limits& limits = {}) {
    T value{};
    decode_into(value, input, limits);
    return value;
}

/// Decodes a packet; returns a failure instead of throwing.
template <class T>
result<T> try_decode(bytes_view input, const decode_limits& limits = {}) {
    T value{};
    if constexpr (check_packet<T>()) {
        if (detail::copy_whole(input, value)) return value;
        detail::reader in(input, limits);
        if (!detail::read_whole(in, value)) [[unlikely]]
            return in.take_failure(type_name<T>);
    }
    return value;
}

} // namespace ise
