#include "inproc_threads.hpp"

#include <ise/core/inproc.hpp>
#include <ise/core/inproc_stream.hpp>

#include <asio/buffer.hpp>

#include <support/catch.hpp>

namespace inproc_test {

using namespace threads;
using ise::task;

namespace {

task<> pump(std::unique_ptr<ise::stream> to, std::uint64_t total) {
    ise::bytes block(10'007);
    for (std::uint64_t sent = 0; sent < total;) {
        for (std::size_t i = 0; i < block.size(); ++i) block[i] = static_cast<std::byte>((sent + i) % 251);
        const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(block.size(), total - sent));
        std::array pieces{asio::const_buffer(block.data(), count / 3),
                          asio::const_buffer(block.data() + count / 3, count - count / 3)};
        auto moved = to->try_write(pieces);
        sent += moved.bytes;
        if (moved.problem == asio::error::would_block) {
            auto problem = co_await to->wait_writable();
            if (problem) throw std::system_error(problem);
        } else if (moved.problem) {
            throw std::system_error(moved.problem);
        }
    }
}

struct tally {
    std::size_t count = 0;
    bool right = true;
    std::error_code problem;
};

task<> drain(std::unique_ptr<ise::stream> from, tally& into) {
    ise::bytes room(7'001);
    for (;;) {
        auto got = co_await from->read_some(asio::buffer(room));
        if (got.problem) {
            into.problem = got.problem;
            co_return;
        }
        for (std::size_t i = 0; i < got.bytes; ++i)
            into.right = into.right && room[i] == static_cast<std::byte>((into.count + i) % 251);
        into.count += got.bytes;
    }
}

task<> accept_and_drain(ise::listener& at, tally& into) {
    auto [problem, client] = co_await at.accept();
    if (problem) {
        into.problem = problem;
        co_return;
    }
    co_await drain(std::move(client), into);
}

task<> connect_and_pump(ise::inproc_registry& names, ise::loop& on, std::string name, std::size_t total) {
    auto made = names.connect(on, name);
    co_await pump(std::move(made.value()), total);
}

task<> listen_here(ise::inproc_registry& names, ise::loop& on, std::unique_ptr<ise::listener>& into) {
    into = std::move(names.listen(on, "boat").value());
    co_return;
}

task<> forget(std::unique_ptr<ise::listener>& what) {
    what.reset();
    co_return;
}

} // namespace

TEST_CASE("inproc: bytes cross threads in order through a full queue and end with the end") {
    bare_environment env;
    ise::inproc_registry names;
    looper near(env), far(env);
    std::unique_ptr<ise::listener> channel;
    far.run(listen_here(names, far.loop(), channel)).get();
    constexpr std::size_t total = 5'000'000;
    tally got;
    auto reading = far.run(accept_and_drain(*channel, got));
    auto writing = near.run(connect_and_pump(names, near.loop(), "boat", total));
    writing.get();
    reading.get();
    CHECK(got.count == total);
    CHECK(got.right);
    CHECK(got.problem == asio::error::eof);
    far.run(forget(channel)).get();
}

TEST_CASE("inproc: many connections at once, both ways between two threads") {
    bare_environment env;
    ise::inproc_registry names;
    looper near(env), far(env);
    std::unique_ptr<ise::listener> channel;
    far.run(listen_here(names, far.loop(), channel)).get();
    std::vector<tally> got(20);
    std::vector<std::future<void>> all;
    for (auto& each : got) {
        all.push_back(near.run(connect_and_pump(names, near.loop(), "boat", 50'000)));
        all.push_back(far.run(accept_and_drain(*channel, each)));
        all.back().wait(); // one accept at a time
    }
    for (auto& each : all) each.get();
    for (auto& each : got) CHECK(each.count == 50'000);
    far.run(forget(channel)).get();
}

TEST_CASE("inproc: a name that is taken, free again, or not there is said so") {
    bare_environment env;
    ise::inproc_registry names;
    looper one(env);
    std::unique_ptr<ise::listener> channel;
    CHECK(names.connect(one.loop(), "boat").error().code() == ise::errc::unreachable);
    one.run(listen_here(names, one.loop(), channel)).get();
    CHECK(names.listen(one.loop(), "boat").error().code() == ise::errc::address_in_use);
    CHECK(channel->where().text() == "inproc://boat");
    one.run(forget(channel)).get();
    CHECK(names.connect(one.loop(), "boat").error().code() == ise::errc::unreachable);
    one.run(listen_here(names, one.loop(), channel)).get();
    CHECK(names.listen(one.loop(), "").error().code() == ise::errc::invalid_argument);
    one.run(forget(channel)).get();
}

TEST_CASE("inproc: a loop may end while the other side reads or writes") {
    bare_environment env;
    auto near = std::make_unique<looper>(env);
    auto far = std::make_unique<looper>(env);
    auto [first, second] = ise::make_inproc_pair(near->loop(), far->loop(), "pair");
    tally got;
    std::future<void> reading, writing;
    SECTION("the writer's loop ends: the reader gets the rest and the end") {
        reading = far->run(drain(std::move(second), got));
        writing = near->run(pump(std::move(first), 400'000'000));
        near.reset(); // the frame goes, its stream with it
        reading.get();
        CHECK(got.problem == asio::error::eof);
        CHECK(got.right);
    }
    SECTION("the reader's loop ends: the writer is told") {
        writing = near->run(pump(std::move(first), 400'000'000'000));
        reading = far->run(drain(std::move(second), got));
        far.reset();
        CHECK_THROWS_AS(writing.get(), std::system_error);
    }
    SECTION("the loop ends and its stream is destroyed later") {
        writing = near->run(pump(std::move(first), 400'000'000'000));
        far.reset();
        second.reset();
        CHECK_THROWS_AS(writing.get(), std::system_error);
    }
}

} // namespace inproc_test
