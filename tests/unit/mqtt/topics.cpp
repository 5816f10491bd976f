// Names of ISE as topics of MQTT, and back.
#include <components/mqtt_bridge/topics.hpp>

#include <support/catch.hpp>

#include <string>

namespace {

using namespace ise::mqtt;

service_place place(std::string path, std::string service) {
    service_place made;
    made.path = std::move(path);
    made.service = std::move(service);
    return made;
}

} // namespace

TEST_CASE("topics: the levels of a path stay, what MQTT does not allow is escaped, and it comes back") {
    CHECK(topic_of("ise", "out", place("atirma/boat", "position")).value() == "ise/out/atirma/boat/position");
    CHECK(topic_of("fleet/7", "call", place("a+b/#", "x/y%")).value() == "fleet/7/call/a%2Bb/%23/x%2Fy%25");
    std::string odd;
    for (int c = 0; c < 256; ++c) odd += static_cast<char>(c);
    for (const auto& one : {place("atirma/boat", "position"), place(odd, odd), place("a", "$SYS")}) {
        auto topic = topic_of("ise", "out", one);
        REQUIRE(topic);
        CHECK(topic->find_first_of("+#") == std::string::npos);
        auto back = read_topic("ise", "out", *topic);
        REQUIRE(back);
        CHECK(back->path == one.path);
        CHECK(back->service == one.service);
    }
}

TEST_CASE("topics: those that nobody can have made, prefixes that cannot be, and long ones are refused") {
    for (const char* wrong :
         {"", "ise", "ise/out/", "ise/out/a", "ise/out/a/", "ise/out//", "ise/in/a/b", "ise/out/a/%", "ise/out/a/%4",
          "ise/out/a/%2b", "ise/out/a/%zz", "ise/out/a+/b", "ise/out/a/b\x01"}) {
        auto read = read_topic("ise", "out", wrong);
        CAPTURE(wrong);
        REQUIRE_FALSE(read);
        CHECK(read.error().code() == ise::errc::malformed);
    }
    CHECK_FALSE(read_topic("ise", "out", "ise/out/a/" + std::string(max_topic_bytes, 'b')));
    for (const char* wrong : {"", "$SYS", "/a", "a/", "a/+", "#", "a%", "caf\xc3\xa9"})
        CHECK_FALSE(check_prefix(wrong));
    CHECK_FALSE(check_prefix(std::string(max_prefix_bytes + 1, 'a')));
    CHECK(check_prefix("fleet/boat-7"));
    auto longest = topic_of("ise", "out", place(std::string(200, '+'), std::string(1000, '+')));
    REQUIRE_FALSE(longest);
    CHECK(longest.error().code() == ise::errc::too_large);
}
