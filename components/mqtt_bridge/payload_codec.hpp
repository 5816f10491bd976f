#pragma once
#include <ise/bag/protobuf.hpp>
#include <ise/core/result.hpp>
#include <ise/packet/dynamic.hpp>

#include <cstddef>
#include <memory>
#include <string>

namespace ise::mqtt {

inline constexpr std::size_t max_message_bytes = std::size_t{4} << 20; ///< of a payload

/// Packets of one type as payloads of messages, in JSON or protobuf.
class payload_codec {
public:
    /// Throws ise::error for a type that protobuf cannot have.
    payload_codec(const schema& of, bool protobuf);

    /// errc::too_large beyond `max_message_bytes`.
    result<std::string> encode(const dynamic_packet& packet) const;
    /// errc::malformed; errc::too_large beyond `max_message_bytes`, or for a packet of more than 16 MiB.
    result<dynamic_packet> decode(const std::string& payload) const;
    /// Null: payloads are JSON.
    const bag::protobuf_type* message() const noexcept { return message_.get(); }

private:
    schema type_;
    std::unique_ptr<bag::protobuf_type> message_;
};

} // namespace ise::mqtt
