// The ring between two processes: bytes, positions that cannot be, and nobody who sleeps through what came.
#include <ise/transport/shm/byte_ring.hpp>

#include <asio/buffer.hpp>

#include <support/catch.hpp>

#include <array>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace shm_ring_test {

namespace {

using namespace ise::net::shm;

constexpr std::uint32_t size = 64;

struct ring_of_64 {
    ring_state state{};
    std::array<std::byte, size> content{};
    ring_writer writer{state, content.data(), size};
    ring_reader reader{state, content.data(), size};
    bool rings = false;

    std::optional<std::size_t> write(std::string_view text) {
        asio::const_buffer whole(text.data(), text.size());
        return writer.write(std::span(&whole, 1), rings);
    }
    std::optional<std::string> read(std::size_t most) {
        std::string text(most, ' ');
        auto got = reader.read(std::as_writable_bytes(std::span(text)), rings);
        if (!got) return std::nullopt;
        text.resize(*got);
        return text;
    }
};

// Words whose accesses are steps of a schedule: between two of them the other side may do as many as it likes.
class schedule {
public:
    // Runs both, taking the next step from `choices`, and from the first that can where these have ended. Each choice
    // that was made is in `made`, as the side and whether both could.
    void run(const std::vector<int>& choices, std::function<void()> one, std::function<void()> other) {
        made.clear();
        turn_ = -1;
        over_ = {false, false};
        std::array<std::thread, 2> sides{std::thread([&] { side(0, one); }), std::thread([&] { side(1, other); })};
        for (;;) {
            std::unique_lock lock(mutex_);
            changed_.wait(lock, [&] { return turn_ == -1 && (over_[0] || ready_[0]) && (over_[1] || ready_[1]); });
            if (over_[0] && over_[1]) break;
            const bool both = !over_[0] && !over_[1];
            int next = over_[0] ? 1 : 0;
            if (both && made.size() < choices.size()) next = choices[made.size()];
            if (both) made.push_back(next);
            ready_[static_cast<std::size_t>(next)] = false;
            turn_ = next;
            changed_.notify_all();
        }
        for (auto& one_side : sides) one_side.join();
    }
    void step() {
        if (me < 0) return;
        std::unique_lock lock(mutex_);
        ready_[static_cast<std::size_t>(me)] = true;
        if (turn_ == me) turn_ = -1;
        changed_.notify_all();
        changed_.wait(lock, [&] { return turn_ == me; });
    }

    std::vector<int> made;

private:
    void side(int number, const std::function<void()>& work) {
        me = number;
        step();
        work();
        std::lock_guard lock(mutex_);
        over_[static_cast<std::size_t>(number)] = true;
        turn_ = -1;
        changed_.notify_all();
    }

    static thread_local int me;
    std::mutex mutex_;
    std::condition_variable changed_;
    int turn_ = -1; // who may take a step; -1: that is to be chosen
    std::array<bool, 2> ready_{}, over_{};
};
thread_local int schedule::me = -1;

schedule* chosen = nullptr;

struct stepped_word {
    std::uint32_t load(std::memory_order = std::memory_order_seq_cst) const {
        chosen->step();
        return value;
    }
    void store(std::uint32_t to, std::memory_order = std::memory_order_seq_cst) {
        chosen->step();
        value = to;
    }
    std::uint32_t exchange(std::uint32_t to) {
        chosen->step();
        return std::exchange(value, to);
    }
    std::uint32_t value = 0;
};

// All orders of the steps of two sides, each run anew; how many.
template <class Run>
int each_order(Run run) {
    schedule steps;
    chosen = &steps;
    int orders = 0;
    for (std::vector<int> choices;;) {
        run(steps, choices);
        ++orders;
        choices = steps.made;
        while (!choices.empty() && choices.back() == 1) choices.pop_back();
        if (choices.empty()) return orders;
        choices.back() = 1;
    }
}

struct stepped_ring {
    basic_ring_state<stepped_word> state{};
    std::array<std::byte, size> content{};
    basic_ring_writer<stepped_word> writer{state, content.data(), size};
    basic_ring_reader<stepped_word> reader{state, content.data(), size};
};

} // namespace

TEST_CASE("bytes pass a ring in order, around its end and at each length", "[shm]") {
    ring_of_64 ring;
    ring.state.head = ring.state.tail = 0;
    std::string sent, got;
    unsigned char next = 0;
    for (std::size_t round = 0; round < 500; ++round) {
        std::string piece(round % 71, ' ');
        for (auto& letter : piece) letter = static_cast<char>(next++);
        auto took = ring.write(piece).value();
        REQUIRE(took <= piece.size());
        sent += piece.substr(0, took);
        next = static_cast<unsigned char>(next - (piece.size() - took));
        got += ring.read(round % 67).value();
    }
    got += ring.read(size).value();
    REQUIRE(got == sent);
    REQUIRE(sent.size() > 10 * size);
}

