// Packets over datagrams in the virtual world: counted, never backwards, and the latest gets there.
#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/sim_parties.hpp>

#include <fmt/format.h>

#include <random>

namespace udp_subscriptions_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;

namespace {

struct reading {
    std::vector<double> packets;
    std::vector<std::size_t> sizes;
    std::uint64_t lost = 0;
    ise::subscription_counts counts;
};
ise::task<> read(ise::remote boat, ise::subscribe_options options, double last, std::shared_ptr<reading> into) {
    auto stream = co_await boat.subscribe(position, options);
    while (into->packets.empty() || into->packets.back() < last) {
        auto packet = co_await stream.next();
        if (!packet) break;
        into->packets.push_back(packet->latitude_deg);
        into->lost += packet.lost_before().value();
        into->counts = stream.counts();
    }
}
ise::task<> look(ise::remote boat, std::size_t last, std::shared_ptr<reading> into) {
    auto stream = co_await boat.subscribe(pictures, ise::subscribe_options::keep_latest());
    while (into->sizes.empty() || into->sizes.back() < last) {
        auto packet = co_await stream.next();
        if (!packet) break;
        into->sizes.push_back(packet->content.size());
    }
}

void rough(sim_parties& sea, std::mt19937_64& random) {
    auto& between = sea.world.net().between("boat", "shore");
    between.latency = std::chrono::milliseconds(1 + random() % 80);
    between.jitter = std::chrono::milliseconds(random() % 30);
    between.loss = static_cast<double>(random() % 45) / 100;
    between.duplicate = static_cast<double>(random() % 40) / 100;
    between.reorder = static_cast<double>(random() % 60) / 100;
}

ise::service_options patient() {
    ise::service_options made;
    made.accepts.heartbeat_ns = 3'000'000'000;
    return made;
}

} // namespace

TEST_CASE(
    "packets over a rough way come in order, every missing one is counted, and the last one comes, for every seed") {
    std::uint64_t late = 0;
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
        INFO(fmt::format("seed {}", seed));
        sim_parties sea(seed);
        std::mt19937_64 random(seed);
        rough(sea, random);
        auto& boat = sea.add("boat", patient());
        auto& shore = sea.add("shore", patient());
        auto out = boat.publish(position);
        auto there = shore.at(boat.listen("udp://10.0.0.1:7400"));
        out(fix{1, 0, 0});
        auto got = std::make_shared<reading>();
        auto options = seed % 2 ? ise::subscribe_options::keep_last(300) : ise::subscribe_options::keep_latest();
        options.deadline = 60s;
        auto reader = start(shore.on, read(there, options, 300, got));
        REQUIRE(sea.run_until([&] { return out.subscribers() == 1; }));
        auto publish = [](ise::loop& on, ise::publication<ise::subscription<fix>> to,
                          std::uint64_t pace) -> ise::task<> {
            for (int i = 2; i <= 300; ++i) {
                co_await ise::sleep_for(on, std::chrono::milliseconds(pace));
                to(fix{static_cast<double>(i), 0, 0});
            }
        };
        auto publisher = start(boat.on, publish(boat.on, out, 1 + seed % 20));
        REQUIRE(sea.run_until([&] { return reader->done; }));
        reader->get();
        CHECK(std::is_sorted(got->packets.begin(), got->packets.end()));
        CHECK(std::adjacent_find(got->packets.begin(), got->packets.end()) == got->packets.end());
        CHECK(got->packets.back() == 300);
        CHECK(got->packets.size() + got->lost == 300);
        late += got->counts.late;
        CHECK(sea.stop());
    }
    CHECK(late > 0); // reordering was met
}

