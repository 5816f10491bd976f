#pragma once
#include <ise/packet/adapt.hpp>
#include <ise/packet/packet_object.hpp>

#include <utility>

/// Packets on their way through the layers that do not know their types: as bytes, or, within a process, as the objects
/// that they are. Which it is shows here and nowhere else.
namespace ise {

/// A packet that is kept, as a value: its bytes, or the object of this process that it is.
struct payload {
    buffer raw;
    passed_object object;

    /// What it counts for where bytes are bounded.
    std::size_t size() const noexcept { return object ? object.weight() : raw.size(); }
    void clear() noexcept {
        raw.clear();
        object = {};
    }
};

/// A packet that is to be sent. Borrowed: lives as long as the call that it is passed to.
class outgoing_packet {
public:
    /// Moved from if it is handed over as an object.
    template <class T>
    requires(!std::is_same_v<T, outgoing_packet> &&
             !std::is_same_v<T, payload>) explicit outgoing_packet(T& packet) noexcept
        : at_(&packet), as_(&ways_of<T>) {}
    /// One that was kept.
    explicit outgoing_packet(payload& packet) noexcept
        : at_(&packet), as_(packet.object ? &kept_object : &kept_bytes) {}
    /// Bytes that were made before.
    static outgoing_packet of_bytes(const bytes_view& raw) noexcept {
        return {const_cast<bytes_view*>(&raw), &plain_bytes};
    }

    /// Appends its bytes; throws what encoding throws.
    void write(buffer& out) const { as_->write(at_, out); }
    /// Whether it can be handed over as an object.
    bool is_object() const noexcept { return as_->pass != nullptr; }
    /// Hands it over. Only where `is_object()`, once.
    passed_object pass() const { return as_->pass(at_); }
    /// Keeps it, as an object where it can be one.
    payload keep() const;

private:
    struct ways {
        void (*write)(const void* packet, buffer& out);
        passed_object (*pass)(void* packet); // null: as bytes only
    };
    template <class T>
    static constexpr passed_object (*pass_of())(void*) {
        if constexpr (travels_as_object<T>) return [](void* packet) { return pass_packet(*static_cast<T*>(packet)); };
        else return nullptr;
    }
    template <class T>
    static constexpr ways ways_of{[](const void* packet, buffer& out) { encode(*static_cast<const T*>(packet), out); },
                                  pass_of<T>()};
    outgoing_packet(void* at, const ways* as) noexcept : at_(at), as_(as) {}
    static const ways kept_object, kept_bytes, plain_bytes;

    void* at_;
    const ways* as_;
};

/// A packet that has come. Borrowed, like `outgoing_packet`.
class incoming_packet {
public:
    /// `object`: the packet itself, if it came as such; may be moved from.
    incoming_packet(bytes_view raw, passed_object* object) noexcept : raw_(raw), object_(object) {}
    /// One that was kept; it may be moved from.
    explicit incoming_packet(payload& packet) noexcept
        : raw_(packet.raw.view()), object_(packet.object ? &packet.object : nullptr) {}

    /// Where the sender's packet differs from ours.
    const adapter* adapt = nullptr;

    /// The packet by value: moved where it came as an object of this very type, else decoded. Throws what decoding
    /// throws.
    template <class T>
    void take_into(T& packet) {
        if (object_ && !adapt) {
            if (T* same = packet_in<T>(*object_)) {
                packet = std::move(*same);
                return;
            }
        }
        decode_into(packet, bytes_to_decode());
    }
    /// The shared packet, where it came as an object of this very type.
    template <class T>
    counted<T> shared() const noexcept {
        return object_ && !adapt ? shared_packet_in<T>(*object_) : counted<T>();
    }
    /// Its bytes in the receiver's layout; valid as long as this. Throws errc::malformed and the like where there are
    /// none.
    bytes_view bytes() { return object_ || adapt ? made_bytes() : raw_; }
    /// The same for a decoder, which reads each byte once: a packet on loan is not copied before.
    bytes_view bytes_to_decode() { return !adapt && object_ && object_->is_encoded() ? object_->encoded() : bytes(); }
    /// What it counts for where bytes are bounded.
    std::size_t size() const noexcept { return object_ ? object_->weight() : raw_.size(); }
    /// The object, if it is one.
    passed_object* object() const noexcept { return object_; }
    /// Keeps it for longer.
    payload keep();

private:
    bytes_view made_bytes();

    bytes_view raw_;
    passed_object* object_;
    ise::bytes made_;
};

} // namespace ise
