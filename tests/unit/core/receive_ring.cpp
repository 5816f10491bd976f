// Sockets for which a loop of ISE's own receives by io_uring. Where the system does not offer it, those tests that ask
// for a ring are skipped, and the others hold by epoll.
#include "sockets.hpp"

#include <ise/core/real/socket_stream.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <cstdlib>
#include <deque>
#include <filesystem>

#include <fcntl.h>

#include <linux/io_uring.h>
#include <sys/socket.h>
#include <sys/syscall.h>

namespace sockets_test {
namespace {

bool offered() {
    io_uring_params how{};
    how.flags = IORING_SETUP_SINGLE_ISSUER | IORING_SETUP_DEFER_TASKRUN;
    const ise::real::owned_fd made(static_cast<int>(::syscall(SYS_io_uring_setup, 4, &how)));
    return static_cast<bool>(made);
}

std::size_t rings_here() {
    std::size_t found = 0;
    for (const auto& one : std::filesystem::directory_iterator("/proc/self/fd")) {
        std::error_code gone;
        if (std::filesystem::read_symlink(one.path(), gone).string().find("[io_uring]") != std::string::npos) ++found;
    }
    return found;
}

char pattern(std::size_t at) { return static_cast<char>(at * 31 + at / 251); }

// Checks each byte by its place, and tells how much has come.
struct checking_reader final : ise::stream_reader {
    asio::mutable_buffer room() noexcept override { return asio::buffer(memory); }
    void on_bytes(const ise::transfer& got) override {
        for (std::size_t i = 0; i < got.bytes; ++i) good = good && memory[i] == pattern(come + i);
        come += got.bytes;
        if (!got.problem) return;
        problem = got.problem;
        from->close();
        ended = true;
    }

    ise::stream* from = nullptr;
    std::string memory = std::string(3000, ' ');
    std::atomic<std::size_t> come{0};
    std::atomic<bool> good{true};
    std::error_code problem;
    std::atomic<bool> ended{false};
};

// One end on the loop, which delivers; the other one is the test's.
struct line {
    ise::real::owned_fd far;
    std::unique_ptr<ise::stream> near;
    std::unique_ptr<checking_reader> reader = std::make_unique<checking_reader>();
    std::size_t sent = 0;

    void send(std::size_t count) {
        std::string content(count, ' ');
        for (std::size_t i = 0; i < count; ++i) content[i] = pattern(sent + i);
        for (std::size_t at = 0; at < count;) {
            const auto some = ::send(far.get(), content.data() + at, count - at, MSG_NOSIGNAL);
            REQUIRE(some > 0);
            at += static_cast<std::size_t>(some);
        }
        sent += count;
    }
    // From then on it is received for by the ring.
    void warm_up() {
        for (int message = 0; message < 100; ++message) {
            send(10);
            wait_until_all_came();
        }
    }
    bool all_came() const { return reader->come == sent; }
    void wait_until_all_came() const {
        while (!all_came()) std::this_thread::yield();
        CHECK(reader->good);
    }
    // Reads a byte at the test's end: 0 at the end of the stream, -1 where nothing has come.
    std::ptrdiff_t read_now() const {
        char byte = 0;
        return ::recv(far.get(), &byte, 1, MSG_DONTWAIT);
    }
};

task<line> line_on(ise::loop& on) {
    int ends[2];
    REQUIRE(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) == 0);
    line made;
    made.far.reset(ends[0]);
    ise::real::owned_fd near(ends[1]);
    REQUIRE(::fcntl(near.get(), F_SETFL, O_NONBLOCK) == 0);
    auto [problem, stream] = ise::real::socket_stream::of(on, std::move(near), "the test");
    REQUIRE_FALSE(problem);
    made.near = std::move(stream);
    made.reader->from = made.near.get();
    ise::loop::turn in(on);
    made.near->deliver_to(*made.reader);
    co_return made;
}

task<> drop(line& what) {
    what.near.reset();
    co_return;
}

// Blocks the loop until the test lets it go on.
class held_loop {
public:
    explicit held_loop(ise::loop& on) {
        std::promise<void> holds;
        asio::post(on.get_executor(), [until = go_on_.get_future().share(), &holds] {
            holds.set_value();
            until.wait();
        });
        holds.get_future().wait();
    }
    ~held_loop() { go_on_.set_value(); }

private:
    std::promise<void> go_on_;
};

} // namespace

TEST_CASE("receiving: a loop has a ring where the system offers one, once a socket has delivered some short messages") {
    if (!offered()) {
        ise_test::skip("this system does not offer io_uring to this process");
        return;
    }
    const auto before = rings_here();
    {
        place at(true);
        CHECK(rings_here() == before);
        auto one = at.run(line_on(at.host->loop()));
        CHECK(rings_here() == before);
        one.warm_up();
        CHECK(rings_here() == before + 1);
        auto other = at.run(line_on(at.host->loop()));
        other.warm_up();
        CHECK(rings_here() == before + 1);
        at.run(drop(one));
        at.run(drop(other));
    }
    CHECK(rings_here() == before);
}

TEST_CASE("receiving: a socket that brings datagrams one at a time is received for by the ring") {
    if (!offered()) {
        ise_test::skip("this system does not offer io_uring to this process");
        return;
    }
    struct counter final : ise::datagram_reader {
        void on_datagram(const ise::endpoint&, ise::bytes_view) override { ++come; }
        void on_problem(const std::error_code&) override {}
        std::atomic<std::size_t> come{0};
    } reader;
    const auto before = rings_here();
    place at(true);
    std::unique_ptr<ise::datagram_socket> socket;
    at.in_turn([&] {
        socket = at.env.open_datagram(at.host->loop(), ise::endpoint::parse("udp://127.0.0.1:0").value()).value();
        socket->deliver_to(reader, 1200);
    });
    for (std::size_t sent = 1; sent <= 100; ++sent) {
        if (sent != 65) CHECK(rings_here() == before + (sent > 65 ? 1 : 0)); // between the two it is made
        REQUIRE_FALSE(socket->try_send(socket->where(), ise::as_bytes("to itself")));
        while (reader.come < sent) std::this_thread::yield();
    }
    at.in_turn([&] { socket.reset(); });
}

