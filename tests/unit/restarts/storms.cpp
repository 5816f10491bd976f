// The clients of one restarted provider come back without a storm, over near and far, good and bad networks.
#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/sim_parties.hpp>

#include <fmt/format.h>

#include <cstdlib>
#include <iostream>

namespace storms_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;

namespace {

double seconds(ise::duration time) { return std::chrono::duration<double>(time).count(); }

struct situation {
    std::string scheme;
    std::size_t clients;
    ise::duration away, latency;
    double loss;
    std::size_t max_handshakes = ise::service_options().max_handshakes;
};

// How often the clients ask for a connection, in windows of 100 ms that slide by 10: over tcp each try is a connect,
// over udp each datagram that opens counts, though one try sends several.
struct attempts {
    attempts(ise::sim::world& of, const std::string& scheme)
        : world(of), datagrams(scheme == "udp"), from(of.trace().count()) {}

    void run_for(ise::duration time) {
        for (auto end = world.now() + time; world.now() < end;) {
            std::size_t now = 0;
            for (int i = 0; i < 10; ++i) {
                world.run_for(1ms);
                now += count();
            }
            total += now;
            window.push_back(now);
            in_window += now;
            if (window.size() > 10) {
                in_window -= window.front();
                window.erase(window.begin());
            }
            peak = std::max(peak, in_window);
        }
    }
    std::size_t count() {
        auto news = world.trace().count() - from;
        from = world.trace().count();
        REQUIRE(news < ise::sim::trace::kept_entries); // else some were not seen
        const auto& newest = world.trace().newest();
        return static_cast<std::size_t>(
            std::count_if(newest.end() - static_cast<std::ptrdiff_t>(news), newest.end(), [&](const auto& entry) {
                return datagrams ? entry.amount == 1200 && entry.subject.ends_with("->boat:7400")
                                 : entry.kind == "connect";
            }));
    }

    ise::sim::world& world;
    bool datagrams;
    std::uint64_t from;
    std::vector<std::size_t> window;
    std::size_t in_window = 0, peak = 0, total = 0;
};

struct outcome {
    std::size_t peak, total;
    ise::duration healed;
    std::uint64_t rejected;
};
struct last_heard {
    double latitude = 0;
    int unknown_gaps = 0;
};
ise::task<> follow(ise::remote from, last_heard& into) {
    auto options = ise::subscribe_options::keep_latest();
    options.deadline = 1min;
    auto fixes = co_await from.subscribe(position, options);
    for (;;) {
        auto packet = co_await fixes.next();
        if (!packet) break;
        into.latitude = packet->latitude_deg;
        into.unknown_gaps += !packet.lost_before();
    }
}

// What the times of `service_options` come to.
struct bounds {
    std::size_t peak, total;
    ise::duration healed;