TEST_CASE("a full ring takes nothing, and its writer is rung once a good piece is free", "[shm]") {
    ring_of_64 ring;
    REQUIRE(ring.write(std::string(100, 'x')) == 64u);
    REQUIRE(ring.write("y") == 0u);
    REQUIRE(ring.writer.sleep_until_room() == false);
    ring.read(8);
    REQUIRE_FALSE(ring.rings);
    ring.read(8);
    REQUIRE(ring.rings);
    REQUIRE(ring.writer.sleep_until_room() == true);
    SECTION("a limit of unsent bytes leaves it less room") {
        ring.read(size);
        ring.writer.limit(10);
        REQUIRE(ring.write(std::string(100, 'x')) == 10u);
        REQUIRE(ring.write("y") == 0u);
    }
}

TEST_CASE("the end of a ring comes behind its bytes", "[shm]") {
    ring_of_64 ring;
    ring.write("last");
    ring.writer.end();
    REQUIRE_FALSE(ring.reader.ended());
    REQUIRE_FALSE(ring.reader.sleep());
    REQUIRE(ring.read(size) == "last");
    REQUIRE(ring.reader.ended());
}

TEST_CASE("positions that cannot be are refused", "[shm]") {
    ring_of_64 ring;
    ring.write("some");
    const std::uint32_t wild = GENERATE(65u, 1000u, 0x8000'0000u, 0xffff'ffffu);
    SECTION("of the writer") {
        ring.state.head = wild;
        REQUIRE(ring.read(size) == std::nullopt);
    }
    SECTION("of the reader") {
        ring.state.tail = 4 - wild;
        REQUIRE(ring.write(std::string(100, 'x')) == std::nullopt);
        REQUIRE(ring.writer.sleep_until_room() == std::nullopt);
    }
    SECTION("and a side's own position is not read back") {
        ring.state.tail = 4; // "some" is still to come
        REQUIRE(ring.read(size) == "some");
    }
}

TEST_CASE("no order of steps lets a reader sleep over bytes, or a writer over room", "[shm]") {
    bool slept = false, rang = false;
    const int readers = each_order([&](schedule& steps, const std::vector<int>& choices) {
        stepped_ring ring;
        slept = rang = false;
        steps.run(
            choices,
            [&] {
                asio::const_buffer one("x", 1);
                ring.writer.write(std::span(&one, 1), rang);
            },
            [&] { slept = ring.reader.sleep(); });
        REQUIRE((!slept || rang || ring.state.head.value == 0));
        REQUIRE(ring.state.head.value == 1); // so it does not sleep on
    });
    REQUIRE(readers > 10);
    std::optional<bool> room;
    const int writers = each_order([&](schedule& steps, const std::vector<int>& choices) {
        stepped_ring ring;
        std::string all(size, 'x');
        asio::const_buffer whole(all.data(), all.size());
        bool ignored = false;
        ring.writer.write(std::span(&whole, 1), ignored);
        rang = false;
        std::array<std::byte, size> into{};
        steps.run(
            choices, [&] { room = ring.writer.sleep_until_room(); }, [&] { ring.reader.read(into, rang); });
        REQUIRE((room.value() || rang));
    });
    REQUIRE(writers > 10);
}

TEST_CASE("two threads pass a ring's bytes on, and wake each other only when they sleep", "[shm]") {
    // Small, so that either side waits for the other again and again.
    ring_of_64 ring;
    std::mutex mutex;
    std::condition_variable rung;
    int writer_bells = 0, reader_bells = 0;
    auto wake = [&](int& bells) {
        std::lock_guard lock(mutex);
        ++bells;
        rung.notify_all();
    };
    auto wait = [&](int& bells) {
        std::unique_lock lock(mutex);
        rung.wait(lock, [&] { return bells > 0; });
        --bells;
    };
    constexpr std::size_t much = 1'000'000;
    std::thread other([&] {
        std::array<std::byte, 48> piece{};
        for (std::size_t sent = 0; sent < much;) {
            for (std::size_t at = 0; at < piece.size(); ++at) piece[at] = static_cast<std::byte>((sent + at) % 251);
            asio::const_buffer whole(piece.data(), std::min(piece.size(), much - sent));
            bool wakes = false;
            const auto took = ring.writer.write(std::span(&whole, 1), wakes).value();
            if (wakes) wake(reader_bells);
            sent += took;
            if (took == 0)
                while (!ring.writer.sleep_until_room().value()) wait(writer_bells);
        }
        if (ring.writer.end()) wake(reader_bells);
    });
    std::size_t got = 0;
    bool right = true;
    for (std::array<std::byte, 37> into{}; !ring.reader.ended();) {
        bool wakes = false;
        const auto count = ring.reader.read(into, wakes).value();
        if (wakes) wake(writer_bells);
        for (std::size_t at = 0; at < count; ++at)
            right = right && into[at] == static_cast<std::byte>((got + at) % 251);
        got += count;
        if (count == 0 && !ring.reader.ended() && ring.reader.sleep()) wait(reader_bells);
    }
    other.join();
    REQUIRE(right);
    REQUIRE(got == much);
}

} // namespace shm_ring_test
