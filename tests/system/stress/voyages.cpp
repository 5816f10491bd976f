#include <apps/stress/replaying.hpp>
#include <apps/stress/report.hpp>
#include <apps/stress/voyage.hpp>

#include <support/catch.hpp>
#include <test_folders.hpp>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

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

struct summary {
    bool good = false;
    account story;
    std::string report, picture, gpx, log;
};
summary sail(voyage& sea) {
    sea.sail();
    auto proof = sea.judge();
    summary made;
    made.story = sea.story();
    findings found(made.story);
    made.good = holds(made.story, proof);
    made.report = make_report(made.story, found, proof);
    made.picture = make_picture(made.story, found);
    made.gpx = make_gpx(found);
    made.log = std::string(sea.log());
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
    CHECK(first.report.find("# 20 minutes at sea, seed 7") == 0);
    CHECK(first.report.find("**unknown**") == std::string::npos); // the cause of every silence
    CHECK(first.picture.find("A-Tirma: 20 minutes in the bay") != std::string::npos);
    // The picture has the page's colours of the links.
    std::ifstream page(ISE_SOURCE_DIR "/components/web_server/page/style.css");
    std::string style{std::istreambuf_iterator<char>(page), {}};
    for (auto [variable, link] :
         {std::pair{"--l0: ", ">XBee</text>"}, {"--l1: ", ">GPRS</text>"}, {"--l2: ", ">Iridium</text>"}}) {
        INFO(link);
        auto colour = style.substr(style.find(variable) + 6, 7);
        auto named = first.picture.find(link);
        REQUIRE(named != std::string::npos);
        auto begin = first.picture.rfind("</text>", named);
        CHECK(first.picture.substr(begin, named - begin).find(colour) != std::string::npos);
    }
    for (const auto& one : sea.judge().links) CHECK(one.owed > 0);
    CHECK(first.story.set_back > 0);
    CHECK(first.story.samples.size() == voyage::samples_wanted + 1);
    for (const auto& who : first.story.people)
        for (const auto& one : who.commands)
            if (!one.request.via && one.asked < 15min) CHECK(one.decided.count() >= 0);

    voyage again(short_one(7));
    auto second = sail(again);
    CHECK(first.report == second.report);
    CHECK(first.picture == second.picture);
    CHECK(first.gpx == second.gpx);
    std::string before;
    for (auto at = first.gpx.find("<time>"); at != std::string::npos; at = first.gpx.find("<time>", at + 1)) {
        auto time = first.gpx.substr(at, first.gpx.find("Z</time>", at) - at); // 08:00:32 is before 08:00:32.200
        CHECK(before < time);                                                  // each instant once, in order
        before = time;
    }
    CHECK_FALSE(before.empty());
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
    auto robbed = sea.story();
    CHECK_FALSE(holds(robbed, proof));
    REQUIRE(proof.missing.size() == 1);
    CHECK(std::ranges::any_of(proof.missing, [&](const auto& one) { return one.which == victim->first; }));
    findings found(robbed);
    CHECK(make_report(robbed, found, proof).find("**missing**") != std::string::npos);
}

TEST_CASE("stress: a recorded wind is sailed on, and nothing is lost") {
    auto options = short_one(5);
    options.length = 15min;
    options.wind_csv = "t_s,tws_mps,twd_deg\n0,6.0,40\n120,7.5,52\n300,5.0,61\n420,8.0,44\n900,6.5,38\n";
    voyage sea(options);
    auto result = sail(sea);
    INFO(result.report);
    CHECK(result.good);
    CHECK(result.story.sailed_m > 300);
    CHECK(result.report.find("The wind: a recorded series.") != std::string::npos);
    options.wind_csv = "t_s,tws_mps,twd_deg\n0,6.0,40\n900,6.0,220\n"; // another wind, another track
    voyage other(options);
    CHECK(sail(other).gpx != result.gpx);
}

TEST_CASE("stress: a recorded voyage is replayed into both communication nodes, twice the same, byte for byte") {
    std::string name = (std::filesystem::temp_directory_path() / "ise_voyage_XXXXXX").string();
    const std::filesystem::path folder = ::mkdtemp(name.data());
    auto whole_file = [](const std::filesystem::path& path) {
        std::ifstream in(path, std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(in), {});
    };
    const auto recording = (folder / "voyage.mcap").string();
    {
        auto options = short_one(7);
        options.record = recording;
        voyage sea(std::move(options));
        sea.sail();
    }
    std::vector<ise::replay_report> reports;
    for (const char* out : {"first.mcap", "second.mcap"})
        reports.push_back(replay_nodes(recording, (folder / out).string()));
    const auto& counts = reports[0].counts;
    CHECK(reports[0].length > 19min);
    CHECK(counts.packets > 5000); // of the proxies
    CHECK(counts.called > 1000);  // telemetry to be kept, telecommands, tracks
    CHECK(counts.answered > 50);  // telecommands to the proxies
    CHECK(counts.compared > 2000);
    CHECK(reports[0].hash == reports[1].hash);
    CHECK((whole_file(folder / "first.mcap") == whole_file(folder / "second.mcap")));
    std::filesystem::remove_all(folder);
}
