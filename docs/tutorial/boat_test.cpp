#include "boat.hpp"

#include <ise/sim/world.hpp>

#if __has_include(<catch2/catch_all.hpp>)
    #include <catch2/catch_all.hpp> // version 3; any framework will do
#else
    #include <catch2/catch.hpp>
#endif

#include <optional>

using namespace std::chrono_literals;

namespace {

ise::node_options without_names() {
    ise::node_options options;
    options.use_names = false;
    return options;
}

/// What runs in the boat's process: a node with the boat, listening where the test knows.
std::shared_ptr<void> boat_program(ise::sim::process& env) {
    auto node = std::make_shared<ise::node>(env, without_names());
    ise::component_options where;
    where.listen = {ise::endpoint::parse("tcp://0.0.0.0:7000").value()};
    node->start<boat>("tutorial/boat", where);
    return node;
}

} // namespace

TEST_CASE("the shore sees every loss of a boat that is cut off and then crashes") {
    ise::sim::world world{7};
    auto& afloat = world.host("boat").start_process("boat", boat_program);
    ise::node ashore(world.host("shore").start_process("shore"), without_names());

    std::vector<log_line> seen;
    std::vector<std::optional<std::uint64_t>> gaps;
    ise::component_options asks_only;
    asks_only.listens = false;
    ashore.start(
        "shore",
        [&](ise::component& self) -> ise::task<> {
            auto boat = self.at(ise::endpoint::parse("tcp://boat:7000").value());
            set_mode hold{"hold"};
            co_await boat.call(helm, hold, 5s);
            auto lines = co_await boat.subscribe(logbook, ise::subscribe_options::keep_last(4));
            for (;;) {
                auto line = co_await lines.next();
                if (!line) break;
                seen.push_back(*line);
                if (line.lost_before() != 0) gaps.push_back(line.lost_before());
            }
        },
        asks_only);

    REQUIRE(world.run_until([&] { return seen.size() == 3; }, 1min)); // virtual time
    CHECK(gaps.empty());

    world.net().partition("boat", "shore");
    world.run_for(20s);
    CHECK(seen.size() <= 4); // nothing arrives, and nothing hangs
    world.net().heal("boat", "shore");
    REQUIRE(world.run_until([&] { return gaps.size() == 1; }, 1min));
    const auto missing = gaps.front().value();
    CHECK(missing > 10);                                  // it kept the last four of twenty seconds
    CHECK(seen.back().mile == seen.size() + missing - 1); // and told exactly how many are gone

    afloat.restart(); // a new process: the boat is moored again, at mile 0
    REQUIRE(world.run_until([&] { return gaps.size() == 2; }, 1min));
    CHECK(!gaps.back()); // nobody knows how many: it is empty
    CHECK(seen.back().mode == "moored");

    ashore.stop();
    CHECK(world.run_until([&] { return ashore.all_stopped(); }, 1min));
}
