#include <apps/stress/findings.hpp>
#include <apps/stress/ledger.hpp>
#include <apps/stress/plan.hpp>
#include <apps/stress/report.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <cmath>

using namespace std::chrono_literals;
using namespace atirma;
using namespace atirma::stress;

namespace {

std::array<std::set<packet_key>, 2> both(std::set<packet_key> what) { return {what, what}; }

} // namespace

TEST_CASE("stress: what a link took over and a disk does not have is lost, and the proof says which it was") {
    ledger book;
    for (packet_key n = 1; n <= 3; ++n) {
        book.sent(link_id::gprs, n, 1s);
        book.acknowledged(link_id::gprs, n, 2s);
    }
    CHECK(book.judge(both({1, 2, 3}), 1h).holds);
    auto verdict = book.judge(both({1, 3}), 1h);
    CHECK_FALSE(verdict.holds);
    REQUIRE(verdict.missing.size() == 1);
    CHECK(verdict.missing.front().which == 2);
    CHECK(verdict.links[static_cast<std::size_t>(link_id::gprs)].owed == 3);
    CHECK(verdict.links[static_cast<std::size_t>(link_id::gprs)].kept == 2);
}

TEST_CASE("stress: what was sent and never taken over may be missing") {
    ledger book;
    book.sent(link_id::gprs, 1, 1s);
    book.sent(link_id::xbee, 2, 1s);
    book.acknowledged(link_id::xbee, 2, 2s); // by the modem; the proxy never read it
    book.sent(link_id::xbee, 3, 1s);
    book.arrived(3, 2s);
    book.receipted(3, 3s);
    book.sent(link_id::xbee, 4, 1s);
    book.arrived(4, 2s); // the proxy died with it
    CHECK(book.judge(both({3}), 1h).holds);
    CHECK_FALSE(book.judge(both({1, 2, 4}), 1h).holds);
}

TEST_CASE("stress: what was sent and is neither on a disk nor at the boat is told as lost, with its cause") {
    ledger book;
    for (packet_key n = 1; n <= 5; ++n) book.sent(link_id::xbee, n, n * 10min);
    book.arrived(1, 11min);
    book.receipted(1, 12min);
    book.arrived(2, 21min);
    auto verdict = book.judge(both({1}), 1h, {4});
    CHECK(verdict.holds);
    const auto& radio = verdict.links[static_cast<std::size_t>(link_id::xbee)];
    CHECK(radio.sent == 5);
    CHECK(radio.heard == 2);
    CHECK(radio.kept == 1);
    CHECK(radio.waiting == 1);
    CHECK(verdict.lost.size() == 3);
    account result;
    result.plan.length = 1h;
    auto& noise = result.episodes.emplace_back();
    noise.from = 29min;
    noise.until = 31min;
    noise.what = "noise";
    noise.link = link_id::xbee;
    auto causes = findings::causes_of(result, verdict.lost, link_id::xbee);
    CHECK(causes.size() == 3);
    CHECK(causes["noise"] == 1);
    CHECK(causes["lost on shore, cause unknown"] == 1);
    CHECK(causes["never received on shore, cause unknown"] == 1);
    CHECK(findings::causes_of(result, verdict.lost, link_id::gprs).empty());
}

TEST_CASE("stress: a silence of Iridium without a fault is explained by what its modem reported") {
    account result;
    result.plan.length = 1h;
    result.plan.iridium_period_s = 60;
    auto cause = [&] {
        auto silent = findings(result).gaps[static_cast<std::size_t>(link_id::iridium)];
        REQUIRE(silent.size() == 1);
        return silent.front().cause;
    };
    CHECK(cause() == "the boat began no session");
    result.sessions = {{20min, 20min + 30s, false}, {25min, 25min + 30s, false}};
    CHECK(cause() == "2 sessions broke off");
    ledger book;
    book.sent(link_id::iridium, 1, 19min);
    auto causes = findings::causes_of(result, book.judge(both({}), 1h).lost, link_id::iridium);
    CHECK(causes["its session broke off"] == 1);
    result.sessions.clear();
    result.episodes.push_back({10min, 50min, "no satellite in sight", link_id::iridium});
    CHECK(cause() == "no satellite in sight");
}

TEST_CASE("stress: what was taken over after the end is not judged") {
    ledger book;
    book.sent(link_id::xbee, 1, 1s);
    book.arrived(1, 5s);
    book.receipted(1, 10s);
    CHECK(book.judge(both({}), 9s).holds);
    CHECK_FALSE(book.judge(both({}), 10s).holds);
}

TEST_CASE("stress: what grows is told by its slope over the second half, and flat is at most five per cent there") {
    std::vector<std::pair<ise::duration, std::size_t>> all;
    for (int hour = 0; hour <= 40; ++hour) all.emplace_back(hour * 1h, hour < 10 ? 500 * hour : 5000 + hour % 2 * 20);
    auto still = trend_of(all); // it fills up in the beginning, and then it stays
    CHECK(still.flat());
    CHECK(still.mean == Approx(5010).margin(1));
    CHECK(std::abs(still.per_hour) < 1);
    CHECK(say(still).find(": flat") != std::string::npos);
    // What 25 % of growth over 40 hours once hid.
    for (auto& [at, value] : all) value += static_cast<std::size_t>(at / 1h) * 25;
    auto growing = trend_of(all);
    CHECK_FALSE(growing.flat());
    CHECK(growing.per_hour == Approx(25).margin(1));
    CHECK(say(growing).find("per hour: **growing**") != std::string::npos);
    CHECK(meaning_of_flat().find("at most 5 % of the average.") != std::string::npos);
    CHECK(trend_of({}).flat());
}

