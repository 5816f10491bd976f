// Any text as a schema, first alone, then as the writer of the bytes that follow a newline.
#include "../unit/packet/examples.hpp"
#include <ise/packet/adapt.hpp>
#include <ise/packet/compatibility.hpp>
#include <ise/packet/dynamic.hpp>

#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::string_view input(reinterpret_cast<const char*>(data), size);
    std::size_t end = std::min(input.find('\n'), input.size());
    auto writer = ise::schema::parse(input.substr(0, end));
    if (!writer) return 0;
    auto again = ise::schema::parse(writer->text());
    if (!again || !(*again == *writer) || again->fingerprint() != writer->fingerprint()) std::abort();
    (void)writer->pretty();
    (void)ise::incompatibility(ise::schema_of<example::everything>(), *writer);
    ise::bytes_view packet = ise::as_bytes(input.substr(end == input.size() ? end : end + 1));
    ise::decode_limits limits;
    limits.max_total_bytes = std::size_t{1} << 20;
    try {
        ise::dynamic_packet got(*writer, ise::bytes(packet.begin(), packet.end()), limits);
        (void)ise::adapt(*writer, ise::schema_of<example::everything>(), packet, limits);
    } catch (const ise::error&) {}
    return 0;
}
