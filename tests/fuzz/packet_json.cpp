// Any text as JSON: what is accepted is a packet, and its own JSON gives the same packet.
#include "../unit/packet/examples.hpp"
#include <ise/packet/json.hpp>

#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::string_view input(reinterpret_cast<const char*>(data), size);
    const auto& schema = ise::schema_of<example::everything>();
    ise::bytes packet;
    try {
        packet = ise::from_json(schema, input);
    } catch (const ise::error&) {
        return 0;
    }
    std::string shown = ise::to_json(schema, packet);
    if (ise::to_json(schema, ise::from_json(schema, shown)) != shown) std::abort();
    return 0;
}
