// What a provided service tells of its times, queues and losses.
#include <ise/call/service_meter.hpp>
#include <ise/component/health.hpp>

#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/sim_parties.hpp>

#include <algorithm>

namespace meter_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;
using ise::duration_histogram;

namespace {

ise::task<ise::result<mode_set>> ask(ise::remote boat, ise::duration limit) {
    set_mode request{"hold"};
    auto answer = co_await boat.try_call(helm, request, limit);
    co_return answer;
}

const ise::service_load& load_of(const ise::health_report& outcome, std::string_view name) {
    return *std::ranges::find(outcome.services, name, &ise::service_load::name);
}

std::uint64_t sum(const std::vector<ise::duration_count>& of) {
    std::uint64_t all = 0;
    for (const auto& one : of) all += one.count;
    return all;
}

} // namespace

TEST_CASE("a histogram's buckets follow each other without a gap, a quarter of a doubling wide") {
    for (std::size_t at = 0; at + 1 < duration_histogram::buckets; ++at) {
        auto end = duration_histogram::end_of(at);
        CHECK(duration_histogram::bucket_of(end - 1ns) == at);
        CHECK(duration_histogram::bucket_of(end) == at + 1);
        if (at >= 4) CHECK(end - duration_histogram::end_of(at - 1) <= duration_histogram::end_of(at - 1) / 4);
    }
    CHECK(duration_histogram::bucket_of(-1s) == 0);
    CHECK(duration_histogram::end_of(duration_histogram::buckets - 1) > 2min);
    CHECK(duration_histogram::bucket_of(24h) == duration_histogram::buckets - 1);
}

TEST_CASE("a service tells how long its calls waited and took, who waits, and whom it refused why") {
    sim_parties all;
    auto& boat = all.add("boat");
    auto& shore = all.add("shore");
    ise::serve_options alone;
    alone.concurrent = 1;
    alone.waiting = 2;
    auto handler = [&boat](set_mode) -> ise::task<mode_set> {
        co_await ise::sleep_for(boat.on, 100ms);
        co_return mode_set{true, {}};
    };
    boat.provide(helm, handler, alone);
    boat.listen("tcp://0.0.0.0:7400");
    auto there = shore.at("tcp://boat:7400");
    std::vector<std::shared_ptr<started<ise::result<mode_set>>>> calls;
    for (int i = 0; i < 6; ++i) calls.push_back(start(shore.on, ask(there, 10s)));
    for (auto& one : calls) all.run_until([&] { return one->done; });
    all.stop();
    auto report = ise::health_of(*boat.services);
    const auto& load = load_of(report, "helm");
    CHECK(load.overloaded > 0); // six came, three have room
    CHECK(report.calls_overloaded == load.overloaded);
    CHECK(report.calls_refused == load.overloaded);
    CHECK(load.waiting == 0);
    CHECK(load.calls == sum(load.waited));
    CHECK(load.calls + load.overloaded == 6);
    REQUIRE_FALSE(load.handled.empty());
    CHECK(load.handled.back().below_ns > 50'000'000);
    CHECK(load.waited.back().below_ns > 50'000'000); // the second waited for the first
}

TEST_CASE("a plain handler is counted in every call, and measured") {
    sim_parties all;
    auto& boat = all.add("boat");
    auto& shore = all.add("shore");
    boat.provide(helm, [](set_mode) { return mode_set{true, {}}; });
    boat.listen("tcp://0.0.0.0:7400");
    auto there = shore.at("tcp://boat:7400");
    for (int i = 0; i < 5; ++i) REQUIRE(all.run(shore, ask(there, 10s)));
    all.stop();
    auto load = load_of(ise::health_of(*boat.services), "helm");
    CHECK(load.calls == 5);
    CHECK(sum(load.waited) == 5);
    CHECK(sum(load.handled) > 0);
    CHECK(load.overloaded == 0);
}

} // namespace meter_test
