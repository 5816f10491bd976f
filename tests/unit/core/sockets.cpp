// Sockets of the real world, on a loop of ISE's own and on an io_context of the program.
#include <ise/asio.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/core/sleep.hpp>

#include <support/catch.hpp>

#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <asio/use_future.hpp>

#include <atomic>
#include <future>
#include <optional>
#include <string>
#include <thread>

#include <unistd.h>

namespace sockets_test {

using namespace std::chrono_literals;
using ise::task;

namespace {

constexpr std::size_t much = 16 << 20; // more than the system holds

// A loop of either kind; what is made on it goes before it.
struct place {
    explicit place(bool own) {
        if (own) {
            host = env.make_loop("sockets");
            return;
        }
        host = env.adopt(io.get_executor(), true);
        thread = std::thread([this] { io.run(); });
    }
    ~place() {
        if (!thread.joinable()) {
            host->end();
            return;
        }
        std::promise<void> ended;
        asio::post(io, [&] {
            host->end();
            ended.set_value();
        });
        ended.get_future().wait();
        work.reset();
        io.stop();
        thread.join();
    }
    template <class T>
    T run(task<T> what) {
        return ise::async_run(host->loop().get_executor(), std::move(what), asio::use_future).get();
    }

    ise::real_environment env;
    asio::io_context io{1};
    std::optional<asio::executor_work_guard<asio::io_context::executor_type>> work{io.get_executor()};
    std::unique_ptr<ise::loop_host> host;
    std::thread thread;
};

struct pair {
    std::unique_ptr<ise::listener> ear;
    std::unique_ptr<ise::stream> near, far;
};

task<pair> connected(place& at, ise::endpoint where) {
    pair made;
    made.ear = at.env.listen(at.host->loop(), where).value();
    auto line = co_await at.env.connect(at.host->loop(), made.ear->where());
    made.near = std::move(line).value();
    auto [problem, stranger] = co_await made.ear->accept();
    if (problem) throw std::system_error(problem);
    made.far = std::move(stranger);
    co_return made;
}

ise::endpoint endpoint_of(bool tcp) {
    static int count = 0;
    auto name = "local://@ise-sockets-" + std::to_string(::getpid()) + "-" + std::to_string(count++);
    return ise::endpoint::parse(tcp ? "tcp://127.0.0.1:0" : name).value();
}

task<> write_all(ise::stream& to, std::size_t left) {
    const std::string piece(100'000, 'x');
    while (left > 0) {
        const asio::const_buffer rest(piece.data(), std::min(left, piece.size()));
        const auto wrote = to.try_write({&rest, 1});
        left -= wrote.bytes;
        if (wrote.problem == asio::error::would_block) {
            auto problem = co_await to.wait_writable();
            if (problem) throw std::system_error(problem);
        } else if (wrote.problem) {
            throw std::system_error(wrote.problem);
        }
    }
    to.shutdown_write();
}

// How much came before the end.
task<std::size_t> read_all(ise::stream& from) {
    std::string room(4096, ' ');
    std::size_t come = 0;
    for (;;) {
        auto got = co_await from.read_some(asio::buffer(room));
        come += got.bytes;
        if (got.problem == asio::error::eof) co_return come;
        if (got.problem) throw std::system_error(got.problem);
    }
}

task<std::error_code> read_error(ise::stream& from) {
    std::string room(16, ' ');
    auto got = co_await from.read_some(asio::buffer(room));
    co_return got.problem;
}

task<> close(ise::stream& what) {
    what.close();
    co_return;
}

task<> drop(pair& what) {
    what = {};
    co_return;
}

} // namespace

TEST_CASE("sockets: all that is written comes, and then the end, while the other way goes on") {
    for (bool own : {true, false})
        for (bool tcp : {true, false}) {
            INFO(own << tcp);
            place at(own);
            auto two = at.run(connected(at, endpoint_of(tcp)));
            auto executor = at.host->loop().get_executor();
            auto come = ise::async_run(executor, read_all(*two.far), asio::use_future);
            auto back = ise::async_run(executor, read_all(*two.near), asio::use_future);
            at.run(write_all(*two.near, much));
            CHECK(come.get() == much); // near is shut for writing, and still read
            at.run(write_all(*two.far, much));
            CHECK(back.get() == much);
            at.run(drop(two));
        }
}

TEST_CASE("sockets: closing ends a read that waits, and so does the peer's end") {
    for (bool own : {true, false}) {
        place at(own);
        auto two = at.run(connected(at, endpoint_of(true)));
        auto executor = at.host->loop().get_executor();
        auto mine = ise::async_run(executor, read_error(*two.near), asio::use_future);
        auto yours = ise::async_run(executor, read_error(*two.far), asio::use_future);
        at.run(close(*two.near));
        CHECK(mine.get() == asio::error::operation_aborted);
        CHECK(yours.get() == asio::error::eof);
        CHECK(at.run(read_error(*two.near)) == asio::error::operation_aborted);
        at.run(drop(two));
    }
}

TEST_CASE("sockets: connecting where nobody listens fails") {
    for (bool own : {true, false})
        for (bool tcp : {true, false}) {
            place at(own);
            auto two = at.run(connected(at, endpoint_of(tcp)));
            auto where = two.ear->where();
            at.run(drop(two));
            auto line = at.run(at.env.connect(at.host->loop(), where));
            REQUIRE_FALSE(line);
            CHECK(line.error().code() == ise::errc::unreachable);
        }
}

TEST_CASE("sockets: a peer that sends without a pause does not keep others of the loop from their turn") {
    place at(true);
    auto two = at.run(connected(at, endpoint_of(false)));
    auto other = at.run(connected(at, endpoint_of(false)));
    auto executor = at.host->loop().get_executor();
    std::atomic<bool> enough{false};
    auto endless = [](ise::stream& from) -> task<> {
        std::string room(64, ' ');
        for (;;) {
            auto got = co_await from.read_some(asio::buffer(room));
            if (got.problem) co_return;
        }
    };
    auto reads = ise::async_run(executor, endless(*two.far), asio::use_future);
    // From a thread of its own, as signs of life are.
    std::thread flood([&] {
        const std::string piece(65536, 'x');
        const asio::const_buffer all(piece.data(), piece.size());
        while (!enough) static_cast<void>(two.near->try_write({&all, 1}));
    });
    auto come = ise::async_run(executor, read_all(*other.far), asio::use_future);
    at.run(write_all(*other.near, 1'000'000));
    CHECK(come.get() == 1'000'000);
    enough = true;
    flood.join();
    at.run(drop(two));
    reads.get();
    at.run(drop(other));
}

TEST_CASE("loops: objects of Asio on a loop of ISE's own complete on its thread") {
    place at(true);
    auto& loop = at.host->loop();
    auto waits = [](ise::loop& on) -> task<bool> {
        asio::steady_timer first(on.get_executor(), 1ms);
        co_await first.async_wait(ise::use_task);
        const bool here = on.running_here();
        co_await ise::sleep_for(on, 1ms);
        co_return here&& on.running_here();
    };
    CHECK(at.run(waits(loop)));
    // One that never ends is destroyed with the loop.
    auto for_ever = [](ise::loop& on, std::shared_ptr<int> held) -> task<> {
        asio::steady_timer long_one(on.get_executor(), 24h);
        co_await long_one.async_wait(ise::use_task);
        static_cast<void>(held);
    };
    auto held = std::make_shared<int>();
    ise::async_run(loop.get_executor(), for_ever(loop, held), [](std::exception_ptr) {});
    CHECK(at.run(waits(loop)));
    at.host->end();
    CHECK(held.use_count() == 1);
}

TEST_CASE("loops: what other threads post runs once, or is dropped by a loop that ends") {
    place at(true);
    auto gate = at.host->loop().gate();
    std::atomic<int> ran{0}, accepted{0};
    auto held = std::make_shared<int>();
    std::vector<std::thread> posters;
    for (int each = 0; each < 2; ++each)
        posters.emplace_back([&] {
            for (int n = 0; n < 20'000; ++n) accepted += gate->post([&ran, held] { ++ran; });
        });
    while (ran < 1000) std::this_thread::yield();
    at.host->end();
    for (auto& poster : posters) poster.join();
    CHECK(ran <= accepted);
    CHECK_FALSE(gate->post([] {}));
    CHECK(held.use_count() == 1);
}

} // namespace sockets_test
