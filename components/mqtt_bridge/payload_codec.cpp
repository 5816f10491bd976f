#include <components/mqtt_bridge/payload_codec.hpp>

#include <ise/core/buffer.hpp>
#include <ise/core/bytes.hpp>

#include <utility>

namespace ise::mqtt {

payload_codec::payload_codec(const schema& of, bool protobuf) : type_(of) {
    if (protobuf) message_ = std::make_unique<bag::protobuf_type>(of);
}

result<std::string> payload_codec::encode(const dynamic_packet& packet) const {
    if (!message_) return packet.to_json();
    buffer made;
    if (auto done = message_->encode(packet.encoded(), made, false); !done) return done.error();
    return std::string(as_text(made.view()));
}

result<dynamic_packet> payload_codec::decode(const std::string& payload) const {
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
