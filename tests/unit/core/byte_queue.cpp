#include <ise/core/byte_queue.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <deque>
#include <random>

namespace byte_queue_test {

TEST_CASE("a queue of bytes behaves as a queue, whatever is done with it") {
    std::mt19937 random(7);
    ise::byte_queue queue(40'000);
    std::deque<std::byte> expected;
    for (int step = 0; step < 5'000; ++step) {
        ise::bytes piece(random() % (step % 50 == 0 ? 50'000 : 500));
        for (auto& one : piece) one = static_cast<std::byte>(random());
        const auto count = queue.push(piece);
        REQUIRE(count == std::min(piece.size(), 40'000 - expected.size()));
        expected.insert(expected.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(count));
        ise::bytes taken(random() % 3 == 0 ? 50'000 : random() % 500);
        taken.resize(queue.pop(taken));
        REQUIRE(std::equal(taken.begin(), taken.end(), expected.begin()));
        expected.erase(expected.begin(), expected.begin() + static_cast<std::ptrdiff_t>(taken.size()));
        REQUIRE(queue.size() == expected.size());
    }
}

TEST_CASE("a queue of bytes gives back the memory of a burst once it is empty") {
    ise::byte_queue queue(1 << 20);
    ise::bytes burst(200'000), little(100);
    queue.push(burst);
    CHECK(queue.capacity() >= burst.size());
    ise::bytes taken(burst.size() - 1);
    queue.pop(taken);
    CHECK(queue.capacity() >= burst.size()); // not while something is in it
    queue.pop(taken);
    CHECK(queue.empty());
    CHECK(queue.capacity() <= 4096);

    queue.push(burst);
    queue.clear();
    CHECK(queue.capacity() <= 4096);

    for (int i = 0; i < 3; ++i) { // what little there always is costs no new memory
        queue.push(little);
        queue.pop(taken);
        CHECK(queue.capacity() == 1024);
    }
}

} // namespace byte_queue_test
