// Page and console have one rule of when data are current, and follow the period of the link.
#include <components/gui_client/console_state.hpp>
#include <components/gui_client/freshness.hpp>
#include <components/web_server/telemetry_feed.hpp>

#include <support/catch.hpp>

#include <nlohmann/json.hpp>

#include <chrono>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>

using namespace std::chrono_literals;

namespace freshness_test {

using namespace atirma;
using nlohmann::json;

namespace {

const utc_time start{std::chrono::milliseconds(1'790'000'000'000)};
enum class shown { nothing, current, stale };

/// The page: its server's state, and of that what went over its event stream.
struct page {
    track_state state;
    telemetry_feed feed{state};
    json known;

    void take(const telemetry_packet& packet, utc_time now) {
        if (known.is_null()) known = json::parse(state.newest_text(now, "x"))["state"];
        for (const auto& event : feed.take(packet, now)) known.update(json::parse(event.data)["state"]);
        tick(now);
    }
    void tick(utc_time now) { known.update(json::parse(state.status(now).data)["state"]); } // every five seconds
    /// What page/store.js does with it.
    shown at(utc_time now) const {
        if (!known.contains("position") || known["position"].is_null()) return shown::nothing;
        const auto& fix = known["position"];
        auto limits = known["freshness"][fix["source"].get<std::string>()]["position"];
        auto age_ms = now.time_since_epoch().count() - fix["measured_at"].get<std::int64_t>();
        return static_cast<double>(age_ms) >= 1000 * limits[1].get<double>() ? shown::stale : shown::current;
    }
};

shown of(console::console_state& state, utc_time now) {
    auto seen = state.view(now);
    switch (console::freshness_of(seen->boat.position, value_kind::position, seen->boat, now)) {
        case console::freshness::none: return shown::nothing;
        case console::freshness::stale: return shown::stale;
        default: return shown::current;
    }
}

/// A boat that reports over one link, and both who watch it.
struct watch {
    watch(link_id over, std::chrono::seconds every) : link(over), period(every) {}

    link_id link;
    std::chrono::seconds period;
    page tracking;
    console::console_state console;
    std::uint32_t sequence = 0;
    std::string path = "atirma/shore/" + std::string(name_of(link));

    void send(const telemetry_body& body, utc_time measured, utc_time received) {
        telemetry_packet packet;
        packet.link = link;
        packet.boot = 1;
        packet.sequence = ++sequence;
        packet.measured_at = measured;
        packet.received_at = received;
        packet.raw = encode_telemetry({1, packet.sequence, measured}, body);
        tracking.take(packet, received);
        console.on_telemetry(path, packet, received);
    }
    /// One judgement of both; they never differ.
    shown judge(utc_time now) {
        auto by_page = tracking.at(now), by_console = of(console, now);
        if (by_page != by_console) FAIL("page and console differ");
        return by_page;
    }
};

location fix(int number) {
    location made;
    made.quality = fix_quality::gps;
    made.latitude_deg = 28.1 + number * 1e-5;
    made.longitude_deg = -15.4;
    return made;
}

} // namespace

TEST_CASE("freshness: at each period of each link no report is missed in a day, and a loss shows within three") {
    for (auto link : {link_id::xbee, link_id::gprs, link_id::iridium})
        for (auto period : {std::chrono::seconds(1min), std::chrono::seconds(10min), std::chrono::seconds(30min)}) {
            CAPTURE(name_of(link), period.count());
            watch boat(link, period);
            if (link != link_id::iridium) { // over Iridium the boat does not send it: the pace shows
                configuration result;
                result.telemetry_period_s.fill(static_cast<float>(period.count()));
                boat.send(result, start, start + 1s);
            }
            auto last = start;
            int number = 0, wrong = 0;
            for (auto measured = start; measured < start + 24h; measured += period, ++number) {
                // Every seventh is lost, and some are late by most of a minute.
                auto received = measured + std::chrono::seconds(1 + number * 17 % 50);
                for (auto now = measured; now < measured + period; now += 10s) {
                    if (now - 10s < received && received <= now && number % 7 != 3) {
                        boat.send(fix(number), measured, received);
                        last = measured;
                    }
                    wrong += boat.judge(now) == shown::stale;
                }
            }
            CHECK(wrong == 0);
            std::optional<utc_time> noticed;
            for (auto now = start + 24h; !noticed && now < start + 48h; now += 5s)
                if (boat.judge(now) == shown::stale) noticed = now;
            REQUIRE(noticed);
            CHECK(*noticed - last <= 3 * period);
        }
}

TEST_CASE("freshness: limits by age are where they are written, and both sides share them") {
    CHECK(limits_of(2) == freshness_limits{6, 30});
    CHECK(limits_of(60) == freshness_limits{120, 180});
    CHECK(limits_of(1800) == freshness_limits{3600, 5400});
    CHECK(console::judge(120, 60) == console::freshness::fresh);
    CHECK(console::judge(121, 60) == console::freshness::ageing);
    CHECK(console::judge(180, 60) == console::freshness::stale);
    track_state state;
    configuration result;
    result.telemetry_period_s = {60, 0, 600};
    state.on_configuration(result);
    auto page = json::parse(state.newest_text(start, "x"))["state"]["freshness"];
    CHECK(page["xbee"] == json::parse(R"({"position":[120,180],"wind":[240,360],"power":[1200,1800]})"));
    CHECK(page["iridium"]["position"] == json::parse("[1200,1800]"));
}

TEST_CASE("freshness: the pace is what the boat tells, or what is seen") {
    report_rhythm rhythm;
    CHECK(rhythm.position_s(link_id::xbee) == 2);
    CHECK(rhythm.position_s(link_id::iridium) == 1800);
    CHECK(rhythm.position_s(static_cast<link_id>(9)) == 60);
    for (int i = 0; i < 6; ++i) rhythm.on_report(link_id::iridium, start + i * 600s);
    CHECK(rhythm.position_s(link_id::iridium) == 600);
    rhythm.on_report(link_id::iridium, start + 3010s); // on request
    rhythm.on_report(link_id::iridium, start + 9h);    // after an outage
    CHECK(rhythm.position_s(link_id::iridium) == 600);
    rhythm.on_report(link_id::iridium, start); // an old one, of another link's store
    CHECK(rhythm.position_s(link_id::iridium) == 600);
    configuration result;
    result.telemetry_period_s = {2, 0, 60};
    rhythm.on_configuration(result);
    CHECK(rhythm.position_s(link_id::iridium) == 60);
    CHECK(rhythm.position_s(link_id::gprs) == 10); // off: as if nothing were known
    for (int i = 0; i < 5; ++i)
        rhythm.on_report(link_id::iridium, start + 10h + i * 1800s); // that was before it changed
    CHECK(rhythm.position_s(link_id::iridium) == 1800);
    result.telemetry_period_s = {std::numeric_limits<float>::quiet_NaN(), -3, 60};
    rhythm.on_configuration(result);
    CHECK(rhythm.position_s(link_id::xbee) == 2);
}

} // namespace freshness_test
