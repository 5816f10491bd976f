// The messages of the Foxglove protocol, and what waits for a viewer.
#include <components/foxglove_gateway/origins.hpp>
#include <components/foxglove_gateway/protocol.hpp>
#include <components/foxglove_gateway/viewer.hpp>
#include <ise/http/web_socket_frames.hpp>

#include <support/catch.hpp>

#include <nlohmann/json.hpp>

#include <string>
#include <vector>

namespace foxglove_test {
namespace {

using namespace ise::foxglove;
using nlohmann::json;

template <class Message>
Message read(const std::string& text) {
    return std::get<Message>(read_text(text).value());
}
std::string why(const std::string& text) {
    auto got = read_text(text);
    REQUIRE_FALSE(got);
    return got.error().message();
}

// The payloads of frames; the first four bytes after the opcode of a binary one are the subscription.
std::vector<ise::web_socket_message> frames(const std::string& bytes) {
    ise::web_socket_reader reader(ise::web_socket_reader::from::servers);
    std::vector<ise::web_socket_message> made;
    for (auto rest = ise::as_bytes(bytes); !rest.empty();) {
        rest = rest.subspan(reader.feed(rest).value());
        if (reader.complete()) made.push_back(reader.take());
    }
    return made;
}
std::shared_ptr<const channel_message> message(std::string payload) {
    auto made = std::make_shared<channel_message>();
    made->payload = std::move(payload);
    return made;
}
std::string text_in(const ise::web_socket_message& data) { return data.payload.substr(13); }

} // namespace

TEST_CASE("what viewers ask for is read") {
    auto subscribe = read<subscribe_message>(
        R"({"op":"subscribe","subscriptions":[{"id":0,"channelId":3},{"id":4294967295,"channelId":5}]})");
    REQUIRE(subscribe.subscriptions.size() == 2);
    CHECK(subscribe.subscriptions[1].id == 4294967295);
    CHECK(subscribe.subscriptions[1].channel == 5);
    CHECK(read<unsubscribe_message>(R"({"op":"unsubscribe","subscriptionIds":[1,2]})").ids.size() == 2);
    auto set = read<set_parameters_message>(
        R"({"op":"setParameters","id":"x","parameters":[{"name":"a/b","value":3},{"name":"a/c","value":4.5,"type":"float64"},)"
        R"({"name":"a/d","value":true},{"name":"a/e","value":"text"},{"name":"a/f","value":7.0}]})");
    REQUIRE(set.parameters.size() == 5);
    CHECK(set.id == "x");
    for (std::size_t i = 0; auto wanted : {"3", "4.5", "true", "text", "7"}) CHECK(set.parameters[i++].value == wanted);
    CHECK_FALSE(read<graph_updates_message>(R"({"op":"unsubscribeConnectionGraph"})").begin);
    auto call = std::get<call_message>(read_binary(std::string("\2\1\0\0\0\2\0\0\0\4\0\0\0jsonxyz", 20)).value());
    CHECK(call.service == 1);
    CHECK(call.call == 2);
    CHECK(call.encoding == "json");
    CHECK(call.payload == "xyz");
}

TEST_CASE("what is no message of a viewer is refused with what is wrong") {
    CHECK(why("") == "a text message is not JSON");
    CHECK(why("[]") == "a text message is not an object with an \"op\"");
    CHECK(why(R"({"op":"dance"})") == "there is no operation \"dance\"");
    CHECK(why(R"({"op":"subscribe"})") == "subscribe: subscriptions is missing");
    CHECK(why(R"({"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]})") ==
          "subscribe: id is not an integer from 0 to 4294967295");
    CHECK(why(R"({"op":"subscribe","subscriptions":[7]})") == "subscribe: subscriptions is not a list of objects");
    CHECK(why(R"({"op":"setParameters","parameters":[{"name":"a/b"}]})").find("cannot be unset") != std::string::npos);
    CHECK(why(R"({"op":"setParameters","parameters":[{"name":"a/b","value":[1]}]})").find("not a string") !=
          std::string::npos);
    CHECK(why(std::string(100, '[')).find("levels") != std::string::npos);
    CHECK(why(std::string(300 * 1024, ' ')).find("max_text_bytes") != std::string::npos);
    std::string many = R"({"op":"unsubscribe","subscriptionIds":[0)";
    for (int i = 0; i < 5000; ++i) many += ",1";
    CHECK(why(many + "]}").find("max_items") != std::string::npos);
    CHECK(why(R"({"op":"fetchAsset","requestId":1,"uri":")" + std::string(2000, 'x') + "\"}").find("max_name_bytes") !=
          std::string::npos);
    for (const auto& bad : {std::string(), std::string("\1\0\0", 3),
                            std::string("\2\0\0\0\0\0\0\0\0\xff\xff\xff\xff", 13), std::string("\x63")})
        CHECK_FALSE(read_binary(bad));
}

