// Components that keep their threads busy.
#include "sea.hpp"

#include <ise/core/real/environment.hpp>
#include <ise/naming/services.hpp>
#include <ise/service/service_host.hpp>

#include <asio/post.hpp>

#include <support/local_sockets.hpp>

#include <atomic>
#include <condition_variable>
#include <future>

#include <unistd.h>

namespace stalled_test {

using namespace sea;
using ise::component;
namespace naming = ise::naming;

namespace {

// Opened once; whoever passes waits for it.
class gate {
public:
    void open() {
        std::lock_guard lock(mutex_);
        open_ = true;
        changed_.notify_all();
    }
    void pass() {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return open_; });
    }

private:
    std::mutex mutex_;
    std::condition_variable changed_;
    bool open_ = false;
};

// Opens a gate when the test ends, also by an exception: otherwise the environment waits for a thread at that gate for
// ever. Declare it after the environment.
struct opened_at_last {
    gate& held;
    ~opened_at_last() { held.open(); }
};

// Opens a gate when a record holds a text.
ise::log_sink when_told(std::string text, gate& opens, const log_book& log) {
    return [text, &opens, keep = log.sink()](const ise::log_record& record) {
        keep(record);
        if (record.message.find(text) != std::string_view::npos) opens.open();
    };
}

ise::node_options options_with(ise::log_sink sink) {
    ise::node_options made;
    made.use_names = false;
    made.log = std::move(sink);
    return made;
}

// Grants every name until one is taken over by another.
class name_server final : public component {
public:
    name_server(std::atomic<bool>& taken, gate& given_up) : taken_(taken), given_up_(given_up) {}

protected:
    task<> run() override {
        provide(naming::enroll, [](naming::register_request request) {
            naming::register_response response;
            response.server_incarnation = response.lease_number = 1;
            response.lease = request.lease;
            for (const auto& claim : request.components) {
                naming::grant made;
                made.path = claim.path;
                made.epoch = 1;
                response.grants.push_back(std::move(made));
            }
            return response;
        });
        provide(naming::renew, [this](naming::renew_request) {
            naming::renew_response response;
            response.known = true;
            response.server_incarnation = response.lease_number = 1;
            response.lease = lease;
            if (taken_) {
                naming::grant lost;
                lost.path = "boat";
                lost.what = naming::verdict::superseded;
                response.lost.push_back(std::move(lost));
            }
            return response;
        });
        provide(naming::withdraw, [this](naming::withdraw_request) {
            given_up_.open();
            return naming::withdraw_response();
        });
        co_return;
    }

private:
    std::atomic<bool>& taken_;
    gate& given_up_;

public:
    static constexpr ise::duration lease = 300ms;
};

// Is not registered yet.
class beginner final : public component {
public:
    beginner() { announce_when_ready(); }

protected:
    task<> run() override { co_await sleep(24h); }
};

} // namespace

TEST_CASE("a component whose thread is busy is shown as stalled, and its node goes on") {
    log_book log;
    gate stalled, recovered, release;
    auto told_stalled = when_told("is stalled", stalled, log);
    auto told_recovered = when_told("goes on", recovered, log);
    ise::real_environment env;
    opened_at_last guard{release};
    ise::node node(env, options_with([=](const ise::log_record& record) {
                       told_stalled(record);
                       told_recovered(record);
                   }));
    node.start("busy", [&](component& self) -> task<> {
        release.pass();
        co_await self.sleep(1h);
    });
    stalled.pass();
    auto of = [&](const std::string& path) {
        for (const auto& each : node.components())
            if (each.path == path) return each;
        return ise::component_status{};
    };
    CHECK(of("busy").stalled);
    auto& other = node.start<beacon>("other"); // the node goes on
    CHECK_FALSE(of("other").stalled);
    auto call = [](component& self, ise::endpoint where) -> task<std::string> {
        auto provider = self.at(where);
        question asked{"ahoy"};
        auto answer = co_await provider.call(echo, asked, 30s);
        co_return answer.text;
    };
    CHECK(other.wait(call(other, other.services().listening().front())) == "ahoy");
    release.open();
    recovered.pass();
    CHECK_FALSE(of("busy").stalled);
}

TEST_CASE("components that share a loop are shown as stalled together, and go on together") {
    gate first, second, first_goes_on, second_goes_on, release;
    ise::real_environment env;
    opened_at_last guard{release};
    ise::node node(env, options_with([&](const ise::log_record& record) {
                       auto line = ise::format_line(record);
                       auto result = [&](const char* what, const char* which) {
                           return line.find(what) != std::string::npos && line.find(which) != std::string::npos;
                       };
                       if (result("is stalled", "crew/first")) first.open();
                       if (result("is stalled", "crew/second")) second.open();
                       if (result("goes on", "crew/first")) first_goes_on.open();
                       if (result("goes on", "crew/second")) second_goes_on.open();
                   }));
    auto& blocks = node.start<beacon>("crew/first");
    ise::component_options beside;
    beside.together_with = "crew/first";
    node.start<beacon>("crew/second", std::move(beside));
    asio::post(blocks.get_executor(), [&] { release.pass(); });
    first.pass();
    second.pass();
    for (const auto& each : node.components()) CHECK(each.stalled);
    release.open();
    first_goes_on.pass();
    second_goes_on.pass();
    for (const auto& each : node.components()) CHECK_FALSE(each.stalled);
}

