#pragma once
#include <ise/core/counted.hpp>
#include <ise/core/passed_object.hpp>
#include <ise/packet/codec.hpp>
#include <ise/packet/detail/extent.hpp>

/// Packets as the objects that they are, for who is in the same process and knows the same C++ type. Who does not
/// gets the bytes after all, from the object.
namespace ise {

/// Whether packets of this type are handed over as objects. Where memory and wire are the same few bytes there is no
/// codec to be spared, and copying them costs less than sharing an object.
template <class T>
inline constexpr bool travels_as_object = !detail::codec<T>::raw || sizeof(T) > 256;

namespace detail {

template <class T>
using passed_packet = std::conditional_t<passed_object::fits<T>, T, std::unique_ptr<T>>;

/// Of a packet with one owner.
template <class T>
inline constexpr object_type owned_packet_type = object_type::of<passed_packet<T>>([](const void* at, buffer& out) {
    if constexpr (passed_object::fits<T>) encode(*static_cast<const T*>(at), out);
    else encode(**static_cast<const std::unique_ptr<T>*>(at), out);
});

/// Of one that many share.
template <class T>
inline constexpr object_type shared_packet_type = object_type::of<counted_holder>([](const void* at, buffer& out) {
    encode(*counted<T>(*static_cast<const counted_holder*>(at)), out);
});

} // namespace detail

/// Moves a packet into an object.
template <class T>
passed_object pass_packet(T& packet) {
    const auto weight = detail::extent(packet);
    if constexpr (passed_object::fits<T>) return {detail::owned_packet_type<T>, std::move(packet), weight};
    else return {detail::owned_packet_type<T>, std::make_unique<T>(std::move(packet)), weight};
}

/// The packet in an object, to be moved from; null if it is of another type.
template <class T>
T* packet_in(passed_object& object) noexcept {
    if (object.type() != &detail::owned_packet_type<T>) return nullptr;
    if constexpr (passed_object::fits<T>) return static_cast<T*>(object.at());
    else return static_cast<std::unique_ptr<T>*>(object.at())->get();
}

/// A packet that is shared by all who get it. Copies of it are holders.
struct shared_packet {
    const object_type* type = nullptr; ///< null: none
    counted_holder content;
    std::size_t weight = 0; ///< bytes that it counts for

    explicit operator bool() const noexcept { return type != nullptr; }
    passed_object pass() const { return {*type, content, weight}; }
    void write(buffer& out) const { type->write(&content, out); }
};

/// Shares a packet: a copy, or what was moved here.
template <class T, class Packet>
shared_packet share_packet(Packet&& packet) {
    auto shared = counted<T>::make(std::forward<Packet>(packet));
    return {&detail::shared_packet_type<T>, shared.untyped(), detail::extent(*shared)};
}

/// The shared packet in an object; empty if it is of another type.
template <class T>
counted<T> shared_packet_in(passed_object& object) noexcept {
    if (object.type() != &detail::shared_packet_type<T>) return {};
    return counted<T>(std::move(*static_cast<counted_holder*>(object.at())));
}

} // namespace ise
