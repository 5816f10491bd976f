// What waits on a loop, on one thread that the test drives.
#include "inproc_threads.hpp"

#include <ise/asio.hpp>
#include <ise/core/inproc_stream.hpp>
#include <ise/core/loop_executor.hpp>
#include <ise/core/object_stream.hpp>
#include <ise/core/waiter.hpp>

#include <asio/bind_cancellation_slot.hpp>
#include <asio/buffer.hpp>

#include <chrono>
#include <future>
#include <thread>

#include <support/catch.hpp>

namespace inproc_loop_test {

using namespace threads;
using ise::task;

namespace {

struct driven {
    bare_environment env;
    asio::io_context io;
    asio::executor_work_guard<asio::io_context::executor_type> open{io.get_executor()};
    std::unique_ptr<ise::loop> loop = std::make_unique<ise::loop>(env, io.get_executor(), [] { return true; });
    ~driven() {
        loop->abandon();
        io.poll();
    }
};

// Runs what is posted on another thread, before `post` returns: as where a woken thread takes over the poster's core.
struct eager_queue final : ise::loop_queue {
    asio::io_context unused;
    std::thread runner;
    bool ran_at_once = false;
    ~eager_queue() {
        if (runner.joinable()) runner.join();
    }
    void post(work what) override {
        std::promise<void> over;
        auto done = over.get_future();
        runner = std::thread([run = std::move(what), ended = std::move(over)]() mutable {
            run();
            ended.set_value();
        });
        ran_at_once = done.wait_for(std::chrono::seconds(10)) == std::future_status::ready;
    }
    bool running_here() const noexcept override { return false; }
    asio::execution_context& objects() override { return unused; }
};

struct witness { // notes that its frame was unwound
    bool& gone;
    ~witness() { gone = true; }
};

task<> wait_forever(ise::loop& on, bool& gone, bool& resumed) {
    ise::waiter<> never(on);
    witness frame{gone};
    co_await never.wait();
    resumed = true;
}

struct output final : ise::flushable {
    std::function<void()> act;
    explicit output(std::function<void()> what) : act(std::move(what)) {}
    void flush() override { act(); }
};

struct taker final : ise::object_stream::user {
    std::string got;
    std::function<void()> meanwhile = [] {};
    void on_passed(ise::buffer& content, ise::ring<ise::passed_object>&) override {
        got += ise::as_text(content.view());
        meanwhile();
        got += '|';
    }
};

task<> read_once(ise::stream& from, ise::transfer& got, std::array<char, 8>& room) {
    got = co_await from.read_some(asio::buffer(room));
}

} // namespace

TEST_CASE("a timer that moves itself to a time that has passed fires in a later turn each time") {
    driven one;
    std::vector<std::string> log;
    int left = 3;
    ise::timer* self = nullptr;
    ise::timer again(*one.loop, [&] {
        log.push_back("fired");
        one.loop->later([&] { log.push_back("end of turn"); });
        if (--left > 0) self->arm(one.env.now() - std::chrono::seconds(1));
    });
    self = &again;
    again.arm(one.env.now() - std::chrono::seconds(1));
    while (again.armed()) one.loop->on_alarm();
    CHECK(log == std::vector<std::string>{"fired", "end of turn", "fired", "end of turn", "fired", "end of turn"});
}

TEST_CASE("abandoning a loop unwinds what waits there without resuming it") {
    driven one;
    bool gone = false, resumed = false;
    ise::async_run(one.io.get_executor(), wait_forever(*one.loop, gone, resumed), asio::detached);
    one.io.poll();
    REQUIRE_FALSE(gone);
    one.loop->abandon();
    one.io.poll();
    CHECK(gone);
    CHECK_FALSE(resumed);

    gone = false; // what comes to wait later is unwound too
    ise::async_run(one.io.get_executor(), wait_forever(*one.loop, gone, resumed), asio::detached);
    one.io.poll();
    CHECK(gone);
    CHECK_FALSE(resumed);
}

TEST_CASE("work for a loop that has ended is refused at its gate") {
    driven one;
    auto gate = one.loop->gate();
    bool ran = false;
    CHECK(gate->post([&] { ran = true; }));
    one.io.poll();
    CHECK(ran);
    one.loop->abandon();
    CHECK_FALSE(gate->post([] {}));
    one.loop.reset();
    CHECK_FALSE(gate->post([] {}));
    one.loop = std::make_unique<ise::loop>(one.env, one.io.get_executor(), [] { return true; });
}

TEST_CASE("work that a loop runs while it is still being posted at its gate does not wait for that") {
    bare_environment env;
    eager_queue queue;
    ise::loop on(env, ise::loop_executor(queue), [] { return true; });
    bool ran = false;
    CHECK(on.gate()->post([&] { ran = true; }));
    CHECK(queue.ran_at_once);
    queue.runner.join();
    CHECK(ran);
}

TEST_CASE("what is listed for a turn's end is flushed once, in order, and not when it is gone") {
    driven one;
    std::string log;
    output first([&] { log += '1'; }), last([&] { log += '3'; });
    auto gone = std::make_unique<output>([&] { log += 'x'; });
    auto removed = std::make_unique<output>([&] { log += 'y'; });
    output remover([&] {
        removed.reset(); // one that the same round was to flush
        one.loop->flush_later(first);
        log += '2';
    });
    auto held = std::make_shared<output>([&] { log += 'h'; });
    {
        ise::loop::turn in(*one.loop);
        one.loop->flush_later(first);
        one.loop->flush_later(*gone);
        one.loop->flush_later(remover);
        one.loop->flush_later(*removed);
        one.loop->flush_later(std::exchange(held, nullptr));
        one.loop->flush_later(last);
        one.loop->flush_later(first);
        gone.reset();
        CHECK(log.empty());
    }
    CHECK(log == "12h31");
}

TEST_CASE("outside of turns what flushes later does so at once, what flushes soon does not") {
    driven one;
    std::string log;
    output later([&] { log += 'l'; }), soon([&] { log += 's'; });
    SECTION("later") {
        one.loop->flush_later(later);
        CHECK(log == "l");
        one.loop->flush_later(later); // gathered
        CHECK(log == "l");
        one.io.poll();
        CHECK(log == "ll");
    }
    SECTION("soon") {
        one.loop->flush_soon(soon);
        CHECK(log.empty());
        one.io.poll();
        CHECK(log == "s");
    }
    SECTION("a loop that ends lets go of what is listed") {
        auto held = std::make_shared<output>([&] { log += 'h'; });
        std::weak_ptr<output> seen = held;
        output ends([&] { one.loop->abandon(); });
        {
            ise::loop::turn in(*one.loop);
            one.loop->flush_later(ends);
            one.loop->flush_later(std::move(held));
            one.loop->flush_soon(soon);
        }
        CHECK(seen.expired());
        CHECK_FALSE(soon.flush_due());
        CHECK(log.empty());
    }
}

TEST_CASE("inproc: what is passed is taken in a turn, in order, and never from within the writer") {
    driven one;
    auto [first, second] = ise::make_inproc_pair(*one.loop, *one.loop, "pair", 10);
    auto& writer = dynamic_cast<ise::object_stream&>(*first);
    auto& reader = dynamic_cast<ise::object_stream&>(*second);
    taker to;
    ise::ring<ise::passed_object> none;
    auto pass = [&](std::string_view text) {
        ise::buffer content;
        content.append(ise::as_bytes(text));
        auto done = writer.pass(content, none);
        CHECK(content.empty() == !done.problem);
        return done;
    };
    REQUIRE(pass("before").bytes == 6);
    reader.use(to);
    CHECK(to.got.empty());
    one.io.poll();
    CHECK(to.got == "before|");
    to.meanwhile = [&, left = 2]() mutable {
        if (left-- > 0) CHECK(pass("more").bytes == 4);
    };
    CHECK(pass("ab").bytes == 2);
    CHECK(pass("0123456789").bytes == 10); // beyond the room by one
    CHECK(pass("c").problem == asio::error::would_block);
    CHECK(to.got == "before|");
    one.io.poll();
    CHECK(to.got == "before|ab0123456789|more|more|");
    CHECK(pass("lost").bytes == 4);
    second.reset();
    one.io.poll();
    CHECK(to.got == "before|ab0123456789|more|more|");
    CHECK(pass("late").problem == asio::error::broken_pipe);
}

TEST_CASE("inproc: cancelling a read loses nothing") {
    driven one;
    auto [first, second] = ise::make_inproc_pair(*one.loop, *one.loop, "pair");
    asio::cancellation_signal stop;
    ise::transfer got;
    std::array<char, 8> room{};
    ise::async_run(one.io.get_executor(), read_once(*second, got, room),
                   asio::bind_cancellation_slot(stop.slot(), asio::detached));
    one.io.poll();
    std::array pieces{asio::const_buffer("abc", 3)};
    SECTION("before the bytes come") {
        stop.emit(asio::cancellation_type::terminal);
        CHECK(first->try_write(pieces).bytes == 3);
        one.io.poll();
        CHECK(got.problem == asio::error::operation_aborted);
    }
    SECTION("after they came, before the turn ends") {
        CHECK(first->try_write(pieces).bytes == 3);
        stop.emit(asio::cancellation_type::terminal);
        one.io.poll();
        CHECK(got.bytes == 3);
        return;
    }
    ise::async_run(one.io.get_executor(), read_once(*second, got, room), asio::detached);
    one.io.poll();
    CHECK_FALSE(got.problem);
    CHECK(std::string_view(room.data(), got.bytes) == "abc");
}

TEST_CASE("inproc: a full queue would block, a closed side says so on both sides") {
    driven one;
    auto [first, second] = ise::make_inproc_pair(*one.loop, *one.loop, "pair", 10);
    std::array pieces{asio::const_buffer("0123456789abcdef", 16)};
    CHECK(first->try_write(pieces).bytes == 10);
    CHECK(first->try_write(pieces).problem == asio::error::would_block);

    ise::transfer got;
    std::array<char, 8> room{};
    ise::async_run(one.io.get_executor(), read_once(*first, got, room), asio::detached);
    one.io.poll();
    SECTION("closing aborts one's own read") {
        first->close();
        one.io.poll();
        CHECK(got.problem == asio::error::operation_aborted);
        CHECK(first->try_write(pieces).problem == asio::error::operation_aborted);
    }
    SECTION("destroying aborts one's own read") {
        first.reset();
        one.io.poll();
        CHECK(got.problem == asio::error::operation_aborted);
    }
    SECTION("the peer's close ends the read and breaks the writes") {
        second->close();
        one.io.poll();
        CHECK(got.problem == asio::error::eof);
        CHECK(first->try_write(pieces).problem == asio::error::broken_pipe);
    }
    SECTION("after shutdown the peer reads the rest and then the end") {
        first->shutdown_write();
        CHECK(first->try_write(pieces).problem == asio::error::broken_pipe);
        for (auto expected : {std::size_t{8}, std::size_t{2}}) {
            ise::async_run(one.io.get_executor(), read_once(*second, got, room), asio::detached);
            one.io.poll();
            CHECK(got.bytes == expected);
        }
        ise::async_run(one.io.get_executor(), read_once(*second, got, room), asio::detached);
        one.io.poll();
        CHECK(got.problem == asio::error::eof);
        first.reset(); // ends the read of this side, still waiting
        one.io.poll();
    }
}

} // namespace inproc_loop_test
