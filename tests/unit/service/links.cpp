// Links that come and go: exact gaps over every cut, and nothing stale over a slow relay.
#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/raw_peer.hpp>
#include <support/relay_kinds.hpp>
#include <support/sim_parties.hpp>

#include <cstdlib>
#include <iostream>

namespace links_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;

namespace {

double seconds(ise::duration time) { return std::chrono::duration<double>(time).count(); }

struct gaps {
    std::vector<double> packets;
    std::uint64_t before_first = 0; // lost since the provider had committed
    std::uint64_t lost = 0;
    std::uint64_t unknown = 0;
    ise::subscription_counts counts;
};

ise::task<> follow(ise::remote from, std::shared_ptr<gaps> into, ise::subscribe_options options) {
    auto fixes = co_await from.subscribe(position, options);
    for (;;) {
        auto packet = co_await fixes.next();
        if (!packet) break;
        into->packets.push_back(packet->latitude_deg);
        if (into->packets.size() == 1) {
            into->before_first = packet.lost_before().value_or(0);
        } else if (auto lost = packet.lost_before()) {
            into->lost += *lost;
        } else {
            ++into->unknown;
        }
        into->counts = fixes.counts();
    }
}

void publish(party& by, const ise::publication<ise::subscription<fix>>& fixes, double latitude) {
    ise::loop::turn in(by.on);
    fix here{latitude, 0, 0};
    fixes(here);
}

ise::task<> accept_all(ise::listener& at, std::unique_ptr<ise::stream>& into) {
    for (;;) {
        auto came = co_await at.accept();
        if (came.first) co_return;
        into = std::move(came.second);
    }
}

// The number of tries until the way says what is wrong.
ise::task<int> ask_then_connect(ise::remote to, int most) {
    set_mode request{"hold"};
    (co_await to.try_call(helm, request, 60s)).value();
    auto& on = to.way().runtime().on();
    for (int tries = 0; tries < most; ++tries) {
        auto made = co_await to.way().connect(on.now() + 20ms);
        if (made || !to.way().obstacle().empty()) co_return tries;
    }
    co_return most;
}

} // namespace

TEST_CASE("links: whichever byte a link is cut at, a subscription resumes and its gap is exact") {
    auto which = GENERATE(ise::sim::direction::to_server, ise::sim::direction::to_client);
    int resumed = 0;
    for (std::uint64_t at = 0;; at += 7) {
        INFO("cut after byte " << at);
        sim_parties all;
        auto& boat = all.add("boat");
        auto& shore = all.add("shore");
        auto fixes = boat.publish(position);
        boat.listen("tcp://0.0.0.0:7400");
        all.world.net().cut("shore", "boat", which, at);
        auto got = std::make_shared<gaps>();
        auto following =
            start(shore.on, follow(shore.at("tcp://boat:7400"), got, ise::subscribe_options::keep_last(3)));
        for (int i = 1; i <= 40; ++i) {
            publish(boat, fixes, i);
            all.world.run_for(50ms);
        }
        all.world.run_for(5s); // also the last one may be what the cut hits, and comes with nothing behind it
        const int last = 40;
        bool cut = all.world.net().cuts() > 0;
        INFO((following->thrown ? ise::describe(following->thrown) : "it goes on"));
        REQUIRE_FALSE(got->packets.empty());
        CHECK(got->packets.back() == last);
        CHECK(std::is_sorted(got->packets.begin(), got->packets.end()));
        CHECK(got->unknown == 0);
        CHECK(got->counts.restarts == 0);
        CHECK(fixes.subscribers() <= 2); // one may have been committed without its answer: it lingers
        CHECK((got->before_first == 0 || static_cast<double>(got->before_first) == got->packets.front() - 1));
        // From the first packet on every one is there or counted.
        CHECK(got->packets.size() + got->lost == static_cast<std::size_t>(last - got->packets.front() + 1));
        resumed += static_cast<int>(got->counts.resumed);
        CHECK(all.stop());
        if (!cut) break;
    }
    CHECK(resumed > (which == ise::sim::direction::to_client ? 20 : 0)); // little goes to the server: heartbeats
}

namespace {

constexpr std::int64_t slow = 2000; // bytes a second

// How old the packets are that arrive, whose latitude is the time at which they were published.
struct ages {
    ise::duration worst{};
    std::size_t packets = 0;
    bool backwards = false;
};
ise::task<> measure(ise::loop& on, ise::remote from, std::shared_ptr<ages> into) {
    auto fixes = co_await from.subscribe(position, ise::subscribe_options::keep_latest());
    double last = 0;
    for (;;) {
        auto packet = co_await fixes.next();
        if (!packet) break;
        auto now = std::chrono::duration<double>(on.now().time_since_epoch()).count();
        into->worst = std::max(into->worst, std::chrono::duration_cast<ise::duration>(
                                                std::chrono::duration<double>(now - packet->latitude_deg)));
        into->backwards = into->backwards || packet->latitude_deg < last;
        last = packet->latitude_deg;
        ++into->packets;
    }
}
void publish_the_time(sim_parties& all, party& by, const ise::publication<ise::subscription<fix>>& fixes,
                      ise::duration time) {
    for (auto end = all.world.now() + time; all.world.now() < end;) { // 200 a second: four times what the link carries
        publish(by, fixes, std::chrono::duration<double>(all.world.now().time_since_epoch()).count());
        all.world.run_for(5ms);
    }
}

} // namespace

