// Any bytes as a protobuf message of a packet, and as the packet: what is made of them is what they say.
// link: ise_bag
#include "../unit/packet/examples.hpp"
#include <ise/bag/protobuf.hpp>
#include <ise/core/buffer.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/packet/schema.hpp>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <utility>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const ise::bag::protobuf_type type(ise::schema_of<example::everything>());
    ise::bytes_view input = std::as_bytes(std::span(data, size));
    ise::bag::protobuf_limits limits;
    limits.max_packet_bytes = std::size_t{1} << 20;
    (void)type.decode(input, limits);
    if (auto packet = type.decode_fields(input, limits)) {
        // It may still be none, such as one with two equal keys; if it is one, it becomes a message again.
        try {
            ise::dynamic_packet whole(type.of(), *packet);
        } catch (const ise::error&) {
            return 0;
        }
        ise::buffer again;
        if (!type.encode(*packet, again, true)) std::abort();
        auto back = type.decode(again.view());
        if (!back || *back != *packet) std::abort();
    }
    ise::buffer message;
    (void)type.encode(input, message, false);
    return 0;
}
