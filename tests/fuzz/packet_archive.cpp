// Any bytes as a packet: the typed decoder and the walk at run time agree, and what is accepted is encoded again.
#include "../unit/packet/examples.hpp"
#include <ise/packet/dynamic.hpp>

#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    ise::bytes_view input(reinterpret_cast<const std::byte*>(data), size);
    const auto& schema = ise::schema_of<example::everything>();
    bool walked = true;
    try {
        ise::dynamic_packet packet(schema, ise::bytes(input.begin(), input.end()));
        (void)packet.to_json();
    } catch (const ise::error&) {
        walked = false;
    }
    auto decoded = ise::try_decode<example::everything>(input);
    if (decoded && !walked) std::abort();
    if (decoded && ise::encode(*decoded).size() != size) std::abort();
    return 0;
}
