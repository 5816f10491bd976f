// Packets as protobuf messages, and back.
#include <ise/bag/protobuf.hpp>
#include <ise/packet/codec.hpp>
#include <ise/packet/json.hpp>
#include <ise/packet/schema.hpp>

#include <support/catch.hpp>

#include <array>
#include <chrono>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <variant>
#include <vector>

namespace {

using namespace ise;
using namespace ise::bag;

enum class sail : std::uint8_t { furled = 1, reefed = 2, full = 5 };
enum class side : std::int32_t { port = -1, none = 0, starboard = 1 };

struct waypoint {
    double latitude_deg = 0;
    double longitude_deg = 0;
    std::optional<std::string> name;
};

struct everything {
    bool flag = false;
    char letter = 'a';
    std::byte raw{};
    std::int8_t i8 = 0;
    std::uint8_t u8 = 0;
    std::int16_t i16 = 0;
    std::uint16_t u16 = 0;
    std::int32_t i32 = 0;
    std::uint32_t u32 = 0;
    std::int64_t i64 = 0;
    std::uint64_t u64 = 0;
    float f32 = 0;
    double f64 = 0;
    std::string text;
    sail sails = sail::furled;
    side to = side::none;
    std::vector<waypoint> route;
    std::array<float, 3> wind{};
    std::vector<std::uint8_t> blob;
    std::array<char, 8> code{};
    std::set<std::int32_t> numbers;
    std::map<std::string, double> named;
    std::map<sail, std::vector<std::string>> by_sail;
    std::optional<std::int32_t> maybe;
    std::optional<std::vector<bool>> maybe_flags;
    std::variant<std::int32_t, std::string, waypoint> any;
    std::tuple<std::int32_t, std::string> pair;
    std::chrono::milliseconds span{};
    std::chrono::sys_time<std::chrono::nanoseconds> when{};
    std::chrono::duration<double> seconds{};
    std::vector<std::vector<std::int32_t>> rows;
};

everything sample() {
    everything made;
    made.flag = true;
    made.letter = 'z';
    made.raw = std::byte{200};
    made.i8 = -100;
    made.u8 = 255;
    made.i16 = -30000;
    made.u16 = 65535;
    made.i32 = std::numeric_limits<std::int32_t>::min();
    made.u32 = std::numeric_limits<std::uint32_t>::max();
    made.i64 = std::numeric_limits<std::int64_t>::min();
    made.u64 = std::numeric_limits<std::uint64_t>::max();
    made.f32 = -0.0f;
    made.f64 = 1.5e300;
    made.text = "Las Palmas";
    made.sails = sail::full;
    made.to = side::port;
    made.route.resize(2);
    made.route[1].latitude_deg = 28.1;
    made.route[1].name = "";
    made.wind = {1, 2, 3};
    made.blob = {0, 1, 255};
    made.code = {'a', 'b'};
    made.numbers = {-5, 0, 7};
    made.named = {{"", 0}, {"b", 2}};
    made.by_sail[sail::reefed] = {"x", ""};
    made.maybe = 0;
    made.maybe_flags = std::vector<bool>{true, false};
    made.any = waypoint{1, 2, "there"};
    made.pair = {3, "three"};
    made.span = std::chrono::milliseconds(-1500);
    made.when = std::chrono::sys_time<std::chrono::nanoseconds>(std::chrono::nanoseconds(1'700'000'000'123'456'789));
    made.seconds = std::chrono::duration<double>(0.25);
    made.rows = {{}, {1, 2}, {3}};
    return made;
}

std::string hex(bytes_view raw) {
    std::string made;
    for (auto one : raw)
        made += "0123456789abcdef"[static_cast<int>(one) >> 4], made += "0123456789abcdef"[static_cast<int>(one) & 15];
    return made;
}

} // namespace

TEST_CASE("a packet of every type becomes a protobuf message and comes back", "[bag]") {
    protobuf_type type(schema_of<everything>());
    CHECK(type.name() == "ise.everything");
    for (const auto& packet : {sample(), everything()}) {
        auto raw = encode(packet);
        buffer message;
        type.encode(raw, message, false).value();
        auto back = type.decode_fields(message.view()).value();
        CHECK(to_json(schema_of<everything>(), back) == to_json(schema_of<everything>(), raw));
        CHECK(hex(back) == hex(raw));
    }
}

TEST_CASE("a message has what protoc's programs write", "[bag]") {
    waypoint there;
    there.latitude_deg = 1;
    there.name = "x";
    buffer message;
    protobuf_type type(schema_of<waypoint>());
    type.encode(encode(there), message, false).value();
    CHECK(hex(message.view()) == "09000000000000f03f1a0178"); // 1: fixed64, 3: text; a zero is left out
    message.clear();
    type.encode(encode(there), message, true).value();
    CHECK(hex(message.view()) == "09000000000000f03f1a0178"
                                 "faffffff0f16" +
                                     hex(encode(there)));
    CHECK(type.decode(message.view()).value() == encode(there));
}

TEST_CASE("text that is not UTF-8 is shown with U+FFFD, and replayed as it was", "[bag]") {
    waypoint there;
    there.name = "a\xff\xc3\xa4";
    protobuf_type type(schema_of<waypoint>());
    buffer message;
    type.encode(encode(there), message, true).value();
    CHECK(as_text(message.view()).find("a\xef\xbf\xbd\xc3\xa4") != std::string_view::npos);
    CHECK(type.decode(message.view()).value() == encode(there));
}

