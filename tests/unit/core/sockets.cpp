// Sockets of the real world, on a loop of ISE's own and on an io_context of the program.
#include "sockets.hpp"

#include <support/catch.hpp>

#include <asio/bind_cancellation_slot.hpp>
#include <asio/buffer.hpp>
#include <asio/ip/tcp.hpp>
#include <asio/steady_timer.hpp>

#include <ise/core/real/descriptor.hpp>

#include <fmt/format.h>

#include <atomic>
#include <filesystem>
#include <fstream>

#include <sys/socket.h>
#include <sys/un.h>

namespace sockets_test {

TEST_CASE("sockets: all that is written comes, and then the end, while the other way goes on") {
    for (bool own : {true, false})
        for (bool tcp : kinds()) {
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

namespace {

// Until it is closed, with what was delivered.
task<std::error_code> deliver_all(ise::stream& from, counting_reader& to, ise::loop& on) {
    {
        ise::loop::turn in(on);
        if (!from.deliver_to(to)) throw std::logic_error("this stream delivers nothing");
    }
    auto ended = co_await read_error(from);
    co_return ended;
}

} // namespace

TEST_CASE("sockets: what arrives is delivered whole, then the end, and nothing once the reader has closed") {
    for (bool own : {true, false})
        for (bool tcp : kinds()) {
            INFO(own << tcp);
            place at(own);
            auto two = at.run(connected(at, endpoint_of(tcp)));
            counting_reader whole(*two.far, SIZE_MAX);
            auto& loop = at.host->loop();
            auto ended = ise::async_run(loop.get_executor(), deliver_all(*two.far, whole, loop), asio::use_future);
            at.run(write_all(*two.near, much));
            CHECK(ended.get() == asio::error::operation_aborted); // its reader closed it at the end
            CHECK(whole.come == much);
            CHECK(whole.problem == asio::error::eof);
            CHECK(whole.calls_after_close == 0);
            at.run(drop(two));

            two = at.run(connected(at, endpoint_of(tcp)));
            counting_reader some(*two.far, 5000);
            ended = ise::async_run(loop.get_executor(), deliver_all(*two.far, some, loop), asio::use_future);
            try {
                at.run(write_all(*two.near, much));
            } catch (const std::system_error&) { // the reader has closed meanwhile
            }
            CHECK(ended.get() == asio::error::operation_aborted);
            CHECK(some.come >= 5000);
            CHECK(some.come < 6000);
            CHECK(some.calls_after_close == 0);
            at.run(drop(two));
        }
}

TEST_CASE("sockets: connecting where nobody listens fails") {
    for (bool own : {true, false})
        for (bool tcp : kinds()) {
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
    auto two = at.run(connected(at, endpoint_of(kinds().size() == 1)));
    auto other = at.run(connected(at, endpoint_of(kinds().size() == 1)));
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

TEST_CASE("sockets: whoever waits can be cancelled and go on, and closing ends every wait") {
    for (bool own : {true, false})
        for (bool tcp : kinds()) {
            INFO(own << tcp);
            place at(own);
            auto& loop = at.host->loop();
            auto two = at.run(connected(at, endpoint_of(tcp)));
            auto full = [](ise::stream& to) -> task<> { // until it would have to wait
                const std::string piece(100'000, 'x');
                const asio::const_buffer all(piece.data(), piece.size());
                for (;;) {
                    auto wrote = to.try_write({&all, 1});
                    if (wrote.problem == asio::error::would_block) co_return;
                    if (wrote.problem) throw std::system_error(wrote.problem);
                }
            };
            at.run(full(*two.near));
            auto reading = [](pair& of) -> task<std::error_code> { co_return co_await read_error(*of.near); };
            auto writing = [](pair& of) -> task<std::error_code> { co_return co_await of.near->wait_writable(); };
            auto accepting = [](pair& of) -> task<std::error_code> {
                auto taken = co_await of.ear->accept();
                co_return taken.first;
            };
            using wait = task<std::error_code> (*)(pair&);
            for (wait begin : {wait(reading), wait(writing), wait(accepting)}) {
                auto cancelled = [](ise::loop& on, task<std::error_code> what) -> task<std::error_code> {
                    asio::cancellation_signal enough;
                    std::error_code outcome;
                    bool ended = false;
                    auto note = [&](std::exception_ptr thrown, std::error_code problem) {
                        outcome = thrown ? std::make_error_code(std::errc::io_error) : problem;
                        ended = true;
                    };
                    ise::async_run(on.get_executor(), std::move(what),
                                   asio::bind_cancellation_slot(enough.slot(), note));
                    co_await ise::sleep_for(on, 1ms); // it waits by then
                    enough.emit(asio::cancellation_type::terminal);
                    while (!ended) co_await ise::sleep_for(on, 100us);
                    co_return outcome;
                };
                CHECK(at.run(cancelled(loop, begin(two))) == asio::error::operation_aborted);
            }
            // Nothing is lost by it.
            auto come = ise::async_run(loop.get_executor(), read_all(*two.near), asio::use_future);
            at.run(write_all(*two.far, 1000));
            CHECK(come.get() == 1000);
            std::vector<std::future<std::error_code>> pending;
            for (wait begin : {wait(writing), wait(accepting)})
                pending.push_back(ise::async_run(loop.get_executor(), begin(two), asio::use_future));
            auto shut = [](pair& of) -> task<> {
                of.near->close();
                of.ear->close();
                co_return;
            };
            at.run(shut(two));
            for (auto& one : pending) CHECK(one.get() == asio::error::operation_aborted);
            at.run(drop(two));
        }
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

TEST_CASE("loops: a timer that was due long ago fires, and others go on") {
    for (bool own : {true, false}) {
        place at(own);
        auto& on = at.host->loop();
        std::promise<void> fired, next_fired;
        std::optional<ise::timer> due, next;
        at.in_turn([&] {
            next.emplace(on, [&] { next_fired.set_value(); });
            due.emplace(on, [&] {
                fired.set_value();
                next->arm(on.now() + 1ms);
            });
            due->arm(ise::time_point::min());
        });
        CHECK(fired.get_future().wait_for(10s) == std::future_status::ready);
        CHECK(next_fired.get_future().wait_for(10s) == std::future_status::ready);
        at.in_turn([&] {
            due.reset();
            next.reset();
        });
    }
}

TEST_CASE("sockets: the file of a dead program's socket is replaced, any other file is not") {
    const auto path = std::filesystem::temp_directory_path() / fmt::format("ise-unit-file-{}", ::getpid());
    const auto where = ise::endpoint::parse("local://" + path.string()).value();
    place at(true);
    const auto listen = [&] {
        std::unique_ptr<ise::listener> made;
        ise::result<void> outcome;
        at.in_turn([&] {
            auto got = at.env.listen(at.host->loop(), where);
            if (got) made = std::move(*got);
            else outcome = got.error();
        });
        at.in_turn([&] { made.reset(); });
        return outcome;
    };
    std::ofstream(path) << "all that I have";
    const auto refused = listen();
    REQUIRE_FALSE(refused);
    CHECK(refused.error().message().find("not a socket") != std::string::npos);
    CHECK(std::filesystem::file_size(path) == 15);
    std::filesystem::remove(path);
    {
        ise::real::owned_fd dead(::socket(AF_UNIX, SOCK_STREAM, 0));
        sockaddr_un name{};
        name.sun_family = AF_UNIX;
        path.string().copy(name.sun_path, sizeof name.sun_path - 1);
        REQUIRE(::bind(dead.get(), reinterpret_cast<sockaddr*>(&name), sizeof name) == 0);
    }
    CHECK(listen());
    CHECK_FALSE(std::filesystem::exists(path));
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
