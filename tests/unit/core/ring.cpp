#include <ise/core/counted.hpp>
#include <ise/core/ring.hpp>

#include <support/catch.hpp>

#include <deque>
#include <random>
#include <string>

namespace ring_test {

TEST_CASE("a ring behaves as a queue, whatever is done with it") {
    std::mt19937 random(7);
    ise::ring<std::string> ring;
    std::deque<std::string> expected;
    int number = 0;
    for (int step = 0; step < 20'000; ++step) {
        switch (random() % 8) {
            case 0: // a burst
                for (auto left = random() % 300; left > 0; --left) {
                    expected.push_back(std::to_string(++number));
                    ring.push_back(expected.back());
                }
                break;
            case 1: // emptied
                for (; !expected.empty(); expected.pop_front()) REQUIRE(ring.pop_front() == expected.front());
                break;
            case 2: {
                auto odd = [](const std::string& element) { return (element.back() - '0') % 2 == 1; };
                ring.erase_if(odd);
                std::erase_if(expected, odd);
                break;
            }
            default:
                expected.push_back(std::to_string(++number));
                ring.push_back(expected.back());
                REQUIRE(ring.pop_front() == expected.front());
                expected.pop_front();
        }
        REQUIRE(ring.size() == expected.size());
        REQUIRE(ring.empty() == expected.empty());
        if (expected.empty()) continue;
        REQUIRE(ring.front() == expected.front());
        auto place = random() % expected.size();
        REQUIRE(ring[place] == expected[place]);
    }
}

TEST_CASE("whether somebody else holds a counted value is known") {
    auto mine = ise::counted<std::string>::make("boat");
    CHECK(mine.alone());
    {
        auto yours = mine;
        CHECK_FALSE(mine.alone());
        auto theirs = yours;
        yours = ise::counted<std::string>();
        CHECK_FALSE(mine.alone());
        CHECK(*theirs == "boat");
    }
    CHECK(mine.alone());
    auto moved = std::move(mine);
    CHECK(moved.alone());
    mine = moved;
    CHECK_FALSE(moved.alone());
    CHECK(mine.get() == moved.get());
}

} // namespace ring_test