TEST_CASE("sessions of a component that computes for many heartbeats last, over every transport") {
    auto where = GENERATE(from_range(
        ise_test::usable_here({"tcp://127.0.0.1:0", "udp://127.0.0.1:0",
                               "local://@ise-test-stalled-" + std::to_string(::getpid()), "inproc://stalled"})));
    INFO(where);
    log_book log;
    ise::real_environment env;
    auto options = options_with(log.sink());
    options.services.accepts.heartbeat_ns = 200'000'000; // lost after 600 ms of silence
    ise::node node(env, options);
    ise::component_options listens;
    listens.listen = {ise::endpoint::parse(where).value()};
    auto& busy = node.start(
        "busy",
        [&](component& self) -> task<> {
            self.provide(echo, [](question asked) {
                auto until = std::chrono::steady_clock::now() + 1600ms; // of computing
                while (std::chrono::steady_clock::now() < until) {}
                return reply{asked.text};
            });
            co_await self.sleep(1h);
        },
        listens);
    ise::component_options asks;
    asks.listens = false;
    auto& asking = node.start(
        "asking", [](component& self) -> task<> { co_await self.sleep(1h); }, asks);
    auto call = [](component& self, ise::endpoint at) -> task<std::string> {
        auto provider = self.at(at);
        question asked{"ahoy"};
        auto answer = co_await provider.call(echo, asked, 30s); // throws where the session is lost: it was written
        co_return answer.text;
    };
    CHECK(asking.wait(call(asking, busy.services().listening().front())) == "ahoy");
    auto sessions = [](component& self) -> task<std::uint64_t> {
        co_return self.services().counts().sessions_accepted;
    };
    CHECK(busy.wait(sessions(busy)) == 1); // and no other one healed what was lost
}

TEST_CASE("a component that blocks its thread cannot hold its node: it is named and left behind") {
    log_book log;
    gate inside, release;
    census frames;
    {
        ise::real_environment env; // its end waits for the thread
        opened_at_last guard{release};
        auto options = options_with(log.sink());
        options.grace = 1ms;
        auto node = std::make_unique<ise::node>(env, options);
        node->start("busy", [&](component& self) -> task<> {
            census::citizen alive(frames);
            inside.open();
            release.pass();
            co_await self.sleep(1h);
        });
        ise::component_options together;
        inside.pass();
        node->stop();
        node->wait();
        auto reports = node->reports();
        REQUIRE(reports.size() == 1);
        CHECK(reports.front().still_running.size() == 1);
        CHECK(reports.front().failure.find("could not be stopped") != std::string::npos);
        node.reset();
        CHECK(log.has("left behind", "busy"));
        release.open();
    }
    CHECK(frames.alive == 0);
}

TEST_CASE("offloaded work outlives neither its coroutine nor its component, however late it ends") {
    log_book log;
    gate inside, release;
    int result = 0;
    {
        ise::real_environment env;
        opened_at_last guard{release};
        auto options = options_with(log.sink());
        options.grace = 1ms;
        auto node = std::make_unique<ise::node>(env, options);
        node->start("computes", [&](component& self) -> task<> {
            int local = 41;
            auto work = [&] {
                inside.open();
                release.pass();
                return ++local; // the coroutine is there
            };
            result = co_await self.offload(work);
        });
        inside.pass();
        node->stop();
        node->wait();
        CHECK(node->reports().front().still_running == std::vector<std::string>{"run"});
        node.reset();
        release.open();
    }
    CHECK((result == 42 || result == 0)); // it was given back, or its loop had ended
}

TEST_CASE("offloading keeps the component's thread free") {
    log_book log;
    gate release;
    ise::real_environment env;
    opened_at_last guard{release};
    ise::node node(env, options_with(log.sink()));
    std::promise<int> done;
    auto& computes = node.start("computes", [&](component& self) -> task<> {
        auto work = [&] {
            release.pass();
            return 7;
        };
        auto made = co_await self.offload(work);
        done.set_value(made);
    });
    auto free = [](component& self) -> task<> { co_await self.sleep(1ms); };
    computes.wait(free(computes));
    release.open();
    CHECK(done.get_future().get() == 7);
}

TEST_CASE("what becomes of the name of a component that was left behind is no concern of its next life") {
    log_book log;
    gate registered, given_up, release;
    std::atomic<bool> taken{false};
    ise::real_environment env;
    opened_at_last guard{release};
    ise::node shore(env, options_with(log.sink()));
    ise::component_options where;
    where.listen = {ise::endpoint::parse("tcp://127.0.0.1:0").value()};
    auto& names = shore.start<name_server>(std::string(naming::server_path), where, taken, given_up);

    auto options = options_with(log.sink());
    options.use_names = true;
    options.name_servers = {names.services().listening().front()};
    options.lease = name_server::lease;
    options.grace = 1ms;
    ise::node node(env, options);
    node.start("boat", [&](component& self) -> task<> {
        co_await self.ready();
        registered.open();
        release.pass();
    });
    registered.pass();
    node.stop("boat");
    node.wait();
    CHECK(log.has("left behind", "boat"));
    auto& next = node.start<beginner>("boat");
    taken = true;
    given_up.pass();
    auto nothing = [](component& self) -> task<> { co_await self.sleep(1ms); };
    next.wait(nothing(next));
    CHECK_FALSE(log.has("another took this name over"));
    release.open();
    node.stop();
    node.wait();
    shore.stop();
    shore.wait();
}

} // namespace stalled_test
