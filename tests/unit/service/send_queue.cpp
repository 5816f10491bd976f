#include <ise/subscription/packet_frame.hpp>
#include <ise/subscription/send_queue.hpp>

#include <support/catch.hpp>

#include <vector>

namespace waiting_packets_test {

using ise::send_queue;
namespace packet_frame = ise::packet_frame;

namespace {

ise::shared_bytes frame_of(ise::shared_bytes_maker& maker, std::uint64_t sequence, std::size_t size = 8) {
    auto& room = maker.room();
    std::fill_n(room.grow(packet_frame::head_bytes + size), packet_frame::head_bytes + size,
                static_cast<std::byte>(sequence));
    auto made = maker.share();
    packet_frame::complete(ise::shared_bytes_maker::open(made), made.size(), 7, sequence, {});
    return made;
}

std::vector<std::uint64_t> sequences(const send_queue::stretch& from) {
    std::vector<std::uint64_t> found;
    const auto all = from.frames.view();
    for (std::size_t at = 0; at < all.size(); at += packet_frame::size_of(all.data() + at))
        found.push_back(packet_frame::sequence_of(all.data() + at));
    return found;
}

using order = std::vector<std::uint64_t>;

} // namespace

TEST_CASE("packets that were made one after the other wait as one stretch") {
    ise::shared_bytes_maker maker;
    send_queue waiting;
    for (std::uint64_t sequence = 1; sequence <= 5; ++sequence)
        waiting.push(frame_of(maker, sequence, sequence), 0, true);
    CHECK(waiting.size() == 5);
    CHECK(waiting.front().packets == 5);
    auto first = waiting.pop(2);
    CHECK(sequences(first) == order{1, 2});
    CHECK(first.addressed);
    CHECK(sequences(waiting.pop(std::uint64_t{1} << 32)) == order{3, 4, 5}); // so much credit a peer may give
    CHECK(waiting.empty());
    CHECK(waiting.cost() == 0);
}

TEST_CASE("packets wait in their order, however they lie in memory") {
    ise::shared_bytes_maker maker;
    send_queue waiting;
    auto later = frame_of(maker, 2);
    waiting.push(frame_of(maker, 1), 0, true);
    waiting.push(later, 0, true); // made before, published behind
    waiting.push(frame_of(maker, 3, 100'000), 0, true);
    waiting.push(frame_of(maker, 4), 0, true);
    waiting.push(frame_of(maker, 5), 0, false);
    order taken;
    while (!waiting.empty())
        for (auto sequence : sequences(waiting.pop(100))) taken.push_back(sequence);
    CHECK(taken == order{1, 2, 3, 4, 5});
}

TEST_CASE("a burst beyond any chunk comes out whole and in order") {
    ise::shared_bytes_maker maker;
    send_queue waiting;
    std::uint64_t published = 0, taken = 0;
    for (int round = 0; round < 200; ++round) {
        for (int i = 0; i < 37; ++i) {
            ++published;
            waiting.push(frame_of(maker, published, published % 3000), 0, true);
        }
        for (int i = 0; i < 5; ++i)
            for (auto sequence : sequences(waiting.pop(7))) REQUIRE(sequence == ++taken);
    }
    while (!waiting.empty())
        for (auto sequence : sequences(waiting.pop(100))) REQUIRE(sequence == ++taken);
    CHECK(taken == published);
    CHECK(waiting.cost() == 0);
}

TEST_CASE("what was skipped before a dropped packet stands before the next one") {
    ise::shared_bytes_maker maker;
    send_queue waiting;
    waiting.push(frame_of(maker, 4), 3, true);
    waiting.push(frame_of(maker, 5), 0, true);
    waiting.push(frame_of(maker, 7), 1, true);
    auto dropped = waiting.pop(1);
    CHECK(sequences(dropped) == order{4});
    CHECK(waiting.carry_over(dropped.skipped));
    CHECK(waiting.front().skipped == 3);
    dropped = waiting.pop(1);
    CHECK(waiting.carry_over(dropped.skipped));
    CHECK(waiting.front().skipped == 4);
    dropped = waiting.pop(1);
    CHECK(dropped.skipped == 4);
    CHECK_FALSE(waiting.carry_over(dropped.skipped)); // there is no next one
    CHECK(waiting.empty());
}

TEST_CASE("packets that wait for another session are addressed anew") {
    ise::shared_bytes_maker maker;
    send_queue waiting;
    waiting.push(frame_of(maker, 1), 0, true);
    waiting.readdress();
    waiting.push(frame_of(maker, 2), 0, true);
    CHECK_FALSE(waiting.pop(100).addressed);
    CHECK(waiting.pop(100).addressed);
}

} // namespace waiting_packets_test