    explicit bounds(const situation& of) {
        const ise::service_options times;
        const bool udp = of.scheme == "udp";
        // The first tries are spread evenly over half a second: a fifth of them within 100 ms, and later ones are no
        // denser. Over udp each asks again after 200 and 400 ms, and once more when it has a cookie to show: three such
        // at once.
        REQUIRE(times.max_back_off == 5s);
        peak = (of.clients * 3 / 10 + 10) * (udp ? 3 : 1);
        // The pauses after it: 0.5 to 1 s, 1 to 2 s, 2 to 4 s, then half of the longest at least. A try over udp that
        // nobody answers lasts `connect_time` and asks five times; one that is answered asks twice, far away six times.
        auto away = static_cast<std::size_t>(of.away / 1ms);
        total = udp ? of.clients * (12 + 5 * ((away + 4999) / 5000)) : of.clients * (4 + away / 2500);
        // The longest pause, and a round trip each to connect, to greet and to subscribe.
        healed = times.max_back_off + 6 * of.latency + 500ms;
        if (udp) healed += 2s + 2 * of.latency; // between two questions of one try, and the one for the address
        if (of.loss > 0) healed += 3s;          // what is lost twice or three times
    }
};

outcome storm(const situation& now) {
    auto what =
        fmt::format("{}, {} clients, {} handshakes at once, away {} s, latency {} ms, loss {} %", now.scheme,
                    now.clients, now.max_handshakes, seconds(now.away), seconds(now.latency) * 1000, now.loss * 100);
    INFO(what);
    sim_parties all;
    auto where = fmt::format("{}://{}:7400", now.scheme, all.world.host("boat").address());
    ise::service_options options;
    options.max_handshakes = now.max_handshakes;
    auto& first = all.add("boat", options);
    auto fixes = first.publish(position);
    first.listen(where);
    std::vector<last_heard> heard(now.clients);
    std::vector<std::shared_ptr<started<void>>> running;
    for (std::size_t i = 0; i < now.clients; ++i) {
        auto name = fmt::format("client{}", i);
        auto& client = all.add(name);
        running.push_back(start(client.on, follow(client.at(where), heard[i])));
        if (i % 50 == 49) all.world.run_for(100ms);
    }
    REQUIRE(all.run_until([&] { return fixes.subscribers() == now.clients; }));
    for (std::size_t i = 0; i < now.clients; ++i) {
        auto& between = all.world.net().between("boat", fmt::format("client{}", i));
        between.latency = now.latency;
        between.loss = now.loss;
    }
    all.world.run_for(10s);

    attempts seen(all.world, now.scheme);
    first.services->stop(1s);
    first.scope.stop();
    seen.run_for(100ms);
    while (!all.world.host("boat").datagrams.empty()) seen.run_for(10ms); // says goodbye yet
    seen.run_for(now.away);
    auto& second = all.add("boat", options);
    auto again = second.publish(position);
    second.listen(where);
    auto back_at = all.world.now();
    while (again.subscribers() < now.clients && all.world.now() < back_at + 5min) seen.run_for(100ms);
    auto healed = all.world.now() - back_at;
    if (std::getenv("ISE_TEST_FIGURES"))
        std::cout << fmt::format("{}: peak {} attempts in 100 ms, {} in all, all back {:.1f} s after the provider\n",
                                 what, seen.peak, seen.total, seconds(healed));

    CHECK(again.subscribers() == now.clients);
    {
        ise::loop::turn in(second.on);
        fix here{7, 0, 0};
        again(here);
    }
    all.world.run_for(5s);
    for (const auto& one : heard) CHECK((one.latitude == 7 && one.unknown_gaps == 1));
    CHECK(all.stop());
    return {seen.peak, seen.total, healed, second.services->counts().sessions_rejected};
}

void check_bounded(const situation& now) {
    auto was = storm(now);
    bounds most(now);
    INFO(now.scheme << ", " << now.clients << " clients, away " << seconds(now.away) << " s, latency "
                    << seconds(now.latency) << " s, loss " << now.loss);
    CHECK(was.peak <= most.peak);
    CHECK(was.total <= most.total);
    CHECK(was.healed <= most.healed);
    if (now.loss == 0) CHECK(was.rejected == 0);
}

} // namespace

TEST_CASE("links: a hundred clients of one restarted provider come back without a storm, near and far") {
    auto scheme = GENERATE(as<std::string>(), "tcp", "udp");
    auto away = GENERATE(as<ise::duration>(), 0ms, 3s, 20s);
    auto latency = GENERATE(as<ise::duration>(), 500us, 30ms, 300ms);
    auto loss = GENERATE(0.0, 0.05);
    check_bounded({scheme, 100, away, latency, loss});
}

TEST_CASE("links: a thousand clients of one restarted provider come back without a storm over tcp") {
    auto away = GENERATE(as<ise::duration>(), 0ms, 3s, 20s);
    check_bounded({"tcp", 1000, away, 500us, 0});
    check_bounded({"tcp", 1000, away, 30ms, 0.05});
    check_bounded({"tcp", 1000, away, 300ms, 0.05, 1024}); // all greet at once there
}

TEST_CASE("links: a thousand clients of one restarted provider come back without a storm over udp") {
    check_bounded({"udp", 1000, 3s, 500us, 0});
    check_bounded({"udp", 1000, 3s, 30ms, 0.05});
    check_bounded({"udp", 1000, 3s, 300ms, 0.05, 1024});
}

TEST_CASE("links: clients that are many more than may greet at once come back over a slow way all the same") {
    auto scheme = GENERATE(as<std::string>(), "tcp", "udp");
    auto was = storm({scheme, 250, 3s, 300ms, 0, 64}); // as a thousand with the usual 256
    CHECK(was.rejected > 50);                          // they were in each other's way
    CHECK(was.healed < 40s);
}

} // namespace storms_test
