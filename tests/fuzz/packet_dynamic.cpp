// Any bytes as a packet of any schema: shown as JSON and read back, looked into by any path, and turned into any other
// schema. The input is two schemas and a path, each a line, and the packet.
#include <ise/packet/compatibility.hpp>
#include <ise/packet/dynamic.hpp>

#include <cstdlib>

namespace {

std::string_view line_of(std::string_view& from) {
    auto end = std::min(from.find('\n'), from.size());
    auto line = from.substr(0, end);
    from.remove_prefix(std::min(end + 1, from.size()));
    return line;
}

// A type that takes few bytes may stand for many elements: what a caller accepts decides, and here that is little.
ise::schema_limits small_types() {
    ise::schema_limits limits;
    limits.max_array_length = 1024;
    limits.max_min_size = 1 << 16;
    return limits;
}

void look(const ise::field_view& field) {
    auto either = [](auto read) {
        try {
            (void)read();
        } catch (const ise::error&) { // of another kind
        }
    };
    either([&] { return field.as_bool(); });
    either([&] { return field.as_int(); });
    either([&] { return field.as_uint(); });
    either([&] { return field.as_double(); });
    either([&] { return field.as_string(); });
    either([&] { return field.is_null(); });
    either([&] { return field.size(); });
    either([&] { return field.to_json(); });
    either([&] { return field.as<std::uint8_t>(); });
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::string_view input(reinterpret_cast<const char*>(data), size);
    auto writer = ise::schema::parse(line_of(input), small_types());
    auto reader = ise::schema::parse(line_of(input), small_types());
    auto path = line_of(input);
    if (!writer) return 0;
    ise::decode_limits limits;
    limits.max_total_bytes = std::size_t{1} << 16;
    limits.max_zero_size_elements = 1024;
    std::optional<ise::dynamic_packet> packet;
    try {
        auto raw = ise::as_bytes(input);
        packet.emplace(*writer, ise::bytes(raw.begin(), raw.end()), limits);
    } catch (const ise::error&) {
        return 0;
    }
    try {
        look(packet->field(path));
    } catch (const ise::error&) { // there is no such field
    }
    std::string text;
    try {
        text = packet->to_json();
        (void)packet->to_json(ise::json_style::pretty);
    } catch (const ise::error& why) {
        if (why.code() != ise::errc::too_large) std::abort();
        return 0;
    }
    // Not the same bytes: a NaN has many, a peer's set has any order. But once read and shown it stays as it is.
    auto shown = ise::dynamic_packet::from_json(*writer, text).to_json();
    if (ise::dynamic_packet::from_json(*writer, shown).to_json() != shown) std::abort();
    if (!reader) return 0;
    bool fits = !ise::incompatibility(*reader, *writer);
    std::optional<ise::bytes> turned;
    try {
        turned = ise::adapt(*writer, *reader, packet->encoded(), limits);
    } catch (const ise::error& why) {
        if (fits == (why.code() == ise::errc::type_mismatch)) std::abort();
        return 0;
    }
    if (!fits) std::abort();
    ise::dynamic_packet(*reader, std::move(*turned)); // throws if it is none
    return 0;
}
