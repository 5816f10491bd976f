#include <components/boat/boat_clock.hpp>

#include <support/catch.hpp>

#include <chrono>

namespace boat_clock_test {

using namespace std::chrono_literals;
using namespace atirma;

namespace {

struct shore {
    boat_clock clock;
    ise::time_point now{1h};
    utc_time wall{std::chrono::hours(400'000)};

    void pass(ise::duration time) {
        now += time;
        wall += std::chrono::duration_cast<std::chrono::milliseconds>(time);
    }
    /// A packet that the boat measured so long ago, by a clock that is ahead by so much.
    void hear(std::uint16_t boot, std::chrono::milliseconds ahead, std::chrono::milliseconds on_the_way,
              bool current = false) {
        packet_header packet;
        packet.boot = boot;
        packet.measured_at = wall + ahead - on_the_way;
        clock.heard(now, packet, current);
    }
    boat_clock::stamp read() const { return clock.read(now, wall); }
};

} // namespace

TEST_CASE("boat clock: without a packet of the boat times are UTC") {
    shore it;
    CHECK(it.read().boot == 0);
    CHECK(it.read().at == it.wall);
}

TEST_CASE("boat clock: a time for the boat is never later than its own clock, however long its packets took") {
    for (auto ahead : {-300s, -2s, 0s, 40s, 300s}) {
        shore it;
        for (auto way : {90s, 7s, 200s, 3s, 60s}) {
            it.hear(5, ahead, way);
            CHECK(it.read().at <= it.wall + ahead);
            it.pass(10s);
        }
        auto stamp = it.read();
        CHECK(stamp.at <= it.wall + ahead);
        CHECK(stamp.at >= it.wall + ahead - 3s - 10ms); // the fastest packet counts
        CHECK(stamp.boot == (ahead > 4s ? 5 : 0));      // beyond UTC it holds for that boot only
    }
}

TEST_CASE("boat clock: a reading loses what a bad clock loses, and a new boot has one of its own") {
    shore it;
    it.hear(5, 0s, 0s);
    it.pass(10'000s);
    CHECK(it.read().at == it.wall - 1s);
    it.hear(6, -120s, 1s);
    CHECK(it.read().at == it.wall - 121s);
    it.hear(5, 0s, 9000s); // what the boot before had kept does not bring it back
    CHECK(it.read().at == it.wall - 121s);
    it.hear(5, 0s, 1s, true); // but its answer does
    CHECK(it.read().at >= it.wall - 3s);
}

TEST_CASE("boat clock: history of a former boot is not taken for a new boot, and an answer is") {
    shore it;
    it.hear(6, 0s, 1s);
    it.hear(5, 0s, 9000s); // the shore did not hear it before: it was restarted
    CHECK(it.read().at == it.wall - 1s);
    it.hear(4, -9000s, 1s, true); // its clock went back: it says so itself
    CHECK(it.read().at == it.wall - 9001s);
}

TEST_CASE("boat clock: a boat that cannot judge UTC gets times by its own clock") {
    shore it;
    it.hear(5, -200s, 1s);
    CHECK(it.read().boot == 0);
    it.clock.distrust(5);
    CHECK(it.read().boot == 5);
    CHECK(it.read().at == it.wall - 201s);
    packet_header result;
    result.boot = 5;
    result.measured_at = it.wall - 200s - 10s;
    CHECK(it.clock.shore_time(it.now, it.wall, result) >= it.wall - 10s);
    CHECK(it.clock.shore_time(it.now, it.wall, result) <= it.wall);
}

TEST_CASE("boat clock: the shore's own clock may be set while a packet is on its way") {
    shore it;
    it.hear(5, 0s, 1s);
    it.pass(10s);
    auto before = it.read().at;
    it.wall += 300s; // set
    CHECK(it.read().at == before);
}

} // namespace boat_clock_test
