// Packets handed over as objects between threads: loops that end in any order, with everything under way.
#include <ise/asio.hpp>
#include <ise/core/real/environment.hpp>

#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/party.hpp>

#include <asio/post.hpp>
#include <asio/use_future.hpp>

#include <future>

namespace objects_threads_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;

namespace {

// A party on a thread of its own.
struct sailor {
    party who;
    explicit sailor(ise::environment& env, const std::string& name) : who(env, env.make_loop(name), name) {}
    ~sailor() { who.host->end(); }

    template <class Body>
    auto on_loop(Body body) {
        std::packaged_task<decltype(body())()> task(std::move(body));
        auto got = task.get_future();
        asio::post(who.on.get_executor(), [&] { task(); });
        return got.get();
    }
    template <class T>
    std::future<T> spawn(ise::task<T> body) {
        return ise::async_run(who.on.get_executor(), std::move(body), asio::use_future);
    }
    /// In order: says goodbye, and ends what runs.
    void stop() {
        on_loop([this] {
            who.services->stop(100ms);
            who.scope.stop();
        });
        spawn(who.scope.join()).get();
    }
};

struct two_threads {
    ise::real_environment env;
    std::unique_ptr<sailor> boat = std::make_unique<sailor>(env, "boat");
    std::unique_ptr<sailor> shore = std::make_unique<sailor>(env, "shore");
    ise::endpoint where;

    two_threads() {
        where = boat->on_loop([this] {
            boat->who.provide(echo, [](blob given) -> ise::task<blob> { co_return given; });
            return boat->who.listen("inproc://threads");
        });
    }
    ise::remote there() {
        return shore->on_loop([this] { return shore->who.at(where); });
    }
};

blob of_size(std::size_t size) {
    blob made;
    made.content.assign(size, static_cast<std::uint8_t>(size));
    return made;
}

// Calls until one fails; how many were answered.
ise::task<std::uint64_t> call_again_and_again(ise::remote there, std::uint64_t most,
                                              std::shared_ptr<std::atomic<std::uint64_t>> answered) {
    std::uint64_t count = 0;
    for (; count < most; ++count) {
        const std::size_t size = count % 7 == 0 ? 100'000 : count % 100;
        auto request = of_size(size);
        auto got = co_await there.try_call(echo, std::move(request), 30s);
        if (!got) break;
        if (got->content.size() != size) throw std::logic_error("another answer");
        ++*answered;
    }
    co_return count;
}

ise::task<std::uint64_t> listen_to(ise::remote there, ise::subscribe_options options,
                                   std::shared_ptr<std::atomic<int>> listening) {
    auto in = co_await there.subscribe(pictures, options);
    ++*listening;
    std::uint64_t sum = 0;
    for (;;) {
        auto packet = co_await in.next();
        if (!packet || packet->content.empty()) break;
        sum += packet.lost_before().value() + 1;
        auto mine = packet.take();
        mine.content.push_back(1); // nobody else sees it
    }
    co_return sum;
}

ise::task<> publish_many(ise::publication<ise::subscription<blob>> out, std::size_t count) {
    for (std::size_t i = 1; i <= count; ++i) {
        auto shot = of_size(1 + i % 3'000);
        co_await out.send(std::move(shot));
    }
    blob last;
    co_await out.send(std::move(last));
}

} // namespace

TEST_CASE("objects between threads: calls and packets, each once") {
    two_threads at;
    auto there = at.there();
    auto answered = std::make_shared<std::atomic<std::uint64_t>>(0);
    auto listening = std::make_shared<std::atomic<int>>(0);
    auto out = at.boat->on_loop([&] { return at.boat->who.publish(pictures); });
    std::vector<std::future<std::uint64_t>> callers, listeners;
    for (int i = 0; i < 4; ++i) callers.push_back(at.shore->spawn(call_again_and_again(there, 300, answered)));
    for (int i = 0; i < 3; ++i)
        listeners.push_back(at.shore->spawn(listen_to(there, ise::subscribe_options::lossless(16), listening)));
    while (*listening < 3) std::this_thread::yield();
    at.boat->spawn(publish_many(out, 2'000)).get();
    for (auto& each : listeners) CHECK(each.get() == 2'000);
    for (auto& each : callers) CHECK(each.get() == 300);
    at.shore->on_loop([&] { there = {}; });
    at.boat->on_loop([&] { out = {}; });
    at.shore->stop();
    at.boat->stop();
}

TEST_CASE("objects between threads: whoever goes first, with calls and packets under way, nobody waits for ever") {
    const bool provider_first = GENERATE(true, false);
    const bool in_order = GENERATE(true, false); // else its loop just ends
    for (std::uint64_t after : {0u, 1u, 2u, 10u, 50u}) {
        INFO("after " << after << " answers");
        two_threads at;
        auto answered = std::make_shared<std::atomic<std::uint64_t>>(0);
        auto listening = std::make_shared<std::atomic<int>>(0);
        auto out = at.boat->on_loop([&] { return at.boat->who.publish(pictures); });
        std::vector<std::future<std::uint64_t>> underway;
        {
            auto there = at.there();
            for (int i = 0; i < 4; ++i)
                underway.push_back(at.shore->spawn(call_again_and_again(there, ~std::uint64_t{0}, answered)));
            underway.push_back(at.shore->spawn(listen_to(there, ise::subscribe_options::keep_last(4), listening)));
        }
        auto publishing = at.boat->spawn(publish_many(out, 1'000));
        while (*answered < after) std::this_thread::yield();
        auto& first = provider_first ? at.boat : at.shore;
        auto& second = provider_first ? at.shore : at.boat;
        if (in_order) first->stop();
        first->who.host->end();
        if (!provider_first) publishing.wait(); // nobody holds it up
        second->stop();
        second->who.host->end();
        // All coroutines are over: answered, failed, or gone with their loop.
        for (auto& each : underway) CHECK(each.wait_for(60s) == std::future_status::ready);
        CHECK(publishing.wait_for(60s) == std::future_status::ready);
        out = {};
        first.reset();
        second.reset();
    }
}

} // namespace objects_threads_test
