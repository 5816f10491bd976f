// Coroutines of ISE and of Asio: each started from, awaited in, cancelled by and destroyed with the other.
#include <ise/asio.hpp>
#include <ise/core/asio_compat.hpp>
#include <ise/core/task_scope.hpp>

#include <asio/awaitable.hpp>
#include <asio/bind_cancellation_slot.hpp>
#include <asio/buffer.hpp>
#include <asio/cancellation_signal.hpp>
#include <asio/co_spawn.hpp>
#include <asio/detached.hpp>
#include <asio/io_context.hpp>
#include <asio/ip/tcp.hpp>
#include <asio/post.hpp>
#include <asio/read.hpp>
#include <asio/steady_timer.hpp>
#include <asio/use_awaitable.hpp>
#include <asio/use_future.hpp>
#include <asio/write.hpp>

#include <support/catch.hpp>

#include <array>
#include <chrono>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

namespace tasks_test {

using namespace std::chrono_literals;
using asio::ip::tcp;
using ise::task;
using ise::use_task;

namespace {

struct counted { // how many frames live
    int& alive;
    explicit counted(int& of) : alive(of) { ++alive; }
    counted(const counted&) = delete;
    ~counted() { --alive; }
};

void connect_pair(tcp::socket& near, tcp::socket& far) {
    tcp::acceptor ear(near.get_executor(), tcp::endpoint(asio::ip::address_v4::loopback(), 0));
    far.connect(ear.local_endpoint());
    near = ear.accept();
}

struct pair {
    asio::io_context io;
    tcp::socket near{io}, far{io};
    pair() { connect_pair(near, far); }
};

task<std::string> read_text(tcp::socket& from, std::size_t count) {
    std::string text(count, '\0');
    co_await asio::async_read(from, asio::buffer(text), use_task);
    co_return text;
}

asio::awaitable<std::string> read_as_asio(tcp::socket& from, std::size_t count) {
    std::string text(count, '\0');
    co_await asio::async_read(from, asio::buffer(text), asio::use_awaitable);
    co_return text;
}

bool is_aborted(const std::exception_ptr& thrown) { return thrown && ise::is_cancellation(thrown); }

} // namespace

TEST_CASE("a task awaits operations of Asio: values, errors thrown, errors as values") {
    pair at;
    std::string heard;
    std::error_code thrown, given;
    std::size_t first = 0;
    auto body = [&]() -> task<> {
        first = co_await at.near.async_write_some(asio::buffer("ahoy", 4), use_task);
        heard = co_await read_text(at.far, 4);
        at.near.close();
        try {
            co_await read_text(at.far, 1);
        } catch (const std::system_error& end) {
            thrown = end.code();
        }
        std::array<char, 1> room{};
        auto [problem, count] = co_await at.far.async_read_some(asio::buffer(room), ise::compat::as_tuple);
        given = problem;
        CHECK(count == 0);
    };
    ise::async_run(at.io.get_executor(), body(), asio::detached);
    at.io.run();
    CHECK(first == 4);
    CHECK(heard == "ahoy");
    CHECK(thrown == asio::error::eof);
    CHECK(given == asio::error::eof);
}

TEST_CASE("a task awaits a coroutine of Asio, with its value and its exception") {
    pair at;
    std::string heard, said;
    auto failing = []() -> asio::awaitable<int> {
        throw std::runtime_error("no wind");
        co_return 1;
    };
    auto body = [&]() -> task<> {
        co_await asio::async_write(at.near, asio::buffer("ahoy", 4), use_task);
        heard = co_await read_as_asio(at.far, 4);
        try {
            co_await failing();
        } catch (const std::runtime_error& why) {
            said = why.what();
        }
    };
    ise::async_run(at.io.get_executor(), body(), asio::detached);
    at.io.run();
    CHECK(heard == "ahoy");
    CHECK(said == "no wind");
}

TEST_CASE("a task is started from Asio with a callback, a future, and in an awaitable") {
    asio::io_context io;
    auto answer = [](int n) -> task<int> {
        co_await asio::post(use_task);
        if (n < 0) throw std::runtime_error("negative");
        co_return n + 1;
    };
    std::exception_ptr thrown;
    int called = 0;
    ise::async_run(io.get_executor(), answer(1), [&](std::exception_ptr why, int got) {
        thrown = why;
        called = got;
    });
    auto soon = ise::async_run(io.get_executor(), answer(2), asio::use_future);
    auto never = ise::async_run(io.get_executor(), answer(-1), asio::use_future);
    int awaited = 0;
    auto plain = [&]() -> asio::awaitable<void> {
        auto on = co_await asio::this_coro::executor;
        auto asked = answer(3);
        awaited = co_await ise::async_run(on, std::move(asked), asio::use_awaitable);
    };
    asio::co_spawn(io, plain(), asio::detached);
    io.run();
    CHECK(!thrown);
    CHECK(called == 2);
    CHECK(soon.get() == 3);
    CHECK_THROWS_AS(never.get(), std::runtime_error);
    CHECK(awaited == 4);
}

TEST_CASE("cancelling what waits for a task cancels the operation of Asio, or the awaitable, that it awaits") {
    pair at;
    auto through_asio = GENERATE(false, true);
    asio::cancellation_signal stop;
    std::exception_ptr thrown;
    bool over = false;
    auto body = [&]() -> task<> {
        if (through_asio) co_await read_as_asio(at.near, 1);
        else co_await read_text(at.near, 1);
    };
    ise::async_run(at.io.get_executor(), body(), asio::bind_cancellation_slot(stop.slot(), [&](std::exception_ptr why) {
                       thrown = why;
                       over = true;
                   }));
    at.io.poll();
    CHECK_FALSE(over);
    stop.emit(asio::cancellation_type::total); // only ends what can go on as if nothing had happened: not passed on
    at.io.poll();
    CHECK_FALSE(over);
    stop.emit(asio::cancellation_type::terminal);
    at.io.run();
    CHECK(over);
    CHECK(is_aborted(thrown));
}

TEST_CASE("cancelling a coroutine of Asio cancels the task that it awaits") {
    pair at;
    asio::cancellation_signal stop;
    std::exception_ptr seen_inside, thrown;
    auto inside = [&]() -> task<> {
        try {
            co_await read_text(at.near, 1);
        } catch (...) {
            seen_inside = std::current_exception();
            throw;
        }
    };
    auto plain = [&]() -> asio::awaitable<void> {
        auto on = co_await asio::this_coro::executor;
        co_await ise::async_run(on, inside(), asio::use_awaitable);
    };
    asio::co_spawn(at.io, plain(),
                   asio::bind_cancellation_slot(stop.slot(), [&](std::exception_ptr why) { thrown = why; }));
    at.io.poll();
    stop.emit(asio::cancellation_type::terminal);
    at.io.run();
    CHECK(is_aborted(seen_inside));
    CHECK(is_aborted(thrown));
}

TEST_CASE("a cancelled task throws at every co_await, until it forgets the cancellation") {
    asio::io_context io;
    asio::cancellation_signal stop;
    std::string steps;
    auto body = [&]() -> task<> {
        asio::steady_timer never(io, asio::steady_timer::time_point::max());
        for (int n = 0; n < 2; ++n) {
            try {
                co_await never.async_wait(use_task);
                steps += "waited ";
            } catch (const std::system_error& why) {
                steps += why.code() == asio::error::operation_aborted ? "aborted " : "? ";
            }
        }
        bool cancelled = co_await ise::this_task::cancelled;
        steps += cancelled ? "cancelled " : "not cancelled ";
        co_await ise::this_task::forget_cancellation;
        co_await asio::post(io, use_task);
        steps += "posted ";
        co_await ise::this_task::ignore_cancellation;
        stop.emit(asio::cancellation_type::terminal);
        co_await asio::post(io, use_task);
        steps += "posted";
    };
    ise::async_run(io.get_executor(), body(), asio::bind_cancellation_slot(stop.slot(), asio::detached));
    io.poll();
    stop.emit(asio::cancellation_type::terminal);
    io.run();
    CHECK(steps == "aborted aborted cancelled posted posted");
}

TEST_CASE("wherever a task is when its io_context goes, all its coroutines are destroyed, and nothing is resumed") {
    for (int steps = 0; steps < 40; ++steps) {
        int alive = 0;
        bool ended = false;
        {
            asio::io_context io;
            tcp::socket near(io), far(io);
            connect_pair(near, far);
            auto inner = [&](int n) -> task<int> {
                counted frame(alive);
                co_await asio::post(io, use_task);
                co_await asio::async_write(near, asio::buffer("x", 1), use_task);
                auto text = co_await read_as_asio(far, 1);
                co_return n + static_cast<int>(text.size());
            };
            auto plain = [&]() -> asio::awaitable<void> {
                counted frame(alive);
                co_await asio::post(asio::use_awaitable);
                co_await ise::async_run(io.get_executor(), inner(1), asio::use_awaitable);
            };
            auto outer = [&]() -> task<> {
                counted frame(alive);
                int n = 0;
                while (n < 4) n = co_await inner(n);
                co_await plain();
                ended = true;
                co_await read_text(far, 1); // for ever
            };
            ise::async_run(io.get_executor(), outer(), asio::detached);
            for (int n = 0; n < steps && io.poll_one() > 0; ++n) {}
            if (steps > 0) CHECK(alive > 0);
        }
        CHECK(alive == 0);
        if (steps == 39) CHECK(ended);
    }
}

TEST_CASE("a task that never began is only freed") {
    int alive = 0;
    bool began = false;
    {
        auto held = std::make_unique<counted>(alive);
        auto body = [](std::unique_ptr<counted>, bool& into) -> task<> {
            into = true;
            co_return;
        };
        auto made = body(std::move(held), began);
        CHECK(made);
        CHECK(alive == 1);
    }
    CHECK(alive == 0);
    CHECK_FALSE(began);
}

TEST_CASE("a million awaits that never suspend take no more of the thread's stack than one") {
    asio::io_context io;
    auto one = [](long n) -> task<long> { co_return n + 1; };
    auto body = [&]() -> task<long> {
        long n = 0;
        while (n < 1'000'000) n = co_await one(n);
        co_return n;
    };
    auto counted_up = ise::async_run(io.get_executor(), body(), asio::use_future);
    io.run();
    CHECK(counted_up.get() == 1'000'000);
}

TEST_CASE("an operation that completes before it has begun to wait lets the task go on, or drops it") {
    asio::io_context io;
    auto drops = GENERATE(false, true);
    int alive = 0;
    bool ended = false;
    auto at_once = [drops](auto handler) {
        if (!drops) std::move(handler)(7);
    };
    auto body = [&]() -> task<> {
        counted frame(alive);
        int got = co_await asio::async_initiate<const ise::use_task_t, void(int)>(at_once, use_task);
        CHECK(got == 7);
        ended = true;
    };
    ise::async_run(io.get_executor(), body(), asio::detached);
    io.run();
    CHECK(alive == 0);
    CHECK(ended != drops);
}

} // namespace tasks_test