TEST_CASE("any byte of a message may be cut or changed") {
    const std::string text =
        R"({"op":"advertise","channels":[{"id":1,"topic":"goal","encoding":"json","schemaName":"x"}]})";
    for (std::size_t at = 0; at < text.size(); ++at) {
        CHECK_FALSE(read_text(text.substr(0, at)));
        for (int bit = 0; bit < 8; ++bit) {
            auto flipped = text;
            flipped[at] = static_cast<char>(flipped[at] ^ (1 << bit));
            auto got = read_text(flipped);
            if (!got) CHECK_FALSE(got.error().message().empty());
        }
    }
    const std::string call("\2\1\0\0\0\2\0\0\0\4\0\0\0jsonxyz", 20);
    for (std::size_t at = 0; at < call.size(); ++at) {
        auto got = read_binary(call.substr(0, at));
        CHECK(got.has_value() == (at >= 17));
    }
}

TEST_CASE("an asset's path never leads out of its folder") {
    CHECK(asset_path("package://boat/hull.glb").value() == "boat/hull.glb");
    CHECK(asset_path("package://a%20b.png").value() == "a b.png");
    for (const char* bad : {"", "hull.glb", "://x", "package://", "package:///etc/passwd", "file:///etc/passwd",
                            "package://..", "package://a/../../b", "package://a/./b", "package://a//b", "package://a/",
                            "package://%2e%2e/b", "package://a%2f..%2fb", "package://a\\b", "package://a%00",
                            "package://a%", "package://a%4", "package://a%zz", "package://%2fetc"})
        CHECK_FALSE(asset_path(bad));
}

TEST_CASE("origins: Foxglove's, this host's, and those that are named") {
    for (const char* good :
         {"", "https://app.foxglove.dev", "http://localhost:8080", "http://127.0.0.1", "http://[::1]:5"})
        CHECK(is_allowed_origin(good, {}));
    for (const char* bad :
         {"https://evil.example", "null", "http://localhost.evil.example", "http://127.0.0.1.evil.example",
          "http://evil.example:80/localhost", "foo://localhost", "https://app.foxglove.dev.evil.example"})
        CHECK_FALSE(is_allowed_origin(bad, {}));
    CHECK(is_allowed_origin("https://viewer.example", {"https://viewer.example"}));
    CHECK(is_allowed_origin("https://evil.example", {"*"}));
}

TEST_CASE("changes of the graph name what came and what went") {
    connection_graph before, now;
    before.published["a/x"] = {"a"};
    before.services["a/s"] = {"a"};
    now.published["a/y"] = {"a"};
    now.subscribed["a/y"] = {"b"};
    auto parsed = json::parse(write_graph_change(before, now));
    CHECK(parsed["removedTopics"] == json::array({"a/x"}));
    CHECK(parsed["removedServices"] == json::array({"a/s"}));
    CHECK(parsed["subscribedTopics"][0]["subscriberIds"] == json::array({"b"}));
    CHECK(write_graph_change(now, now).empty());
}

