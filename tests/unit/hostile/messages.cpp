// Frames and messages that are too long, too many or never end.
#include "harbour.hpp"

#include <support/raw_datagrams.hpp>

#include <list>

namespace messages_test {

using namespace hostile_test;

namespace {

// Only the head of a frame: the body never comes.
void announce(raw_peer& by, frame_type type, std::uint32_t length) {
    ise::buffer head;
    ise::wire::put_frame(head, type, 0, 0, [](ise::buffer&) {});
    ise::detail::store_little(head.data(), length);
    by.say(head.view());
}

// The first piece of a message, of so many bytes.
void begin_message(raw_peer& by, std::uint64_t id, std::uint64_t length, std::size_t bytes) {
    ise::buffer piece;
    piece.append(static_cast<std::uint8_t>(frame_type::request));
    piece.append(std::uint8_t{0});
    piece.append(id);
    piece.append(length);
    piece.append(ise::bytes_view(ise::bytes(bytes)));
    by.say(frame_type::piece, id, piece.view());
}

} // namespace

TEST_CASE("hostile: a greeting may not be longer than greeting_bytes") {
    harbour at(either());
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
    announce(peer, frame_type::hello, (16u << 10) + 1);
    CHECK(at.all.run_until([&] { return peer.closed(); }));
    INFO(at.all_warnings());
    CHECK(at.warned("16385 bytes came, 16384 are allowed (greeting_bytes)"));
    at.others_do_not_notice();
}

TEST_CASE("hostile: frames and messages beyond what was agreed on end the session by the limit's name") {
    ise::service_options options;
    options.accepts.max_message_bytes = 100'000;
    options.accepts.max_frame_bytes = 300'000;
    harbour at(either(), options);
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    std::string expected;
    SECTION("a frame") {
        announce(peer, frame_type::request, 300'001);
        expected = "300001 bytes came, 300000 are allowed (max_frame_bytes)";
    }
    SECTION("a frame of four gigabytes") {
        announce(peer, frame_type::ping, 0xffff'ffff);
        expected = "(max_frame_bytes)";
    }
    SECTION("a message") {
        begin_message(peer, 1, 100'001, 10);
        expected = "100001 bytes was announced, 100000 are allowed (max_message_bytes)";
    }
    SECTION("a message of all that 64 bits count") {
        begin_message(peer, 1, ~std::uint64_t{0}, 10);
        expected = "(max_message_bytes)";
    }
    SECTION("messages under way") {
        for (std::uint64_t id = 1; id <= 65; ++id) begin_message(peer, id, 1000, 10);
        expected = "more than 64 messages came in pieces at once (unfinished_messages)";
    }
    SECTION("their bytes") {
        for (std::uint64_t id = 1; id <= 3; ++id) begin_message(peer, id, 100'000, 80'000);
        expected = "more than 200000 bytes (unfinished_messages)";
    }
    peer.finish();
    CHECK(at.all.run_until([&] { return peer.closed(); }));
    INFO(at.all_warnings());
    CHECK(at.warned(expected));
    CHECK_THAT(peer.why(frame_type::goodbye).message(), Contains(expected)); // it is told, too
    at.others_do_not_notice();
}

TEST_CASE("hostile: a host gains no memory by many sessions with unfinished messages, and others do not notice") {
    ise::service_options options;
    options.session_bytes = 100'000;
    options.accepts.max_message_bytes = 500'000;
    harbour at("tcp", options);
    REQUIRE(options.unfinished_bytes() == 1'000'000);
    std::list<raw_peer> peers;
    std::uint64_t most = 0;
    for (int i = 0; i < 20; ++i) {
        auto& peer = peers.emplace_back(at.all, at.sea, at.channel, false);
        peer.greet("raw" + std::to_string(i));
        for (std::uint64_t id = 1; id <= 2; ++id) begin_message(peer, id, 500'000, 90'000);
        peer.finish();
        std::uint64_t held = 0;
        for (const auto& [session, one] : at.boat.services->sessions()) held += session->wire().unfinished_bytes();
        most = std::max(most, held);
    }
    at.all.world.run_for(1s);
    CHECK(most > 900'000);
    CHECK(most < 1'200'000);
    CHECK(at.boat.services->sessions().size() == 5);
    INFO(at.all_warnings());
    CHECK(at.warned("unfinished messages from its host hold 1080000 bytes (unfinished_bytes)"));
    at.others_do_not_notice();
}

TEST_CASE(
    "hostile: whatever has come in part counts for its host, in each form and under each name (unfinished_bytes)") {
    ise::service_options options;
    options.session_bytes = 100'000;
    options.accepts.max_message_bytes = 500'000;
    REQUIRE(options.unfinished_bytes() == 1'000'000);
    enum class form { frame, renamed, packet };
    const auto as = GENERATE(form::frame, form::renamed, form::packet);
    INFO(static_cast<int>(as));
    harbour at(as == form::packet ? "udp" : "tcp", options);
    std::list<raw_peer> peers;
    std::list<raw_channel> channels;
    for (std::uint32_t i = 0; i < 8; ++i) {
        const auto name = std::to_string(i);
        if (as == form::packet) {
            auto& peer = channels.emplace_back(at.all, at.sea, at.channel, 77 + i);
            peer.greet("raw" + name);
            const ise::bytes full(1024);
            for (std::uint32_t index = 0; index < 180; ++index) {
                peer.fragment(0, 1 << 20, index, full);
                if (index % 20 == 0) at.all.world.run_for(2ms);
            }
        } else {
            auto& peer = peers.emplace_back(at.all, at.sea, at.channel, false);
            peer.greet(as == form::renamed ? "x://host" + name : "raw" + name);
            if (as == form::renamed) {
                for (std::uint64_t id = 1; id <= 2; ++id) begin_message(peer, id, 500'000, 90'000);
            } else {
                ise::buffer whole;
                ise::wire::put_frame(whole, frame_type::request, 0, 1,
                                     [](ise::buffer& to) { to.append(ise::bytes_view(ise::bytes(200'000))); });
                peer.say(whole.view().first(180'000));
            }
            peer.finish();
        }
        at.all.world.run_for(20ms);
    }
    INFO(at.all_warnings());
    CHECK(at.boat.services->sessions().size() == 5);
    CHECK(at.warned("unfinished messages from its host hold"));
    CHECK(at.warned("(unfinished_bytes)"));
    at.others_do_not_notice();
}

TEST_CASE("hostile: over udp a message is no longer than a mebibyte, whatever else the provider accepts") {
    harbour at("udp");
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    begin_message(peer, 1, (1u << 20) + 1, 10);
    CHECK(at.all.run_until([&] { return peer.closed(); }));
    CHECK(at.warned("1048577 bytes was announced, 1048576 are allowed (max_message_bytes)"));
    at.others_do_not_notice();
}

TEST_CASE("hostile: messages that are announced and do not come hold up nobody, their sender neither") {
    harbour at(either());
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    for (std::uint64_t id = 1; id <= 64; ++id) begin_message(peer, id, at.datagrams ? 1u << 20 : 256u << 20, 1);
    for (int s = 0; s < 20; ++s) {
        peer.say(frame_type::ping, 1, ise::bytes_view());
        at.all.world.run_for(1s);
    }
    CHECK(peer.count(frame_type::pong) == 20);
    CHECK(at.of_raw());
    at.others_do_not_notice();
}

} // namespace messages_test