TEST_CASE("stress: a packet on one disk only breaks the proof") {
    ledger book;
    book.sent(link_id::iridium, 1, 1s);
    book.acknowledged(link_id::iridium, 1, 2s);
    std::array<std::set<packet_key>, 2> disks{std::set<packet_key>{1}, std::set<packet_key>{}};
    auto verdict = book.judge(disks, 1h);
    CHECK(verdict.only_on_one == 1);
    CHECK_FALSE(verdict.holds);
}

TEST_CASE("stress: a packet that is shown twice, never, or from nowhere breaks the proof") {
    ledger book;
    for (packet_key n = 1; n <= 2; ++n) {
        book.sent(link_id::gprs, n, 1s);
        book.acknowledged(link_id::gprs, n, 2s);
        book.shown("ana", n);
    }
    CHECK(book.judge(both({1, 2}), 1h).holds);
    SECTION("twice") {
        book.shown("ana", 2);
        auto verdict = book.judge(both({1, 2}), 1h);
        CHECK(verdict.subscribers.at("ana").twice == 1);
        CHECK_FALSE(verdict.holds);
    }
    SECTION("never") {
        book.shown("ben", 1);
        auto verdict = book.judge(both({1, 2}), 1h);
        CHECK(verdict.subscribers.at("ben").missed == 1);
        CHECK_FALSE(verdict.holds);
    }
    SECTION("from nowhere") {
        book.shown("ana", 7);
        auto verdict = book.judge(both({1, 2}), 1h);
        CHECK(verdict.subscribers.at("ana").unknown == 1);
        CHECK_FALSE(verdict.holds);
    }
}

TEST_CASE("stress: who was to be shown everything and was shown nothing breaks the proof") {
    ledger book;
    book.expect("ana");
    book.sent(link_id::gprs, 1, 1s);
    CHECK(book.judge(both({}), 1h).holds);
    auto verdict = book.judge(both({1}), 1h);
    CHECK(verdict.subscribers.at("ana").missed == 1);
    CHECK_FALSE(verdict.holds);
}

TEST_CASE("stress: a packet on the disks that nobody saw on a wire breaks the proof: who reads along is blind") {
    ledger book;
    book.sent(link_id::gprs, 1, 1s);
    book.acknowledged(link_id::gprs, 1, 2s);
    auto verdict = book.judge(both({1, 2}), 1h);
    CHECK(verdict.unheard == 1);
    CHECK_FALSE(verdict.holds);
}

TEST_CASE("stress: a proof about a link that brought nothing, or a page that was shown less or more, does not hold") {
    ledger book;
    for (packet_key n = 1; n <= link_count; ++n) {
        auto link = static_cast<link_id>(n - 1);
        book.sent(link, n, 1s);
        if (link == link_id::xbee) book.receipted(n, 2s);
        else book.acknowledged(link, n, 2s);
    }
    account result;
    result.plan.length = 1h;
    result.page.received = 3;
    result.packets.resize(3);
    result.consoles.emplace_back().fix = true;
    CHECK(holds(result, book.judge(both({1, 2, 3}), 1h)));
    result.page.received = 2;
    CHECK_FALSE(holds(result, book.judge(both({1, 2, 3}), 1h)));
    result.virtual_clock = false; // a real page kept what its lives before were shown
    CHECK(holds(result, book.judge(both({1, 2, 3}), 1h)));
    CHECK_FALSE(holds(result, book.judge(both({1, 2, 3}), 1500ms))); // nothing was owed by then
}

TEST_CASE("stress: a plan has every trouble, is the same for the same seed, and kills one process at a time") {
    for (std::uint64_t seed = 1; seed <= 20; ++seed)
        for (auto [length, database] :
             {std::pair<ise::duration, bool>(20min, false), {20min, true}, {10h, false}, {10h, true}}) {
            auto made = make_plan(seed, length, database), again = make_plan(seed, length, database);
            REQUIRE(made.faults.size() == again.faults.size());
            for (std::size_t i = 0; i < made.faults.size(); ++i)
                CHECK((made.faults[i].at == again.faults[i].at && made.faults[i].what == again.faults[i].what));
            for (int kind = 0; kind <= static_cast<int>(trouble::operator_away); ++kind) {
                auto what = static_cast<trouble>(kind);
                if (what == trouble::air_off) continue;
                bool of_database = what == trouble::database_crashed || what == trouble::database_stopped;
                CHECK(std::ranges::any_of(made.faults, [&](const auto& one) { return one.what == what; }) ==
                      (database || !of_database));
            }
            CHECK(std::ranges::all_of(made.faults, [&](const auto& one) { return one.at + one.length < length; }));
            ise::duration free{};
            for (const auto& one : made.faults) {
                if (!kills(one.what)) continue;
                CHECK(one.at >= free);
                free = one.at + one.length + 20s; // and time to come back
            }
            CHECK(std::ranges::is_sorted(made.orders, {}, [](const auto& one) { return one.at; }));
        }
    CHECK(make_plan(1, 10h).faults.front().at != make_plan(2, 10h).faults.front().at);
}

TEST_CASE("stress: the length of a voyage and counts are written out") {
    CHECK(voyage_text(30min) == "30 minutes");
    CHECK(voyage_text(1h) == "1 hour");
    CHECK(voyage_text(10h) == "10 hours");
    CHECK(voyage_text(1h + 30min) == "1 hour 30 minutes");
    CHECK(voyage_text(2h + 1min) == "2 hours 1 minute");
    CHECK(counted(0, "gap") == "0 gaps");
    CHECK(counted(1, "gap") == "1 gap");
}
