// A process that has died: whoever started it says so, and its names are free at once.
#include "system.hpp"

#include <fmt/format.h>

namespace ended_test {

using namespace names_test;

namespace {

const std::string mark(32, 'm');

struct sea {
    sea() {
        auto run = [](ise::sim::process& env) {
            auto made = std::make_shared<program>(env);
            made->node.start<doubler>("atirma/doubler", everywhere());
            return made;
        };
        boat = &it.world.host("boat").start_process(
            "boat", run,
            {{"ISE_NAME_SERVER", "tcp://" + it.world.host("ns").address() + ":7400"},
             {ise::naming::launch_mark_variable, mark}});
        it.start_doubler("buoy", "atirma/other");
        REQUIRE(it.world.run_until([&] { return it.holds("atirma/doubler") && it.holds("atirma/other"); }, 5s));
    }
    // What the name server answers to a mark: how many nodes, or why not.
    ise::result<std::uint32_t> say(const std::string& which) {
        auto got = std::make_shared<std::optional<ise::result<std::uint32_t>>>();
        it.start_body("host", fmt::format("sayer{}", ++sayers), [got, which](ise::component& self) -> ise::task<> {
            ise::naming::ended_request request;
            request.launch_mark = which;
            auto server = name_server_of(self);
            auto answer = co_await server.try_call(ise::naming::ended, request, 1s);
            if (answer) got->emplace(answer->nodes);
            else got->emplace(answer.error());
        });
        REQUIRE(it.world.run_until([&] { return got->has_value(); }, 5s));
        return **got;
    }

    names_test::system it;
    ise::sim::process* boat = nullptr;
    int sayers = 0;
};

} // namespace

TEST_CASE("ended: the names of a process that died are free before its lease is over, and no others") {
    sea at;
    auto epoch = at.it.epoch_of("atirma/doubler");
    at.boat->crash();
    CHECK(at.it.holds("atirma/doubler"));
    auto said = at.say(mark);
    REQUIRE(said);
    CHECK(*said == 1);
    CHECK_FALSE(at.it.holds("atirma/doubler"));
    CHECK(at.it.holds("atirma/other"));
    at.it.start_doubler("spare", "atirma/doubler");
    CHECK(at.it.world.run_until([&] { return at.it.holds("atirma/doubler"); }, 300ms));
    CHECK(at.it.epoch_of("atirma/doubler") > epoch);
}

TEST_CASE("ended: who does not know the mark ends nobody") {
    sea at;
    auto other = GENERATE(as<std::string>(), std::string(32, 'x'), std::string(33, 'm'));
    auto said = at.say(other);
    REQUIRE(said);
    CHECK(*said == 0);
    auto none = at.say(GENERATE(as<std::string>(), "", "m", std::string(31, 'm'))); // nobody started the buoy's process
    REQUIRE_FALSE(none);
    CHECK(none.error().code() == ise::errc::refused);
    CHECK(at.it.holds("atirma/doubler"));
    CHECK(at.it.holds("atirma/other"));
}

TEST_CASE("ended: one that is alive after all comes back under its epoch") {
    sea at;
    auto epoch = at.it.epoch_of("atirma/doubler");
    REQUIRE(at.say(mark).value() == 1);
    REQUIRE(at.it.world.run_until([&] { return at.it.holds("atirma/doubler"); }, 5s));
    CHECK(at.it.epoch_of("atirma/doubler") == epoch);
}

} // namespace ended_test
