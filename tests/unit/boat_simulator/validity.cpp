// Telecommands expire aboard: over links that lose, keep and delay them, and with a clock that is wrong.
#include <components/boat/telecommand_tracker.hpp>
#include <components/boat_simulator/simulated_boat.hpp>

#include <support/catch.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <deque>
#include <map>
#include <random>

namespace validity_test {

using namespace std::chrono_literals;
using namespace atirma;
using namespace atirma::simulator;

namespace {

constexpr utc_time begin(1'500'000'000'000ms);

boat_options at_anchor(std::optional<std::chrono::milliseconds> clock_off = std::nullopt) {
    boat_options options;
    options.epoch = begin;
    options.clock_off = clock_off;
    return options;
}

telecommand hold(std::uint32_t id, utc_time sent_at, std::chrono::milliseconds valid_for) {
    telecommand made;
    made.id = id;
    made.sent_at = sent_at;
    made.command = commands::set_mode{sailing_mode::hold};
    made.valid_for = valid_for;
    return made;
}

acknowledgement answer(simulated_boat& boat, const telecommand& command) {
    return boat.on_packet(link_id::xbee, encode_telecommand(command)).value();
}

} // namespace

TEST_CASE("validity: what arrives in time is executed, what arrives late is not, and the boat says which") {
    simulated_boat boat(at_anchor(), constant_wind({6, 40}));
    boat.advance(60s);
    auto late = answer(boat, hold(1, begin, 59s));
    CHECK(late.code == ack_code::expired);
    CHECK(late.text == "was valid until 02:40:59Z, it is 02:41:00Z");
    CHECK_FALSE(late.authority);
    CHECK(boat.pilot().mode() == sailing_mode::automatic);
    CHECK(boat.executed_count() == 0);
    CHECK(answer(boat, hold(1, begin, 61s)).code == ack_code::done); // the same id, in time
    CHECK(boat.pilot().mode() == sailing_mode::hold);
    boat.advance(10min);
    auto again = answer(boat, hold(1, begin, 61s)); // executed then: its answer was lost
    CHECK(again.code == ack_code::done);
    CHECK(again.header.measured_at == begin + 60s); // and when
    CHECK(boat.executed_count() == 1);
    auto asks = hold(2, begin, 1s);
    asks.command = commands::ping();
    CHECK(answer(boat, asks).code == ack_code::expired);
    CHECK(boat.late_count() == 2);
}

TEST_CASE("validity: a time of sending ahead of the clock that GPS sets makes no validity longer") {
    simulated_boat boat(at_anchor(), constant_wind({6, 40}));
    boat.advance(60s);
    auto ahead = answer(boat, hold(1, begin + 1h, 59s)); // by a shore whose clock is wrong
    CHECK(ahead.code == ack_code::expired);
    CHECK(ahead.text == "was sent at 03:40:00Z, it is 02:41:00Z");
    CHECK(boat.executed_count() == 0);
    CHECK(answer(boat, hold(1, begin + 65s, 59s)).code == ack_code::done); // no clock is that good
}

TEST_CASE("validity: a telecommand without one is refused, unless it only asks") {
    simulated_boat boat(at_anchor(), constant_wind({6, 40}));
    auto older = hold(1, begin, 1min);
    older.valid_for.reset();
    CHECK(answer(boat, older).code == ack_code::expired);
    CHECK(boat.pilot().mode() == sailing_mode::automatic);
    older.id = 2;
    older.command = commands::ping();
    CHECK(answer(boat, older).code == ack_code::done);
}

TEST_CASE("validity: a boat whose clock no GPS sets obeys times by its own clock only, in the boot that they are for") {
    simulated_boat boat(at_anchor(-4min), constant_wind({6, 40}));
    boat.advance(10s);
    auto in_utc = hold(1, begin, 1min);
    CHECK_THAT(answer(boat, in_utc).text, ise_test::Contains("not set by GPS"));
    auto by_its_own = hold(2, begin - 4min, 1min);
    by_its_own.clock_of = 7;
    CHECK_THAT(answer(boat, by_its_own).text, ise_test::Contains("boot 7, this is boot 1"));
    by_its_own.clock_of = 1;
    CHECK(answer(boat, by_its_own).code == ack_code::done);
    by_its_own.id = 3;
    boat.advance(61s);
    CHECK(answer(boat, by_its_own).code == ack_code::expired);
}

namespace {

/// A link: what goes into it comes out later, or never, and each copy on its own.
struct air {
    struct under_way {
        std::int64_t at_ms = 0;
        ise::bytes raw;
    };
    void send(std::int64_t at_ms, ise::bytes raw) { packets.push_back({at_ms, std::move(raw)}); }
    std::vector<ise::bytes> arrived(std::int64_t now_ms) {
        std::vector<ise::bytes> all;
        for (auto it = packets.begin(); it != packets.end();)
            if (it->at_ms <= now_ms) {
                all.push_back(std::move(it->raw));
                it = packets.erase(it);
            } else ++it;
        return all;
    }
    std::deque<under_way> packets;
};

struct result {
    std::size_t executed = 0, late = 0, given = 0, answered_expired = 0;
};

/// Half an hour with outages of all links, which keep what is in them: a modem for a second, a connection for minutes,
/// a gateway until the next session. `checks`: whether telecommands say how long they are valid.
result sail(std::uint64_t seed, bool checks) {
    std::mt19937_64 dice(seed);
    auto below = [&](std::uint64_t n) { return dice() % n; };
    auto options = at_anchor();
    options.clock_rate = 10; // the model is of no interest
    if (below(3) != 0) options.clock_off = std::chrono::seconds(static_cast<std::int64_t>(below(600)) - 300);
    options.telemetry_period_s = {0.5, 0.5, 60};
    simulated_boat boat(options, constant_wind({6, 40}));
    std::array<telecommand_tracker, link_count> trackers;
    for (std::size_t i = 0; i < link_count; ++i) {
        link_policy policy;
        policy.link = static_cast<link_id>(i);
        if (policy.link == link_id::iridium) policy.answer_time.reset();
        trackers[i] = telecommand_tracker(policy);
    }
    std::array<air, link_count> up, down;
    std::map<std::uint32_t, std::int64_t> valid_until_ms;
    std::array<std::int64_t, link_count> dark_until_ms{};
    result made;
    std::uint64_t counted = 0;
    std::uint32_t next_id = 1;
    constexpr std::int64_t end_ms = 30 * 60'000, step_ms = 500;
    for (std::int64_t now_ms = step_ms; now_ms < end_ms; now_ms += step_ms) {
        tracker_time at;
        at.now = ise::time_point(std::chrono::hours(1) + std::chrono::milliseconds(now_ms));
        at.wall = begin + std::chrono::milliseconds(now_ms);
        boat.advance(std::chrono::milliseconds(now_ms) / 10);
        if (below(2000) == 0) { // its computer starts again
            telecommand reboot;
            reboot.id = 1'000'000 + next_id++;
            reboot.command = commands::reboot();
            boat.execute(reboot);
        }
        for (std::size_t i = 0; i < link_count; ++i) {
            auto link = static_cast<link_id>(i);
            if (below(240) == 0) dark_until_ms[i] = now_ms + static_cast<std::int64_t>(below(300'000));
            bool dark = now_ms < dark_until_ms[i];
            auto& tracker = trackers[i];
            if (below(120) == 0 && tracker.open_count() < 8) {
                telecommand_request request;
                request.id = next_id++;
                request.command = commands::set_mode{sailing_mode::hold};
                request.valid_s = static_cast<float>(1 + below(link == link_id::iridium ? 900 : 120));
                if (tracker.submit(at, request, 0)) {
                    valid_until_ms[request.id] = now_ms + static_cast<std::int64_t>(*request.valid_s * 1000);
                    ++made.given;
                }
            }
            tracker.on_time(at);
            while (auto due = tracker.next_due(at)) {
                auto raw = std::move(due->raw);
                if (!checks) { // as before there were validities
                    auto bare = parse_telecommand(raw).value();
                    bare.valid_for = telecommand::max_valid_for;
                    raw = encode_telecommand(bare);
                }
                auto way_ms = static_cast<std::int64_t>(link == link_id::iridium ? 5000 + below(400'000) : below(1500));
                auto arrives_ms = now_ms + way_ms;
                if (dark && link != link_id::xbee) arrives_ms = std::max(arrives_ms, dark_until_ms[i]);
                if (!(dark && link == link_id::xbee) && below(5) != 0) up[i].send(arrives_ms, std::move(raw));
                tracker.on_outcome(at, due->id, make_outcome(link_outcome::kind::delivered, ""));
            }
            for (const auto& raw : up[i].arrived(now_ms)) (void)boat.on_packet(link, raw);
            for (auto& raw : boat.take_packets(link)) {
                auto way_ms = static_cast<std::int64_t>(link == link_id::iridium ? 5000 + below(60'000) : below(1500));
                if (!dark && below(5) != 0) down[i].send(now_ms + way_ms, std::move(raw));
            }
            for (const auto& raw : down[i].arrived(now_ms)) {
                if (classify(raw) == packet_class::acknowledgement) {
                    auto ack = parse_acknowledgement(raw).value();
                    if (ack.code == ack_code::expired) ++made.answered_expired;
                    tracker.on_acknowledgement(at, ack);
                } else if (auto parsed = parse_telemetry(raw)) tracker.on_heard(at, parsed->header);
            }
            (void)tracker.take_changes();
        }
        auto fresh = std::min<std::uint64_t>(boat.executed_count() - counted, boat.executed().size());
        counted = boat.executed_count();
        for (auto it = boat.executed().end() - static_cast<std::ptrdiff_t>(fresh); it != boat.executed().end(); ++it) {
            auto known = valid_until_ms.find(it->id);
            if (known == valid_until_ms.end()) continue;
            ++made.executed;
            if (now_ms > known->second) ++made.late;
        }
    }
    return made;
}

} // namespace

TEST_CASE("validity: over outages of all links and with clocks wrong by minutes, nothing is executed late") {
    const char* asked = std::getenv("ATIRMA_VALIDITY_SEEDS");
#ifdef NDEBUG
    std::uint64_t seeds = 1000; // 7 s
#else
    std::uint64_t seeds = 15; // a sanitizer takes its time
#endif
    if (asked) seeds = std::strtoull(asked, nullptr, 10);
    result all, unchecked;
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
        auto one = sail(seed, true);
        INFO("seed " << seed);
        CHECK(one.late == 0);
        all.executed += one.executed;
        all.given += one.given;
        all.late += one.late;
        all.answered_expired += one.answered_expired;
        auto other = sail(seed, false);
        unchecked.executed += other.executed;
        unchecked.late += other.late;
    }
    if (asked)
        fmt::print("{} seeds: {} telecommands given, {} executed, {} late; {} answers said expired. "
                   "Without validities: {} executed, {} of them late\n",
                   seeds, all.given, all.executed, all.late, all.answered_expired, unchecked.executed, unchecked.late);
    CHECK(unchecked.late > 0); // without the boat's check there are some
    CHECK(all.answered_expired > 0);
    // What can be executed in time is, also by a boat whose clock is wrong.
    CHECK(all.executed * 10 > (unchecked.executed - unchecked.late) * 8);
}

} // namespace validity_test
