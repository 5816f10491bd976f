#include <components/mqtt_bridge/payload_codec.hpp>

#include <ise/core/buffer.hpp>
#include <ise/core/bytes.hpp>
#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <utility>

namespace ise::mqtt {
namespace {

failure too_large(std::size_t size) {
    return failure(errc::too_large,
                   fmt::format("it has {} bytes, {} at most (max_message_bytes)", size, max_message_bytes));
}

} // namespace

payload_codec::payload_codec(const schema& of, bool protobuf) : type_(of) {
    if (protobuf) message_ = std::make_unique<bag::protobuf_type>(of);
}

result<std::string> payload_codec::encode(const dynamic_packet& packet) const {
    try {
        if (!message_) {
            auto json = to_json(type_, packet.encoded(), json_style::compact, max_message_bytes);
            if (json.size() > max_message_bytes) return too_large(json.size());
            return json;
        }
        bag::protobuf_limits limits;
        limits.max_message_bytes = max_message_bytes;
        buffer made;
        if (auto done = message_->encode(packet.encoded(), made, false, limits); !done) return done.error();
        return std::string(as_text(made.view()));
    } catch (const error& why) {
        return why.why();
    }
}

result<dynamic_packet> payload_codec::decode(const std::string& payload) const {
    if (payload.size() > max_message_bytes) return too_large(payload.size());
    try {
        if (!message_) return dynamic_packet::from_json(type_, payload);
        bag::protobuf_limits limits;
        limits.max_packet_bytes = std::size_t{16} << 20;
        auto packet = message_->decode_fields(as_bytes(payload), limits);
        if (!packet) return packet.error();
        return dynamic_packet(type_, std::move(*packet));
    } catch (const error& why) {
        return why.why();
    }
}

} // namespace ise::mqtt