TEST_CASE("a message that does not fit is refused with its field", "[bag]") {
    protobuf_type type(schema_of<everything>());
    auto refused = [&](std::initializer_list<unsigned char> message, std::string_view why) {
        auto got = type.decode(std::as_bytes(std::span(message.begin(), message.size())));
        REQUIRE(!got);
        CHECK(got.error().code() == errc::malformed);
        INFO(got.error().message());
        CHECK(got.error().message().find(why) != std::string::npos);
    };
    refused({0x08}, "the message ends within a number");
    refused({0x0b}, "group");
    refused({0x0d, 1, 2, 3, 4}, "the field 'flag' has another type");
    refused({0x10, 0x80, 0x04}, "the field 'letter' has the value 512");
    refused({0x72, 0x7f}, "the message ends within a field");
    refused({0x00, 0x00}, "impossible number");
    refused({0x92, 0x01, 4, 0, 0, 0, 0}, "the field 'wind' has 1 elements instead of 3");
    bytes huge(5);
    CHECK(!type.decode(huge));
    protobuf_limits limits;
    limits.max_packet_bytes = 16;
    auto got = type.decode(bytes_view(), limits);
    REQUIRE(!got);
    CHECK(got.error().code() == errc::too_large);
}

TEST_CASE("no byte of a packet or a message that is changed harms the conversion", "[bag]") {
    protobuf_type type(schema_of<everything>());
    auto raw = encode(sample());
    buffer message;
    type.encode(raw, message, false).value();
    for (std::size_t at = 0; at < raw.size(); ++at) {
        auto changed = raw;
        changed[at] ^= std::byte{0xff};
        buffer to;
        [[maybe_unused]] auto got = type.encode(changed, to, true);
        changed.resize(at);
        CHECK(!type.encode(changed, to, true));
    }
    for (std::size_t at = 0; at < message.size(); ++at) {
        auto changed = message.to_bytes();
        changed[at] ^= std::byte{0xff};
        [[maybe_unused]] auto got = type.decode(changed);
    }
}

TEST_CASE("values without bytes do not multiply a packet or a message without bound", "[bag]") {
    auto beyond = [](const auto& got, std::string_view limit) {
        REQUIRE(!got);
        INFO(got.error().message());
        CHECK(got.error().code() == errc::too_large);
        CHECK(got.error().message().find(limit) != std::string::npos);
    };
    buffer out;
    for (std::string text : {"struct p{a:array<array<struct e{},65536>,65536>}",
                             "struct p{a:array<array<array<struct e{},60000>,60000>,60000>}"}) {
        protobuf_type type(schema::parse(text).value());
        beyond(type.encode(bytes_view(), out, false), "max_empty_values");
        beyond(type.decode(bytes_view()), "max_empty_values");
    }
    constexpr std::uint32_t count = 8192; // vectors, the first of which has as many elements as bytes follow it
    buffer packet;
    packet.append(count);
    for (std::uint32_t i = 0; i < count; ++i) packet.append((count - 1 - i) * 4);
    protobuf_type quadratic(schema::parse("struct p{a:vector<vector<struct{}>>}").value());
    beyond(quadratic.encode(packet.view(), out, false), "max_empty_values");
    // A byte that is wrapped in many messages.
    std::string text = "bool";
    for (int i = 0; i < 60; ++i) text = "struct s{a:" + text + "}";
    protobuf_type deep(schema::parse("struct p{a:vector<" + text + ">}").value());
    packet.clear();
    packet.append(std::uint32_t{1} << 16);
    packet.append(bytes(std::size_t{1} << 16, std::byte{1}));
    protobuf_limits limits;
    limits.max_message_bytes = std::size_t{1} << 20;
    beyond(deep.encode(packet.view(), out, false, limits), "max_message_bytes");
    protobuf_type blob(schema::parse("struct p{a:vector<u8>}").value());
    packet.clear();
    packet.append(std::uint32_t{1} << 19);
    packet.append(bytes(std::size_t{1} << 19));
    CHECK(blob.encode(packet.view(), out, false, limits));
    beyond(blob.encode(packet.view(), out, true, limits), "max_message_bytes");
    // What programs have: alternatives and elements without fields, one for each byte or for none.
    out.clear();
    protobuf_type many(schema::parse("struct p{a:vector<struct e{}>}").value());
    packet.clear();
    packet.append(std::uint32_t{65536});
    CHECK(many.encode(packet.view(), out, false));
    CHECK(many.decode(out.view()).value() == packet.to_bytes());
}

TEST_CASE("a message of many fields takes no memory for each of them", "[bag]") {
    protobuf_type type(schema::parse("struct p{a:u8,b:u8,c:vector<string>}").value());
    auto message_of = [](std::initializer_list<unsigned char> part, std::size_t times) {
        bytes made;
        for (std::size_t i = 0; i < times; ++i)
            for (auto one : part) made.push_back(std::byte{one});
        return made;
    };
    // The last counts, and fields of several kinds may take turns, but not without end.
    CHECK(hex(type.decode(message_of({0x08, 7}, 200'000)).value()) == "070000000000");
    auto turns = message_of({0x10, 1, 0x1a, 0, 0x08, 2}, 1000);
    CHECK(type.decode(turns).value().size() == 2 + 4 + 1000 * 4);
    auto endless = type.decode(message_of({0x08, 7, 0x10, 7}, 40'000));
    REQUIRE(!endless);
    CHECK(endless.error().code() == errc::too_large);
    CHECK(endless.error().message().find("max_runs") != std::string::npos);
}