TEST_CASE("links: over a link of 2 kB/s the latest is no older than the configured bytes take to drain") {
    auto unsent = GENERATE(std::size_t{512}, std::size_t{4096}, std::size_t{32768});
    CAPTURE(unsent);
    ise::service_options options;
    options.unsent_bytes = unsent;
    sim_parties all;
    auto& boat = all.add("boat", options);
    auto& shore = all.add("shore");
    auto fixes = boat.publish(position);
    boat.listen("tcp://0.0.0.0:7400");
    auto& link = all.world.net().between("boat", "shore");
    link.bandwidth_bytes_per_second = slow;
    link.latency = 300ms;
    auto seen = std::make_shared<ages>();
    auto measuring = start(shore.on, measure(shore.on, shore.at("tcp://boat:7400"), seen));
    publish_the_time(all, boat, fixes, 120s);
    // And a piece that is being sent.
    auto bound = ise::duration(static_cast<std::int64_t>(unsent + 512) * 1'000'000'000 / slow) + 300ms;
    if (std::getenv("ISE_TEST_FIGURES"))
        std::cout << "2 kB/s, unsent_bytes " << unsent << ": " << seen->packets << " packets, the oldest "
                  << seconds(seen->worst) << " s, bound " << seconds(bound) << " s\n";
    CHECK(seen->packets > 1000);
    CHECK(seen->worst <= bound);
    CHECK_FALSE(seen->backwards);
}

TEST_CASE("links: through a relay of 2 kB/s the latest is no older than all buffers on the way take to drain") {
    constexpr std::size_t buffer = 4096; // each of the relay's
    ise::service_options options;
    options.unsent_bytes = 1024;
    sim_parties all;
    auto& boat = all.add("boat", options);
    auto& shore = all.add("shore");
    auto fixes = boat.publish(position);
    boat.listen("tcp://0.0.0.0:7400");
    auto& near = all.world.net().between("boat", "relay");
    near.receive_buffer_bytes = buffer;
    auto& far = all.world.net().between("relay", "shore");
    far.bandwidth_bytes_per_second = slow;
    far.send_buffer_bytes = buffer;
    far.receive_buffer_bytes = buffer;
    auto& router = all.world.host("relay").start_process("relay");
    auto at = ise::endpoint::parse("tcp://0.0.0.0:7500").value();
    auto between =
        make_byte_relay(router, router.make_loop("relay"), at, ise::endpoint::parse("tcp://boat:7400").value(), 512);
    auto seen = std::make_shared<ages>();
    auto measuring = start(shore.on, measure(shore.on, shore.at("tcp://relay:7500"), seen));
    publish_the_time(all, boat, fixes, 120s);
    // Ours (and one write that was begun), the relay's two buffers and what it holds in its hand.
    auto bytes = options.unsent_bytes + 512 + 2 * buffer + 512;
    auto bound = ise::duration(static_cast<std::int64_t>(bytes) * 1'000'000'000 / slow) + 10ms;
    if (std::getenv("ISE_TEST_FIGURES"))
        std::cout << "relay of 2 kB/s: " << seen->packets << " packets, the oldest " << seconds(seen->worst)
                  << " s, bound " << seconds(bound) << " s\n";
    CHECK(seen->packets > 1000);
    CHECK(seen->worst <= bound);
    CHECK_FALSE(seen->backwards);
    between->stop();
    all.run_until([&] { return between->ended(); });
}

TEST_CASE("links: who connects in the turn in which the session has ended waits, and does not try without end") {
    sim_parties all;
    auto& shore = all.add("shore");
    auto host = all.world.host("sea").start_process("sea").make_loop("raw");
    auto where = ise::endpoint::parse("tcp://0.0.0.0:7400").value();
    auto ear = where.kind->listen(host->loop(), where, ise::security()).value();
    std::unique_ptr<ise::stream> line;
    auto accepting = start(host->loop(), accept_all(*ear, line));
    auto calling = start(shore.on, ask_then_connect(shore.at("tcp://sea:7400"), 1000));
    REQUIRE(all.run_until([&] { return line != nullptr; }));
    raw_peer peer(all, std::move(host), std::move(line));
    using ise::wire::frame_type;
    REQUIRE(all.run_until([&] { return peer.count(frame_type::hello) == 1; }));
    ise::wire::welcome welcome;
    welcome.self.incarnation = 1;
    peer.say(frame_type::welcome, 0, welcome);
    REQUIRE(all.run_until([&] { return peer.count(frame_type::request) == 1; }));
    ise::buffer together; // so that both come in one turn
    auto put = [&](frame_type type, std::uint64_t id, const auto& packet) {
        ise::wire::put_frame(together, type, 0, id, [&](ise::buffer& body) { encode(packet, body); });
    };
    put(frame_type::reply, peer.last(frame_type::request)->header.id, mode_set{true, ""});
    put(frame_type::goodbye, 0, ise::wire::farewell{1, "bye"});
    peer.say(together.view());
    CHECK(all.run_until([&] { return calling->done; }));
    CHECK(calling->get() < 10);
    shore.scope.stop();
    ear->close();
    all.run_until([&] { return accepting->done; });
    line.reset(); // of a further attempt
    ear.reset();  // before the peer, whose loop they are on
}

} // namespace links_test
