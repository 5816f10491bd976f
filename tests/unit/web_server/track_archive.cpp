#include <components/web_server/archive_schema.hpp>
#include <components/web_server/telemetry_feed.hpp>
#include <components/web_server/track_archive.hpp>

#include <ise/database/database.hpp>

#include <components/boat/telemetry.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <random>
#include <span>

namespace track_archive_test {

using namespace std::chrono_literals;
using namespace atirma;
using ise_test::Contains;

namespace {

const utc_ms start{std::chrono::milliseconds(1'790'000'000'000)};
const utc_ms ever{};

/// A database of this process, held open while the archive comes and goes.
struct disk {
    explicit disk(const std::string& name) : held(ise::database::open("memory:" + name, {}).value()) {
        options.file = "memory:" + name;
    }
    std::unique_ptr<track_archive> open() {
        auto opened = track_archive::open(options);
        if (!opened) throw ise::error(opened.error());
        if (auto entered = (*opened)->enter("vela", "Vela"); !entered) throw ise::error(entered.error());
        return std::move(*opened);
    }
    ise::database held;
    archive_options options;
};

track_point point(utc_ms at, double latitude = 28.1) {
    track_point made;
    made.at = at;
    made.latitude_deg = latitude;
    made.longitude_deg = -15.4;
    made.speed_mps = 1.25;
    return made;
}

telemetry_packet packet(std::uint32_t sequence, const telemetry_body& body, utc_ms at = start,
                        link_id link = link_id::gprs) {
    telemetry_packet made;
    made.link = link;
    made.boot = 3;
    made.sequence = sequence;
    made.measured_at = at;
    made.received_at = at + 2s;
    made.raw = encode_telemetry({3, sequence, at}, body);
    return made;
}

} // namespace

TEST_CASE("archive: what was committed is there when it is opened again") {
    disk d("archive-again");
    {
        auto archive = d.open();
        auto fix = point(start);
        fix.wind_speed_mps = 7.5;
        archive->keep("vela", fix, "gprs");
        archive->keep("vela", packet(1, location{}), "location");
        archive->keep("vela", packet(2, power{}, start + 1s), "power");
        archive->keep_cursor("vela", "vela/communication", {{std::numeric_limits<std::uint64_t>::max(), 7}, {12, 9}});
        archive->keep_trip("vela", 1852.5);
        archive->keep_heard("vela", "iridium", start + 9s);
        archive->keep_heard("vela", "iridium", start + 8s);
        CHECK(archive->statistics().waiting == 3);
        archive->keep_heard("vela", "xbee", start + 1h); // by a clock of the shore that is ahead
        REQUIRE(archive->commit(start + 10s));
        CHECK(archive->statistics().waiting == 0);
        archive->keep("vela", point(start + 5s), "gprs"); // and this was not committed
    }
    auto archive = d.open();
    auto fixes = archive->fixes("vela", ever, utc_ms::max(), 100).value();
    REQUIRE(fixes.size() == 1);
    CHECK(fixes[0].point.at == start);
    CHECK(fixes[0].point.latitude_deg == 28.1);
    CHECK(fixes[0].point.speed_mps == 1.25);
    CHECK(fixes[0].point.wind_speed_mps == 7.5);
    CHECK_FALSE(fixes[0].point.heading_deg);
    CHECK(fixes[0].link == "gprs");
    auto packets = archive->newest("vela").value();
    REQUIRE(packets.size() == 2);
    CHECK(packets[1].sequence == 2);
    CHECK(packets[1].raw == packet(2, power{}, start + 1s).raw);
    CHECK(archive->cursor("vela", "vela/communication").value() ==
          track_cursor{{std::numeric_limits<std::uint64_t>::max(), 7}, {12, 9}});
    CHECK(archive->sailed_m("vela").value() == 1852.5);
    CHECK(archive->heard("vela").value().at("gprs") == start + 3s);
    CHECK(archive->heard("vela").value().at("iridium") == start + 9s);
    CHECK(archive->heard("vela").value().at("xbee") == start + 10s);
    CHECK(archive->fixes("another", ever, utc_ms::max(), 100).value().empty());
    CHECK(archive->statistics().fixes == 1);
    CHECK(archive->statistics().packets == 2);
}

TEST_CASE("archive: a fix that comes again is one fix, with what is known last") {
    disk d("archive-twice");
    auto archive = d.open();
    archive->keep("vela", point(start), "xbee");
    REQUIRE(archive->commit(start));
    auto again = point(start);
    again.wind_direction_deg = 30;
    archive->keep("vela", again, "xbee");
    REQUIRE(archive->commit(start));
    auto fixes = archive->fixes("vela", ever, utc_ms::max(), 100).value();
    REQUIRE(fixes.size() == 1);
    CHECK(fixes[0].point.wind_direction_deg == 30);
    CHECK(archive->statistics().fixes == 1);
}

TEST_CASE("archive: a disk that takes nothing loses nothing once it does, and no cursor goes ahead") {
    disk d("archive-full");
    auto archive = d.open();
    REQUIRE(d.held.begin()); // somebody else writes, and does not end
    REQUIRE(d.held.execute("UPDATE boat SET name = name"));
    archive->keep("vela", packet(1, location{}), "location");
    archive->keep_cursor("vela", "nodes", {{5, 1}});
    auto failed = archive->commit(start);
    REQUIRE_FALSE(failed);
    CHECK(failed.error().code() == ise::errc::io_failed);
    CHECK_FALSE(archive->statistics().trouble.empty());
    d.held.rollback();
    CHECK(archive->cursor("vela", "nodes").value().empty());
    REQUIRE(archive->commit(start));
    CHECK(archive->statistics().trouble.empty());
    CHECK(archive->cursor("vela", "nodes").value() == track_cursor{{5, 1}});
    CHECK(archive->telemetry("vela", ever, utc_ms::max(), 10).value().size() == 1);
}

TEST_CASE("archive: what waits is bounded, and what was given up is asked for again") {
    disk d("archive-bounded");
    d.options.max_waiting = 10;
    auto archive = d.open();
    for (int i = 0; i < 25; ++i) archive->keep("vela", point(start + i * 1s), "xbee");
    archive->keep_cursor("vela", "nodes", {{5, 25}});
    CHECK(archive->statistics().waiting == 10);
    CHECK(archive->statistics().given_up == 15);
    REQUIRE(archive->commit(start));
    CHECK(archive->fixes("vela", ever, utc_ms::max(), 100).value().front().point.at == start + 15s);
    CHECK(archive->cursor("vela", "nodes").value().empty());
}

TEST_CASE("archive: old fixes are thinned to one a minute, rough ones stay, and the oldest go") {
    disk d("archive-thin");
    d.options.keep_whole = 24h;
    d.options.keep_fixes = 10 * 24h;
    auto archive = d.open();
    utc_ms noon = std::chrono::floor<std::chrono::hours>(start);
    for (auto at = noon; at < noon + 2h; at += 10s) archive->keep("vela", point(at), "xbee");
    auto rough = point(noon + 30min + 5s);
    rough.circular_error_m = 3000;
    archive->keep("vela", rough, "iridium");
    archive->keep("vela", point(noon + 26h), "xbee");
    REQUIRE(archive->commit(noon + 24h)); // no whole hour is old enough yet
    CHECK(archive->statistics().fixes == 722);
    utc_ms now = noon + 26h;
    for (int i = 0; i < 3; ++i) REQUIRE(archive->commit(now += 5s)); // an hour each
    auto fixes = archive->fixes("vela", ever, utc_ms::max(), 1000).value();
    CHECK(fixes.size() == 120 + 2);
    CHECK(archive->statistics().fixes == fixes.size());
    CHECK(fixes.front().point.at == noon);
    CHECK(fixes.back().point.at == noon + 26h);
    now = noon + 10 * 24h + 1h;
    REQUIRE(archive->commit(now));
    CHECK(archive->fixes("vela", ever, utc_ms::max(), 1000).value().front().point.at == noon + 1h);
}

TEST_CASE("archive: old telemetry goes but for the newest of each kind") {
    disk d("archive-telemetry");
    d.options.keep_telemetry = 24h;
    auto archive = d.open();
    for (std::uint32_t i = 0; i < 100; ++i) archive->keep("vela", packet(i, location{}, start + i * 1s), "location");
    archive->keep("vela", packet(200, power{}, start), "power");
    REQUIRE(archive->commit(start + 1h));
    CHECK(archive->statistics().packets == 101);
    REQUIRE(archive->commit(start + 100h));
    CHECK(archive->statistics().packets == 64 + 1);
    auto newest = archive->newest("vela").value();
    REQUIRE(newest.size() == 2);
    CHECK(newest.back().sequence == 99);
}

TEST_CASE("archive: beyond the most rows the oldest go, whichever boat they are of") {
    disk d("archive-rows");
    d.options.max_rows = 50;
    auto archive = d.open();
    REQUIRE(archive->enter("nao", "Nao"));
    for (std::uint32_t i = 0; i < 40; ++i) {
        archive->keep("vela", point(start + i * 1s), "xbee");
        archive->keep("nao", point(start + 1h + i * 1s), "xbee");
        archive->keep("vela", packet(i, location{}, start + i * 1s), "location");
        archive->keep("nao", packet(i, location{}, start + 1h + i * 1s), "location");
    }
    REQUIRE(archive->commit(start + 2h));
    CHECK(archive->statistics().fixes == 50);
    CHECK(archive->statistics().packets == 50);
    CHECK(archive->fixes("nao", ever, utc_ms::max(), 100).value().size() == 40);
    CHECK(archive->telemetry("vela", ever, utc_ms::max(), 100).value().front().sequence == 30);
}

TEST_CASE("archive: another content under the number of a packet is another packet, and the page shows the same after "
          "a restart") {
    disk d("archive-content");
    auto archive = d.open();
    track_state live;
    telemetry_feed feed(live);
    feed.on_new = [&](const telemetry_packet& one, std::string_view kind) { archive->keep("vela", one, kind); };
    auto at = [&](double latitude, utc_ms measured, utc_ms received) {
        location fix;
        fix.latitude_deg = latitude;
        fix.longitude_deg = -15.4;
        fix.quality = fix_quality::gps;
        auto made = packet(7, fix, measured);
        made.received_at = received;
        feed.take(made, received);
        return made.raw;
    };
    std::vector<ise::bytes> sent;
    SECTION("a forged one of the same time came first") {
        sent = {at(27.0, start, start + 1s), at(28.1, start, start + 2s)};
    }
    SECTION("a forged one from the future came first") {
        sent = {at(27.0, start + 24h, start + 1s), at(28.1, start + 2s, start + 3s)};
    }
    SECTION("a forged one from the future came last, and again") {
        sent = {at(28.1, start, start + 1s), at(27.0, start + 24h, start + 2s)};
        at(27.0, start + 24h, start + 2s);
    }
    REQUIRE(archive->commit(start + 1min));
    CHECK(archive->statistics().packets == 2);
    std::vector<ise::bytes> kept;
    auto packets = archive->telemetry("vela", ever, utc_ms::max(), 10).value();
    for (const auto& one : packets) kept.push_back(one.raw);
    std::ranges::sort(kept);
    std::ranges::sort(sent);
    CHECK(kept == sent);
    archive.reset();
    archive = d.open();
    CHECK(archive->statistics().packets == 2);
    track_state again;
    telemetry_feed restored(again);
    auto newest = archive->newest("vela").value();
    for (const auto& one : newest) restored.restore(one, start + 1min);
    REQUIRE(again.position());
    CHECK(again.position()->latitude_deg == live.position()->latitude_deg);
    CHECK(again.position()->from.measured_at == live.position()->from.measured_at);
}

TEST_CASE("archive: packets from the future are not kept longer than those of their reception") {
    disk d("archive-future");
    d.options.keep_telemetry = 24h;
    auto archive = d.open();
    for (std::uint32_t i = 0; i < 100; ++i) {
        auto forged = packet(1000 + i, location{}, start + 1000h);
        forged.received_at = start + i * 1s;
        archive->keep("vela", forged, "location");
    }
    for (std::uint32_t i = 0; i < 64; ++i)
        archive->keep("vela", packet(i, location{}, start + 1h + i * 1s), "location");
    REQUIRE(archive->commit(start + 100h));
    auto left = archive->telemetry("vela", ever, utc_ms::max(), 1000).value();
    CHECK(left.size() == 64);
    for (const auto& one : left) CHECK(one.sequence < 1000);
}

TEST_CASE("archive: a file from before content counted is taken over whole") {
    disk d("archive-before");
    {
        auto old = ise::database::open(d.options.file, std::span(archive_schema).first(1)).value();
        REQUIRE(old.execute("INSERT INTO boat (id, name) VALUES ('vela', 'Vela')"));
        for (std::uint32_t i = 1; i <= 3; ++i) {
            auto one = packet(i, location{}, start + i * 1s);
            REQUIRE(old.execute(
                "INSERT INTO telemetry (boat, boot, sequence, link, kind, measured_at, received_at, history, raw) "
                "VALUES ('vela', ?, ?, ?, 'location', ?, ?, 0, ?)",
                {std::int64_t{one.boot}, std::int64_t{one.sequence}, static_cast<std::int64_t>(one.link),
                 archived(one.measured_at), archived(one.received_at), one.raw}));
        }
    }
    auto archive = d.open();
    CHECK(archive->statistics().packets == 3);
    archive->keep("vela", packet(2, location{}, start + 2s), "location"); // known
    archive->keep("vela", packet(2, power{}, start + 2s), "power");
    REQUIRE(archive->commit(start));
    CHECK(archive->statistics().packets == 4);
    auto kept = archive->telemetry("vela", ever, utc_ms::max(), 10).value();
    REQUIRE(kept.size() == 4);
    CHECK(kept[0].raw == packet(1, location{}, start + 1s).raw);
    CHECK(kept[0].received_at == start + 3s);
    CHECK(kept[0].link == link_id::gprs);
}

TEST_CASE("archive: many fixes are given evenly spaced, a span of time whole") {
    disk d("archive-many");
    auto archive = d.open();
    for (int i = 0; i < 5000; ++i) archive->keep("vela", point(start + i * 1s), "xbee");
    REQUIRE(archive->commit(start));
    auto some = archive->fixes("vela", ever, utc_ms::max(), 100).value();
    CHECK(some.size() >= 90);
    CHECK(some.size() <= 102);
    CHECK(
        std::is_sorted(some.begin(), some.end(), [](const auto& a, const auto& b) { return a.point.at < b.point.at; }));
    CHECK(archive->fixes("vela", start + 10s, start + 20s, 100).value().size() == 10);
}

TEST_CASE("archive: a file of a newer program is refused, and says what to do") {
    disk d("archive-newer");
    REQUIRE(d.held.execute("PRAGMA user_version = 99"));
    auto opened = track_archive::open(d.options);
    REQUIRE_FALSE(opened);
    CHECK(opened.error().code() == ise::errc::invalid_argument);
    CHECK_THAT(opened.error().message(), Contains("newer program"));
}

TEST_CASE("archive: on a real file it is there after the process's end") {
    auto folder = std::filesystem::temp_directory_path() / ("track-archive-" + std::to_string(std::random_device()()));
    std::filesystem::create_directory(folder);
    archive_options options;
    options.file = (folder / "track.db").string();
    for (int life = 0; life < 3; ++life) {
        auto archive = track_archive::open(options).value();
        REQUIRE(archive->enter("vela", "Vela"));
        CHECK(archive->fixes("vela", ever, utc_ms::max(), 100).value().size() == static_cast<std::size_t>(life));
        archive->keep("vela", point(start + life * 10s), "xbee");
        REQUIRE(archive->commit(start));
    }
    options.file = (folder / "no" / "such.db").string();
    auto missing = track_archive::open(options);
    REQUIRE_FALSE(missing);
    CHECK_THAT(missing.error().message(), Contains("such.db"));
    std::filesystem::remove_all(folder);
}

} // namespace track_archive_test
