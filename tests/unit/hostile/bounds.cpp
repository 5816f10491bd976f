// Calls in good order, by numbers that are not: of theirs that run, of those that wait, of ours that they hold up.
#include "fleet.hpp"

#include <ise/asio.hpp>
#include <ise/net/connect.hpp>
#include <ise/service/peer_channel.hpp>

#include <fmt/format.h>

#include <random>

namespace bounds_test {

using namespace hostile_test;

TEST_CASE("hostile: of the calls of one session max_calls_per_session are served at once") {
    ise::serve_options many;
    many.concurrent = many.waiting = 10'000;
    harbour at(either(), {}, many);
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    peer.introduce(0, "helm", helm.types().fingerprints);
    set_mode forever{"long"};
    for (std::uint64_t call = 0; call < 5000; ++call) peer.request(call, 0, 24h, forever);
    peer.finish();
    REQUIRE(at.all.world.run_until([&] { return peer.count(frame_type::error) == 5000 - 4096; }, 2s));
    CHECK(at.at_once == 4096);
    CHECK_THAT(peer.why(frame_type::error).message(),
               Contains("more than 4096 calls of one session at once (max_calls_per_session)"));
    at.others_do_not_notice();
}

TEST_CASE("hostile: of the requests that wait for schemas 256 of a service are held (held_requests)") {
    harbour at(either());
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    peer.introduce(0, "helm", {77, 78});
    set_mode any{"any"};
    for (std::uint64_t call = 0; call < 300; ++call) peer.request(call, 0, 1h, any);
    peer.finish();
    at.all.world.run_for(1s);
    REQUIRE(peer.count(frame_type::error) == 300 - 256);
    CHECK_THAT(peer.why(frame_type::error).message(), Contains("256 requests wait") && Contains("held_requests"));
    at.others_do_not_notice();
}

TEST_CASE("hostile: replies that wait for a schema that never comes are bounded, and the calls of those beyond fail "
          "(held_replies, session_bytes)") {
    constexpr ise::request_response<set_mode, mode_set> confirm("confirm");
    std::size_t failed = 0;
    std::string why;
    harbour at(either());
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    std::shared_ptr<ise::session> over;
    for (const auto& [raw, held] : at.boat.services->sessions())
        if (held->peer().path == "raw") over = held;
    REQUIRE(over);
    const std::size_t size = GENERATE(10u, 100'000u), calls = size == 10 ? 1100 : 175;
    const std::size_t held = size == 10 ? 1024 : (16u << 20) / 100'009; // held_replies, a quarter of session_bytes
    auto ask = [&](ise::remote back) -> ise::task<> {
        for (std::size_t i = 0; i < calls; ++i)
            back.try_call(confirm, set_mode{"any"}, 1h, [&](ise::result<mode_set> got) {
                if (got) return;
                ++failed;
                why = fmt::format("{} {}", ise::name_of(got.error().executed()), got.error().message());
            });
        co_return;
    };
    at.all.run(at.boat, ask(ise::remote(at.boat.services->link_back(over))));
    over.reset();
    REQUIRE(at.all.run_until([&] { return peer.count(frame_type::request) == calls; }));
    ise::wire::provider_packets outcome;
    outcome.fingerprints = {confirm.types().fingerprints[0], 4711};
    peer.say(frame_type::answers, 0, outcome);
    mode_set answer{true, std::string(size, 'x')};
    auto body = ise::encode(answer);
    std::vector<std::uint64_t> ids;
    for (const auto& frame : peer.got)
        if (frame.header.type == frame_type::request) ids.push_back(frame.header.id);
    for (auto id : ids) {
        peer.say(frame_type::reply, id, ise::bytes_view(body));
        peer.finish();
    }
    at.all.world.run_for(1s);
    CHECK(failed == calls - held);
    CHECK_THAT(why, Contains("unknown 'confirm' at raw") &&
                        Contains(fmt::format("as {} replies wait for a schema (held_replies, session_bytes)", held)));
    CHECK_FALSE(peer.closed());
    at.others_do_not_notice();
}

TEST_CASE("hostile: calls to a peer that lets in and says nothing are bounded by waiting_calls, and others are called "
          "meanwhile") {
    std::size_t failed = 0;
    std::string why;
    harbour at(either());
    INFO(at.channel);
    auto host = at.sea.make_loop("deaf");
    auto deaf_at = ise::endpoint::parse((at.datagrams ? "udp" : "tcp") + std::string("://0.0.0.0:9000")).value();
    auto deaf = deaf_at.kind->listen(host->loop(), deaf_at, ise::security()).value();
    auto ask = [&](ise::remote to) -> ise::task<> {
        for (int i = 0; i < 100'100; ++i)
            to.try_call(helm, set_mode{}, 1h, [&](ise::result<mode_set> got) {
                if (got) return;
                ++failed;
                why = got.error().message();
            });
        co_return;
    };
    at.all.run(at.boat, ask(at.boat.at((at.datagrams ? "udp" : "tcp") + std::string("://sea:9000"))));
    at.all.world.run_for(10s);
    CHECK(failed == 100);
    CHECK_THAT(why, Contains("100000 calls wait for a session") && Contains("(waiting_calls)"));
    at.shore.provide(echo, [](blob given) { return given; });
    at.shore.listen("tcp://0.0.0.0:7500");
    auto call = [](ise::remote there) -> ise::task<ise::result<blob>> {
        blob little;
        auto got = co_await there.try_call(echo, little, 1s);
        co_return got;
    };
    CHECK(at.all.run(at.boat, call(at.boat.at("tcp://shore:7500"))));
    at.others_do_not_notice();
    at.all.stop();
    CHECK(failed == 100'100);
}

TEST_CASE("hostile: a depth beyond subscription_depth counts as that") {
    fleet at("tcp");
    raw_peer peer(at.all, at.sea, at.channel, false);
    peer.greet();
    auto terms = fleet::terms();
    terms.policy = ise::overflow::keep_last;
    terms.depth = ~0u;
    peer.say(frame_type::subscribe, 1, terms);
    REQUIRE(at.all.run_until([&] { return at.fixes.subscribers() == 1; }));
    at.publish((1 << 20) + 5000); // hardly any leaves meanwhile
    CHECK(at.boat.services->counts().packets_dropped <= 5000);
    CHECK(at.boat.services->counts().packets_dropped > 4900);
    at.others_do_not_notice();
}

TEST_CASE(
    "hostile: numbers of calls over udp that leap about cost bounded memory, and no other's answer is forgotten") {
    harbour at("udp");
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    peer.introduce(0, "echo", echo.types().fingerprints);
    blob big;
    big.content.resize(10'000);
    std::mt19937_64 random(11);
    std::size_t most = 0;
    const auto calls = 3000u;
    for (std::uint32_t call = 0; call < calls; ++call) {
        auto number = call % 2 ? random() : ~std::uint64_t{0} - 2 * call; // ranges without end, gaps without end
        peer.numbered_request(call % 4096, 0, number, big, call % 5 == 0 ? ise::wire::flag::again : std::uint8_t{0});
        peer.finish();
        most = std::max(most, at.boat.services->reply_windows().room());
    }
    CHECK(at.all.world.run_until([&] { return peer.count(frame_type::reply) + peer.count(frame_type::error) == calls; },
                                 20s));
    CHECK(peer.count(frame_type::reply) > 1000);
    CHECK(most > (3u << 20));
    CHECK(most < (5u << 20)); // max_reply_bytes
    CHECK(at.of_raw());
    at.others_do_not_notice();
}

TEST_CASE("hostile: a numbered call of a peer without an incarnation, or over tcp, breaks a rule") {
    harbour at(either());
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
    ise::wire::hello nobody;
    nobody.self.path = "raw";
    nobody.self.incarnation = at.datagrams ? 0 : 1;
    peer.say(frame_type::hello, 0, nobody);
    at.all.world.run_for(200ms);
    REQUIRE(at.of_raw());
    peer.introduce(0, "echo", echo.types().fingerprints);
    ise::buffer body;
    body.append(std::uint32_t{0});
    body.append(std::int64_t{1'000'000'000});
    body.append(std::uint64_t{1});
    body.append(std::uint32_t{0});
    peer.say(frame_type::request, 0, body.view(), ise::wire::flag::numbered);
    CHECK(at.all.run_until([&] { return peer.closed(); }));
    CHECK(at.warned("a number that makes no sense"));
    at.others_do_not_notice();
}

} // namespace bounds_test
