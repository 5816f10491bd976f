// Datagrams of real sockets that are delivered to a reader: on a loop of ISE's own, where they are received for by
// io_uring after some, and on an io_context of the program.
#include "sockets.hpp"

#include <support/catch.hpp>

#include <algorithm>
#include <mutex>

namespace sockets_test {
namespace {

constexpr std::size_t max_bytes = 1200;

struct collecting_reader final : ise::datagram_reader {
    void on_datagram(const ise::endpoint& from, ise::bytes_view content) override {
        std::lock_guard lock(mutex);
        come.push_back({from, {content.begin(), content.end()}});
        count = come.size();
        if (come.size() == close_at) socket->close();
    }
    void on_problem(const std::error_code& why) override {
        std::lock_guard lock(mutex);
        problem = why;
    }

    ise::datagram_socket* socket = nullptr;
    std::size_t close_at = 0;
    std::mutex mutex;
    std::vector<ise::datagram> come;
    std::error_code problem;
    std::atomic<std::size_t> count{0};
};

const auto here = ise::endpoint::parse("udp://127.0.0.1:0").value();

task<std::unique_ptr<ise::datagram_socket>> opened(place& at) {
    co_return std::move(at.env.open_datagram(at.host->loop(), here)).value();
}

task<> drop(std::unique_ptr<ise::datagram_socket>& what) {
    what.reset();
    co_return;
}

// A socket that delivers, and one that sends to it from the test's thread.
struct pigeonry {
    explicit pigeonry(bool own) : at(own), to(at.run(opened(at))), from(at.run(opened(at))) {
        reader.socket = to.get();
        at.in_turn([&] { to->deliver_to(reader, max_bytes); });
    }
    ~pigeonry() {
        at.run(drop(to));
        at.run(drop(from));
    }

    void send(std::size_t size) {
        ise::bytes content(size);
        for (std::size_t i = 0; i < size; ++i) content[i] = static_cast<std::byte>(size + i);
        while (auto full = from->try_send(to->where(), content)) REQUIRE(full == asio::error::would_block);
    }
    void wait_for(std::size_t count) const {
        while (reader.count < count) std::this_thread::yield();
    }
    void check_sizes(const std::vector<std::size_t>& sizes) {
        std::lock_guard lock(reader.mutex);
        REQUIRE(reader.come.size() == sizes.size());
        for (std::size_t place = 0; place < sizes.size(); ++place) {
            const auto& one = reader.come[place];
            CHECK(one.peer == from->where());
            REQUIRE(one.content.size() == sizes[place]);
            for (std::size_t i = 0; i < sizes[place]; ++i)
                REQUIRE(one.content[i] == static_cast<std::byte>(sizes[place] + i));
        }
        CHECK_FALSE(reader.problem);
    }

    place at;
    collecting_reader reader;
    std::unique_ptr<ise::datagram_socket> to, from;
};

} // namespace

TEST_CASE("datagrams: each is delivered whole with its sender, one at a time and in bursts") {
    for (bool own : {true, false}) {
        pigeonry line(own);
        std::vector<std::size_t> sizes;
        for (int round = 0; round < 3; ++round) {
            for (std::size_t single = 0; single < 150; ++single) { // enough to be received for by io_uring
                sizes.push_back(single * 7 % (max_bytes + 1));
                line.send(sizes.back());
                line.wait_for(sizes.size());
            }
            for (std::size_t burst = 0; burst < 60; ++burst) { // more than a ring has memory for
                sizes.push_back(1 + burst);
                line.send(sizes.back());
            }
            line.wait_for(sizes.size());
        }
        line.check_sizes(sizes);
    }
}

TEST_CASE("datagrams: longer ones than the reader takes are dropped, and those behind them arrive") {
    for (bool own : {true, false}) {
        pigeonry line(own);
        std::vector<std::size_t> sizes;
        for (int round = 0; round < 2; ++round) {
            for (std::size_t longer : {max_bytes + 1, std::size_t{16'000}, std::size_t{16'384}, std::size_t{65'000}}) {
                line.send(longer);
                sizes.push_back(max_bytes);
                line.send(sizes.back());
                line.wait_for(sizes.size());
            }
            for (std::size_t single = 0; single < 100; ++single) {
                sizes.push_back(single);
                line.send(sizes.back());
                line.wait_for(sizes.size());
            }
        }
        line.check_sizes(sizes);
    }
}

TEST_CASE("datagrams: a reader that closes its socket gets nothing more, also of what came already") {
    for (bool own : {true, false}) {
        for (std::size_t singles : {0u, 100u}) {
            pigeonry line(own);
            for (std::size_t single = 1; single <= singles; ++single) {
                line.send(single);
                line.wait_for(single);
            }
            line.reader.close_at = singles + 3;
            for (int burst = 0; burst < 8; ++burst) line.send(10);
            line.wait_for(singles + 3);
            line.at.run(drop(line.to));
            CHECK(line.reader.count == singles + 3);
        }
    }
}

} // namespace sockets_test
