// Disks that lie: a backup that was put back, half a log, bits that flip, files that are none any more.
#include "shore.hpp"

#include <support/catch.hpp>

#include <filesystem>
#include <fstream>
#include <limits>
#include <sqlite3.h>
#include <unistd.h>

using namespace communication_test;
using ise_test::Contains;

namespace {

// Both nodes serve, on disks that are files, and packets are handed to the role.
struct disks : shore {
    disks() {
        std::filesystem::create_directories(folder);
        use_files(folder);
        start_node(one);
        start_node(two);
        both_serve();
    }
    ~disks() { std::filesystem::remove_all(folder); }

    void both_serve() {
        REQUIRE(
            until([&] { return serves(one) && serves(two) && state(one).peer_lives && state(two).peer_lives; }, 60s));
    }
    // Gives that node packets as a proxy does, and takes its word for how many disks have them.
    void feed(int packets, std::uint32_t copies, const std::string& whom = std::string(communication_role)) {
        for (int left = packets; left > 0; left -= 20) {
            keep_request request;
            for (int i = 0; i < std::min(left, 20); ++i)
                request.packets.push_back(boat.make(link_id::gprs, utc_time(1'504'512'000'000ms) + boat.sequence * 1s));
            auto kept = ask("proxy", services::telemetry_store, request, 20s, whom);
            REQUIRE(kept);
            CHECK(kept->copies == copies);
            for (const auto& packet : request.packets) {
                given.insert(key_of(packet));
                if (copies < 2) continue;
                CHECK(on_disk(one).contains(key_of(packet)));
                CHECK(on_disk(two).contains(key_of(packet)));
            }
        }
    }
    void put_back(const std::string& name) {
        for (const auto* part : {"", "-wal", "-shm"}) std::filesystem::remove(disk_of(name) + part);
        std::filesystem::copy_file(disk_of(name) + ".kept", disk_of(name));
    }
    void keep_a_copy(const std::string& name) { ise::database::copy(disk_of(name), disk_of(name) + ".kept").value(); }
    void change(const std::string& name, const std::string& sql) {
        sqlite3* raw = nullptr;
        REQUIRE(sqlite3_open(disk_of(name).c_str(), &raw) == SQLITE_OK);
        CHECK(sqlite3_exec(raw, sql.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK);
        sqlite3_close(raw);
    }
    std::vector<std::string> set_aside(const std::string& name) {
        std::vector<std::string> made;
        for (const auto& file : std::filesystem::directory_iterator(folder)) {
            auto path = file.path().string();
            if (path.starts_with(disk_of(name) + ".damaged-") && !path.ends_with("-wal") && !path.ends_with("-shm"))
                made.push_back(path);
        }
        return made;
    }
    bool both_have_all() { return on_disk(one) == given && on_disk(two) == given; }

    std::string folder =
        (std::filesystem::temp_directory_path() / ("ise-shore-" + std::to_string(::getpid()))).string();
    std::set<packet_key> given;
};

} // namespace

TEST_CASE("communication: a backup that was put back is no second copy, and both nodes get what they lack") {
    disks it;
    auto victim = GENERATE(one, two);
    auto& other = victim == one ? two : one;
    CAPTURE(victim, other);
    it.feed(100, 2);
    it.keep_a_copy(victim);
    it.feed(200, 2);
    REQUIRE(it.until([&] { return it.state(other).peer_misses == 0; }));
    it.crash(victim);
    it.put_back(victim);
    SECTION("the other node is there when it starts") {
        it.start_node(victim);
        it.both_serve();
    }
    SECTION("it goes on alone first, to beyond what it had") {
        it.crash(other);
        it.start_node(victim);
        REQUIRE(it.until([&] { return it.serves(victim); }, 30s));
        it.feed(300, 1);
        it.start_node(other);
        it.both_serve();
    }
    it.feed(100, 2);
    CHECK(it.until([&] { return it.both_have_all() && it.state(victim).store_notice != ""; }));
    CHECK_THAT(it.state(victim).store_notice,
               Contains("went back in time") && Contains("knows 300 packets") && Contains("of which 100"));
    CHECK(it.state(other).store_notice == "");
}

TEST_CASE("communication: half a log is no second copy either") {
    disks it;
    it.feed(40, 2);
    auto file = it.disk_of(one);
    for (const auto* part : {"", "-wal"}) std::filesystem::copy_file(file + part, file + ".kept" + part);
    it.crash(one);
    for (const auto* part : {"", "-wal"})
        std::filesystem::copy_file(file + ".kept" + part, file + part,
                                   std::filesystem::copy_options::overwrite_existing);
    std::filesystem::resize_file(file + "-wal", std::filesystem::file_size(file + "-wal") / 2);
    it.start_node(one);
    it.both_serve();
    it.feed(100, 2);
    CHECK(it.until([&] { return it.both_have_all() && it.state(one).store_notice != ""; }));
    CHECK_THAT(it.state(one).store_notice, Contains("went back in time"));
}

TEST_CASE("communication: whoever follows the role hears everything once though the nodes' disks went back") {
    disks it;
    auto& seen = it.listen();
    it.feed(60, 2);
    REQUIRE(it.until([&] { return seen.known == it.given; }));
    it.keep_a_copy(one);
    it.feed(60, 2);
    REQUIRE(it.until([&] { return seen.known == it.given; }));
    it.crash(one);
    it.put_back(one);
    it.crash(two);
    it.start_node(one); // alone, it gives numbers again that the listener knows
    REQUIRE(it.until([&] { return it.serves(one); }, 30s));
    it.feed(100, 1);
    CHECK(it.until([&] { return seen.known == it.given; }));
    it.start_node(two);
    it.both_serve();
    it.feed(20, 2);
    CHECK(it.until([&] { return seen.known == it.given && it.both_have_all(); }));
    CHECK(seen.twice == 0);
}

TEST_CASE(
    "communication: a packet that the disk changed is neither served nor replicated, and its store is filled anew") {
    disks it;
    it.feed(60, 2);
    it.crash(two);
    REQUIRE(it.until([&] { return !it.state(one).peer_lives; }));
    it.feed(40, 1); // that only this node has
    it.change(one, "UPDATE packets SET raw = CAST(raw || x'00' AS BLOB) WHERE position = 30");
    track_request request;
    request.max_packets = 1000;
    auto refused = it.ask("ana", services::track, request);
    REQUIRE_FALSE(refused);
    CHECK_THAT(refused.error().message(), Contains("packet 30 is damaged"));
    CHECK(it.process(one).running());
    REQUIRE(it.set_aside(one).size() == 1);
    CHECK_THAT(it.state(one).store_notice, Contains("packet 30 is damaged") && Contains(it.set_aside(one).front()));
    REQUIRE(it.until([&] { return it.on_disk(one).size() == 99; })); // of the damaged file all but the one
    it.start_node(two);
    it.both_serve();
    CHECK(it.until([&] { return it.both_have_all(); }));
    it.feed(20, 2);
    auto track = it.ask("ana", services::track, request);
    REQUIRE(track);
    CHECK(track->packets.size() == 120);
    for (const auto& packet : track->packets) CHECK(parse_telemetry(packet.raw));
    CHECK(it.state(one).trouble == "");
}

TEST_CASE("communication: the other node's request waits as long as it says, and a time that is no number is none") {
    disks it;
    it.crash(two);
    replication_request request;
    request.node = two;
    request.secondary = true;
    request.origin = 4711;
    store_part known;
    known.store = it.state(one).store;
    request.yours.push_back(known);
    auto [wait_s, at_least, at_most] =
        GENERATE(table<float, ise::duration, ise::duration>({{2.0f, 2s, 3s},
                                                             {-1.0f, 0s, 1s},
                                                             {std::numeric_limits<float>::quiet_NaN(), 0s, 1s},
                                                             {std::numeric_limits<float>::infinity(), 10s, 11s}}));
    CAPTURE(wait_s);
    request.wait_s = wait_s;
    auto begun = it.world.elapsed();
    REQUIRE(it.ask("somebody", services::replication, request, 20s, one));
    CHECK(it.world.elapsed() - begun >= at_least);
    CHECK(it.world.elapsed() - begun < at_most);
}

TEST_CASE("communication: a node that is started on the file of another waits for it, and harms nothing") {
    disks it;
    it.feed(20, 2);
    communication_node* third = nullptr;
    it.names.start("third", "third", [&](ise::node& node) {
        auto options = it.terms;
        options.file = it.disk_of(one);
        third = &node.start<communication_node>("shore/third", names_test::everywhere(), std::move(options));
    });
    it.world.run_for(20s);
    it.feed(20, 2);
    CHECK(it.set_aside(one).empty());
    CHECK(it.state(one).store_notice.empty());
    CHECK(it.state(one).trouble.empty());
    CHECK_FALSE(third->how().serving);
    it.crash(one);
    CHECK(it.until([&] { return third->how().packets == 40; }, 30s));
    CHECK(it.set_aside(one).empty());
}

TEST_CASE("communication: a file that is none any more is set aside at the start, and filled from the other node") {
    disks it;
    it.feed(60, 2);
    auto held = it.authority("ana", authority_action::take);
    REQUIRE(held);
    REQUIRE(it.command("ana", adds_waypoint(7)));
    auto& seen = it.listen();
    REQUIRE(it.until([&] { return seen.known == it.given; }));
    it.crash(one);
    REQUIRE(it.until([&] { return it.serves(two) && !it.state(two).peer_lives; }));
    it.feed(20, 1);
    SECTION("its beginning is overwritten") {
        std::fstream disk(it.disk_of(one), std::ios::in | std::ios::out | std::ios::binary);
        disk << std::string(3000, 'x');
    }
    SECTION("its log is played and it ends in the middle") {
        it.change(one, "PRAGMA wal_checkpoint(TRUNCATE)");
        std::filesystem::resize_file(it.disk_of(one), 20'000);
    }
    it.start_node(one);
    it.both_serve();
    CHECK(it.set_aside(one).size() == 1);
    CHECK(it.until([&] { return it.both_have_all(); }));
    it.feed(20, 2);
    CHECK(it.state(one).authority.holder == held->holder);
    auto record = it.ask("ana", services::telecommand_record, record_request(), 20s, one);
    REQUIRE(record);
    CHECK(std::ranges::any_of(record->entries, [](const auto& entry) { return entry.id == 7; }));
    CHECK(it.until([&] { return seen.known == it.given; }));
    CHECK(seen.twice == 0);
    CHECK_THAT(it.state(one).store_notice, Contains("set aside as " + it.set_aside(one).front()));
}
