#include <apps/stress/report.hpp>

#include <support/catch.hpp>

#include <algorithm>

using namespace std::chrono_literals;
using namespace atirma;
using namespace atirma::stress;

namespace {

voyage_options short_one(std::uint64_t seed) {
    voyage_options options;
    options.seed = seed;
    options.length = 20min;
    return options;
}

struct told {
    bool good = false;
    std::string report, picture, gpx, log;
};
told sail(voyage& sea) {
    sea.sail();
    auto proof = sea.judge();
    findings found(sea);
    told made;
    made.good = holds(sea, proof);
    made.report = make_report(sea, found, proof);
    made.picture = make_picture(sea, found);
    made.gpx = make_gpx(found);
    made.log = sea.log();
    return made;
}

/// Two voyages of one program have disks of their own: "memory:stress1-node-1".
std::string without_disk_names(std::string log) {
    for (std::size_t at = 0; (at = log.find("memory:stress", at)) != std::string::npos; ++at)
        log.erase(at, log.find('-', at) - at);
    return log;
}

} // namespace

TEST_CASE(
    "stress: twenty minutes with every trouble lose nothing, a second run is the same, and a planted loss is found") {
    voyage sea(short_one(7));
    auto first = sail(sea);
    INFO(first.report);
    REQUIRE(first.good);
    for (const auto& one : sea.judge().links) CHECK(one.owed > 0);
    CHECK(sea.samples().size() == voyage::samples_wanted + 1);
    for (const auto& who : sea.operator_records())
        for (const auto& one : who.commands)
            if (!one.request.via && one.asked < 15min) CHECK(one.decided.count() >= 0);

    voyage again(short_one(7));
    auto second = sail(again);
    CHECK(first.report == second.report);
    CHECK(first.picture == second.picture);
    CHECK(first.gpx == second.gpx);
    CHECK(without_disk_names(first.log) == without_disk_names(second.log));

    const auto& all = sea.book().entries();
    auto victim = std::ranges::find_if(
        all, [](const auto& one) { return one.second.link == link_id::gprs && one.second.owed(); });
    REQUIRE(victim != all.end());
    for (std::size_t node = 0; node < 2; ++node) {
        auto gone = sea.disk(node).execute(
            "DELETE FROM packets WHERE boot = ? AND sequence = ?",
            {static_cast<std::int64_t>(victim->first >> 32), static_cast<std::int64_t>(victim->first & 0xFFFFFFFF)});
        REQUIRE(gone.value() == 1);
    }
    auto proof = sea.judge();
    CHECK_FALSE(holds(sea, proof));
    REQUIRE(proof.missing.size() == 1 + proof.excused);
    CHECK(std::ranges::any_of(proof.missing, [&](const auto& one) { return one.which == victim->first; }));
    findings found(sea);
    CHECK(make_report(sea, found, proof).find("**lost**") != std::string::npos);
}
