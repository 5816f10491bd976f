// Actions over every transport: a goal is executed once, and its outcome comes, whatever becomes of the session.
#include "traffic.hpp"

#include <ise/service/action.hpp>
#include <ise/service/action_run.hpp>
#include <ise/service/action_runs.hpp>

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

using namespace conformance;

namespace {

struct legs {
    std::uint32_t count = 0;
};
struct leg {
    std::uint32_t number = 0;
};
constexpr ise::action<legs, leg, legs> voyage_of_legs{"sail"};

struct voyage {
    int begun = 0, cancelled = 0;
    bool may_end = false;
    std::vector<std::uint32_t> reported;
    std::optional<ise::result<legs>> outcome;
};

void provide_sail(side& boat, std::shared_ptr<voyage> of) {
    auto handler = [of, &boat](legs goal, ise::progress<leg> progress) -> ise::task<legs> {
        ++of->begun;
        try {
            for (std::uint32_t number = 1; number <= goal.count || !of->may_end; ++number) {
                leg done{number};
                co_await progress(done);
                co_await ise::sleep_for(boat.on, 5ms);
            }
        } catch (const std::exception&) {
            ++of->cancelled;
            throw;
        }
        co_return goal;
    };
    boat.services->services().add(ise::make_action(*boat.services, voyage_of_legs, std::move(handler))).value();
}

ise::task<> request_sail(ise::remote boat, std::shared_ptr<voyage> into) {
    legs goal{5};
    ise::run_options options;
    options.accept = 10min;
    auto run = co_await boat.start(voyage_of_legs, goal, options);
    for (;;) {
        auto done = co_await run.next();
        if (!done) break;
        into->reported.push_back(done->number);
    }
    auto outcome = co_await run.try_result();
    into->outcome.emplace(std::move(outcome));
}

void over_lost_sessions(pair& at) {
    auto of = std::make_shared<voyage>();
    provide_sail(at.boat, of);
    at.open();
    auto asked = start(at.shore.on, request_sail(at.there, of));
    for (std::uint32_t round = 1; round <= 3; ++round) {
        at.run_until([&, from = of->reported.size()] { return of->reported.size() > from + 2; });
        at.cut();
    }
    of->may_end = true;
    at.cut(); // the outcome may be on its way
    at.run_until([&] { return asked->done; });
    asked->get();
    CHECK((of->begun == 1 && of->cancelled == 0));
    REQUIRE(of->outcome);
    REQUIRE(*of->outcome);
    CHECK((*of->outcome)->count == 5);
    CHECK(std::ranges::is_sorted(of->reported));
}

void given_up(pair& at) {
    auto of = std::make_shared<voyage>();
    provide_sail(at.boat, of);
    at.open();
    auto asked = start(at.shore.on, request_sail(at.there, of));
    at.run_until([&] { return of->reported.size() > 2; });
    asked->cancel.emit(asio::cancellation_type::terminal);
    at.run_until([&] { return asked->done && of->cancelled == 1; });
    CHECK(of->begun == 1);
}

} // namespace

TEMPLATE_TEST_CASE("an action is executed once and its outcome arrives over lost sessions", "", OVER_EVERY_TRANSPORT) {
    over<TestType>(over_lost_sessions);
}

TEMPLATE_TEST_CASE("an action that is given up is cancelled at its provider", "", OVER_EVERY_TRANSPORT) {
    over<TestType>(given_up);
}