TEST_CASE("big packets in fragments get there, or are superseded by newer ones") {
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
        INFO(fmt::format("seed {}", seed));
        sim_parties sea(seed);
        std::mt19937_64 random(seed);
        rough(sea, random);
        auto& boat = sea.add("boat", patient());
        auto& shore = sea.add("shore", patient());
        auto out = boat.publish(pictures);
        auto there = shore.at(boat.listen("udp://10.0.0.1:7400"));
        auto got = std::make_shared<reading>();
        auto reader = start(shore.on, look(there, 500'005, got));
        REQUIRE(sea.run_until([&] { return out.subscribers() == 1; }));
        for (std::size_t i = 1; i <= 5; ++i) {
            blob picture;
            picture.content.resize(500'000 + i);
            out(picture);
            auto then = sea.world.now() + 300ms;
            sea.run_until([&] { return sea.world.now() >= then; });
        }
        REQUIRE(sea.run_until([&] { return reader->done; }));
        CHECK(got->sizes.back() == 500'005);
        CHECK(std::is_sorted(got->sizes.begin(), got->sizes.end()));
    }
}

TEST_CASE("a packet beyond the limit of datagrams is dropped at the provider, counted, and named") {
    sim_parties sea;
    auto& boat = sea.add("boat", patient());
    auto& shore = sea.add("shore", patient());
    auto out = boat.publish(pictures);
    auto there = shore.at(boat.listen("udp://10.0.0.1:7400"));
    auto got = std::make_shared<reading>();
    auto reader = start(shore.on, look(there, 10, got));
    REQUIRE(sea.run_until([&] { return out.subscribers() == 1; }));
    blob picture;
    picture.content.resize(2 << 20);
    out(picture);
    picture.content.resize(10);
    auto then = sea.world.now() + 1s;
    sea.run_until([&] { return sea.world.now() >= then; });
    out(picture);
    REQUIRE(sea.run_until([&] { return reader->done; }));
    CHECK(got->sizes == std::vector<std::size_t>{10});
    CHECK(boat.services->counts().packets_dropped == 1);
    REQUIRE(boat.warnings.size() == 1);
    CHECK_THAT(boat.warnings[0], ise_test::Contains("larger than its subscriber accepts"));
}

TEST_CASE("through a slow way the latest value is not held up by those before it") {
    sim_parties sea;
    auto& between = sea.world.net().between("boat", "shore");
    between.bandwidth_bytes_per_second = 2000;
    between.datagram_queue = 120s; // it stores what it cannot carry, and drops nothing
    ise::service_options options;
    options.unsent_bytes = 8000;
    options.accepts.heartbeat_ns = 20'000'000'000;
    options.connect_time = 60s;
    auto& boat = sea.add("boat", options);
    auto& shore = sea.add("shore", options);
    auto out = boat.publish(position);
    auto there = shore.at(boat.listen("udp://10.0.0.1:7400"));
    struct sample {
        double published_s;
        double heard_s;
    };
    std::vector<sample> all;
    auto listen = [](ise::loop& on, ise::remote from, std::vector<sample>& into) -> ise::task<> {
        auto latest = ise::subscribe_options::keep_latest();
        latest.deadline = 60s;
        auto stream = co_await from.subscribe(position, latest);
        for (;;) {
            auto packet = co_await stream.next();
            if (!packet) break;
            into.push_back(
                sample{packet->latitude_deg, std::chrono::duration<double>(on.now().time_since_epoch()).count()});
        }
    };
    shore.scope.spawn("listener", listen(shore.on, there, all));
    REQUIRE(sea.run_until([&] { return out.subscribers() == 1; }));
    auto publish = [](ise::loop& on, ise::publication<ise::subscription<fix>> to) -> ise::task<> {
        for (;;) {
            co_await ise::sleep_for(on, 5ms); // more than ten times what the way carries
            to(fix{std::chrono::duration<double>(on.now().time_since_epoch()).count(), 0, 0});
        }
    };
    boat.scope.spawn("publisher", publish(boat.on, out));
    auto end = sea.world.now() + 120s;
    sea.run_until([&] { return sea.world.now() >= end; });
    REQUIRE(all.size() > 100);
    double oldest = 0;
    for (const auto& one : all) oldest = std::max(oldest, one.heard_s - one.published_s);
    INFO(fmt::format("{} packets, the oldest {:.2f} s", all.size(), oldest));
    CHECK(oldest < 8000. / 2000 + 0.5); // what the bytes take, and its own way
}

} // namespace udp_subscriptions_test