TEST_CASE("a viewer that takes nothing keeps the newest message of each channel") {
    int woken = 0;
    viewer who(viewer_limits(), [&] { ++woken; });
    auto& a = *who.subscribe(1, 10).value();
    auto& b = *who.subscribe(2, 20).value();
    CHECK_FALSE(who.subscribe(1, 30)); // the id is in use
    CHECK_FALSE(who.subscribe(3, 10)); // the channel is subscribed to
    for (int i = 0; i < 100; ++i) who.offer(a, message("a" + std::to_string(i)));
    who.offer(b, message("b"));
    CHECK(who.skipped() == 99);
    CHECK(woken == 101);
    std::string out;
    who.fill(out);
    auto got = frames(out);
    REQUIRE(got.size() == 2);
    CHECK(text_in(got[0]) == "a99");
    CHECK(got[0].payload[1] == 1); // the subscription
    CHECK(text_in(got[1]) == "b");
    out.clear();
    who.fill(out);
    CHECK(out.empty());
    CHECK(who.sent() == 2);
    who.offer(a, message("gone"));
    who.unsubscribe(1);
    who.fill(out);
    CHECK(out.empty());
    CHECK(who.subscribe(1, 10)); // both are free again
}

TEST_CASE("of a channel of events a viewer keeps each message, up to a limit") {
    viewer_limits limits;
    limits.max_events = 20;
    viewer who(limits, [] {});
    auto& events = *who.subscribe(1, 10, channel_kind::events).value();
    auto& state = *who.subscribe(2, 20, channel_kind::state).value();
    auto seen = [&](int messages) {
        for (int i = 0; i < messages; ++i) {
            who.offer(events, message(std::to_string(i)));
            who.offer(state, message("s" + std::to_string(i)));
        }
        std::string out, of_events, of_state;
        who.fill(out);
        for (const auto& one : frames(out)) (one.payload[1] == 1 ? of_events : of_state) += text_in(one) + " ";
        CHECK(of_state == "s" + std::to_string(messages - 1) + " ");
        return of_events;
    };
    CHECK(seen(5) == "0 1 2 3 4 ");
    CHECK(who.skipped() == 4); // of state
    CHECK(seen(23) == "3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 ");
    CHECK(who.skipped() == 4 + 22 + 3);
}

TEST_CASE("the memory of a viewer that takes nothing is bounded") {
    viewer_limits limits;
    limits.depth = 100;
    limits.max_waiting_bytes = 100'000;
    limits.max_control_bytes = 10'000;
    viewer who(limits, [] {});
    auto& a = *who.subscribe(1, 10).value();
    auto& b = *who.subscribe(2, 20).value();
    for (int i = 0; i < 50; ++i) {
        who.offer(a, message(std::string(10'000, static_cast<char>('0' + i % 10))));
        who.offer(b, message(std::string(10'000, static_cast<char>('0' + i % 10))));
    }
    std::string out;
    for (std::size_t before = 1; before != out.size();) {
        before = out.size();
        who.fill(out);
    }
    CHECK(out.size() < 110'000);
    auto got = frames(out);
    CHECK(text_in(got.back())[0] == '9'); // the newest are kept
    CHECK(who.sent() + who.skipped() == 100);
    // One that is too large by itself is sent all the same.
    who.offer(a, message(std::string(200'000, 'x')));
    out.clear();
    who.fill(out);
    CHECK(frames(out).size() == 1);
    CHECK_FALSE(who.overrun());
    who.greet(std::make_shared<const std::string>(100'000, 'x'));
    CHECK_FALSE(who.overrun());
    auto shared = std::make_shared<const std::string>(200, 'x');
    for (int i = 0; i < 50; ++i) {
        who.text(std::string(100, 'x'));
        who.text(shared);
    }
    CHECK(who.overrun());
}

TEST_CASE("channels are served in turn, and what is no message goes first") {
    viewer_limits limits;
    limits.depth = 10;
    viewer who(limits, [] {});
    auto& a = *who.subscribe(1, 10).value();
    auto& b = *who.subscribe(2, 20).value();
    for (int i = 0; i < 3; ++i) who.offer(a, message("a"));
    who.offer(b, message("b"));
    who.clock("\2time");
    who.text("text");
    std::string out;
    who.fill(out);
    auto got = frames(out);
    REQUIRE(got.size() == 6);
    CHECK(got[0].payload == "text");
    CHECK(got[1].payload == "\2time");
    CHECK(text_in(got[2]) == "a");
    CHECK(text_in(got[3]) == "b");
}

} // namespace foxglove_test