TEST_CASE("receiving: a program under Valgrind has no ring, with which its threads would wait for each other") {
    ::setenv("LD_PRELOAD", "/usr/libexec/valgrind/vgpreload_core-amd64-linux.so", 1);
    const auto before = rings_here();
    {
        place at(true);
        auto one = at.run(line_on(at.host->loop()));
        one.warm_up();
        CHECK(rings_here() == before);
        at.run(drop(one));
    }
    ::unsetenv("LD_PRELOAD");
}

TEST_CASE("receiving: short and long messages come whole and in order, whichever way they are received") {
    place at(true);
    auto one = at.run(line_on(at.host->loop()));
    for (std::size_t round = 0; round < 4; ++round) {
        for (std::size_t message = 0; message < 150; ++message) { // enough to be received by the ring again
            one.send(1 + message % 90);
            one.wait_until_all_came();
        }
        for (std::size_t size : {4'000u, 16'384u, 16'383u, 16'385u, 100'000u, 1'000'000u}) one.send(size);
        one.wait_until_all_came();
    }
    one.far.reset();
    while (!one.reader->ended) std::this_thread::yield();
    CHECK(one.reader->problem == asio::error::eof);
    CHECK(one.all_came());
    at.run(drop(one));
}

TEST_CASE("receiving: more sockets at once than a ring has memory for all get what was sent") {
    constexpr std::size_t many = 40;
    place at(true);
    std::deque<line> all;
    for (std::size_t i = 0; i < many; ++i) {
        all.push_back(at.run(line_on(at.host->loop())));
        all.back().warm_up();
    }
    for (std::size_t round = 0; round < 200; ++round) {
        {
            held_loop until(at.host->loop());
            for (auto& one : all) one.send(1 + round % 50);
        }
        for (auto& one : all) one.wait_until_all_came();
    }
    for (auto& one : all) at.run(drop(one));
}

TEST_CASE("receiving: sockets get what was sent while the loop has mostly other things to do") {
    place at(true);
    auto one = at.run(line_on(at.host->loop()));
    for (int round = 0; round < 3; ++round) {
        one.warm_up();
        for (int other = 0; other < 200; ++other) { // events of epoll only
            std::promise<void> done;
            asio::post(at.host->loop().get_executor(), [&] { done.set_value(); });
            done.get_future().wait();
        }
        one.send(10'000);
        one.wait_until_all_came();
    }
    at.run(drop(one));
}

TEST_CASE("receiving: what came while the loop stood still is delivered before the timers that are due") {
    place at(true);
    auto& on = at.host->loop();
    auto one = at.run(line_on(on));
    one.warm_up();
    std::promise<bool> had_come;
    ise::timer due(on, [&] { had_come.set_value(one.all_came()); });
    ise::time_point when;
    at.in_turn([&] {
        when = on.now() + 20ms;
        due.arm(when);
    });
    {
        held_loop until(on);
        one.send(20);
        while (at.env.now() <= when) std::this_thread::yield();
    }
    CHECK(had_come.get_future().get());
    at.run(drop(one));
}

TEST_CASE("receiving: a socket that is closed is let go of at once, however long the loop is busy then") {
    place at(true);
    auto one = at.run(line_on(at.host->loop()));
    one.warm_up();
    std::promise<std::ptrdiff_t> seen;
    asio::post(at.host->loop().get_executor(), [&] {
        one.near->close();
        seen.set_value(one.read_now()); // within the same turn
    });
    CHECK(seen.get_future().get() == 0);
    at.run(drop(one));
}

TEST_CASE("receiving: a loop that ends lets go of its sockets at once") {
    auto at = std::make_unique<place>(true);
    auto one = at->run(line_on(at->host->loop()));
    one.warm_up();
    at->host->end();
    one.near.reset();
    CHECK(one.read_now() == 0);
}

TEST_CASE("receiving: a reader that closes at some byte gets nothing more, also of what came already") {
    for (std::size_t most : {1u, 100u, 5'000u, 40'000u}) {
        place at(true);
        auto one = at.run(line_on(at.host->loop()));
        one.warm_up();
        counting_reader leaving(*one.near, most);
        at.in_turn([&] { one.near->deliver_to(leaving); });
        {
            held_loop until(at.host->loop());
            one.send(60'000);
        }
        while (!leaving.from_closed) std::this_thread::yield();
        at.run(drop(one));
        CHECK(leaving.come >= most);
        CHECK(leaving.come < most + 3000);
        CHECK(leaving.calls_after_close == 0);
    }
}

TEST_CASE("receiving: a socket that is full is written to when there is room, and goes on receiving") {
    place at(true);
    auto one = at.run(line_on(at.host->loop()));
    one.warm_up();
    auto written = ise::async_run(at.host->loop().get_executor(), write_all(*one.near, much), asio::use_future);
    std::string room(100'000, ' ');
    std::size_t come = 0;
    for (std::size_t reads = 0; come < much; ++reads) {
        const auto got = ::recv(one.far.get(), room.data(), room.size(), 0);
        REQUIRE(got > 0);
        come += static_cast<std::size_t>(got);
        if (reads % 3 == 0) one.send(20);
    }
    written.get();
    one.wait_until_all_came();
    one.send(20);
    one.wait_until_all_came();
    at.run(drop(one));
}

} // namespace sockets_test
