#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/real_parties.hpp>
#include <support/sim_parties.hpp>

namespace smoke_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;

namespace {

ise::task<mode_set> steer(set_mode request) {
    if (request.mode == "fly") throw ise::error(ise::errc::refused, "boats sail");
    mode_set answer{true, "now " + request.mode};
    co_return answer;
}

ise::task<std::string> ask(ise::remote boat, std::string mode) {
    set_mode request{std::move(mode)};
    auto answer = co_await boat.call(helm, request, 5s);
    co_return answer.reason;
}

ise::task<std::string> ask_by_fields(ise::remote boat, std::string mode) {
    auto first = co_await boat.call(helm, mode);
    auto answer = co_await boat.call(helm, mode + " for longer than a short string has room", 5s);
    co_return first.reason + ", " + answer.reason;
}

ise::task<std::vector<double>> follow(ise::remote boat, std::size_t count) {
    std::vector<double> got;
    auto fixes = co_await boat.subscribe(position);
    while (got.size() < count) {
        auto packet = co_await fixes.next();
        if (!packet) break;
        got.push_back(packet->latitude_deg);
    }
    co_return got;
}

} // namespace

TEST_CASE("a call and a subscription go over tcp") {
    real_parties all;
    auto& boat = all.add("boat");
    auto& shore = all.add("shore");
    boat.provide(helm, steer);
    auto fixes = boat.publish(position);
    auto where = boat.listen("tcp://127.0.0.1:0");

    CHECK(all.run(shore, ask(shore.at(where), "hold")) == "now hold");
    CHECK(all.run(shore, ask_by_fields(shore.at(where), "hold")) ==
          "now hold, now hold for longer than a short string has room");
    CHECK_THROWS_WITH(all.run(shore, ask(shore.at(where), "fly")), ise_test::Contains("boats sail"));

    auto following = start(shore.on, follow(shore.at(where), 3));
    all.run_until([&] { return fixes.subscribers() == 1; });
    for (double latitude : {1.0, 2.0, 3.0}) fixes(fix{latitude, 0, 0});
    all.run_until([&] { return following->done; });
    CHECK(following->get() == std::vector<double>{1, 2, 3});
    CHECK(boat.escaped.empty());
    CHECK(shore.escaped.empty());
}

} // namespace smoke_test
