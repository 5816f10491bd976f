#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>
#include <ise/packet/schema.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

/// Packets as protobuf messages (proto3), so that programs of others read them.
namespace ise::bag {

/// The field of every encoded message that has ISE's own bytes of the packet. No descriptor has it: readers skip it.
inline constexpr std::uint32_t own_bytes_field = 536'870'911;

/// Limits on the conversion of packets and protobuf messages, which may come from untrusted sources (LIMITS.md).
struct protobuf_limits {
    std::size_t max_packet_bytes = std::size_t{256} << 20; ///< of the packet that is made of one
    /// Of one that is made of a packet; fits into a chunk of a recording (`reader_limits::max_chunk_bytes`).
    std::size_t max_message_bytes = std::size_t{240} << 20;
};

/// One schema as a protobuf message type, and the conversion of packets. Immutable; may be used from any thread.
///
/// | packet | protobuf |
/// |---|---|
/// | bool, float, double, string | the same; text that is not UTF-8 has U+FFFD |
/// | i8, i16, i32; i64 | sint32; sint64 |
/// | u8, u16, u32, char, byte; u64 | uint32; uint64 |
/// | enum of up to 32 bits but u32 | enum, else a number |
/// | time point; duration | google.protobuf.Timestamp, Duration (f64: double, in seconds) |
/// | vector, array, set | repeated; of bytes or u8: bytes; of char: string |
/// | map | map; of other keys: repeated key and value |
/// | optional | optional; variant: oneof; struct, tuple: message |
/// | containers and optionals in one another | a message with one field `value` |
class protobuf_type {
public:
    /// Throws errc::too_large if it has more types than a descriptor may have.
    explicit protobuf_type(schema of);
    ~protobuf_type();
    protobuf_type(protobuf_type&&) noexcept;
    protobuf_type& operator=(protobuf_type&&) noexcept;

    const schema& of() const noexcept;
    /// The full name of the message: "ise.position".
    const std::string& name() const noexcept;
    /// A serialized google.protobuf.FileDescriptorSet.
    const bytes& descriptors() const noexcept;

    /// Appends a packet as a message; with `own_bytes` also as it is, in `own_bytes_field`. errc::malformed if the
    /// packet does not match the schema, errc::too_large beyond a limit; `to` is unchanged then.
    result<void> encode(bytes_view packet, buffer& to, bool own_bytes,
                        const protobuf_limits& limits = protobuf_limits()) const;
    /// The packet of a message: its own bytes if it has them, else made of the fields. Missing fields are zero. Of a
    /// field that comes twice the last counts. errc::malformed with the field, errc::too_large.
    result<bytes> decode(bytes_view message, const protobuf_limits& limits = protobuf_limits()) const;
    /// The same of the fields alone.
    result<bytes> decode_fields(bytes_view message, const protobuf_limits& limits = protobuf_limits()) const;

private:
    struct state;
    std::unique_ptr<state> state_;
};

} // namespace ise::bag
