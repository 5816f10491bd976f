#include "sea.hpp"

namespace sweep_test {

// A scenario with all that a component can wait for, ended at each step of its way.
using namespace sea;
using ise::component;

namespace {

struct scenario {
    census frames;
    fleet all;
    bool done = false;

    explicit scenario(std::uint64_t seed) : all(seed) {
        all.start("boat", "boat", [this](component& self) -> task<> {
            census::citizen alive(frames);
            self.provide(echo, [this, &self](question asked, const ise::call_context& context) -> task<reply> {
                census::citizen handling(frames);
                co_await self.sleep(3ms);
                auto caller = self.caller(context);
                auto answer = co_await caller.call(ask_back, asked, 1s);
                auto work = [&answer] { answer.text += "!"; };
                co_await self.offload(work);
                co_return answer;
            });
            self.publish_every(readings, 5ms, [] { return reading{}; });
            co_await self.ready();
            co_await self.sleep(1h);
        });
        all.start("shore", "shore", [this](component& self) -> task<> {
            census::citizen alive(frames);
            self.provide(ask_back, [](question asked) { return reply{asked.text}; });
            auto boat = self.at(fleet::at("boat"));
            self.listen(boat, readings, [](const reading&) {});
            auto connected = co_await boat.connect(5s);
            auto packets = co_await boat.subscribe(readings, ise::subscribe_options::lossless(4));
            for (int n = 0; n < 2; ++n) {
                auto packet = co_await packets.next();
                question asked{"ahoy"};
                auto answer = co_await boat.call(echo, asked, 2s);
            }
            packets.unsubscribe();
            done = true;
        });
    }
};

} // namespace

TEST_CASE("a component can be stopped at every step of its life: it ends in time and leaves nothing") {
    auto how = GENERATE(0, 1, 2, 3, 4);
    bool finished = false;
    for (std::uint64_t n = 0; !finished; ++n) {
        CAPTURE(how, n);
        scenario play(n);
        std::uint64_t steps = 0;
        play.all.world.run_until([&] { return play.done || steps++ >= n; }, 1min);
        finished = play.done;
        if (how == 0) {
            REQUIRE(play.all.stop("boat"));
        } else if (how == 1) {
            REQUIRE(play.all.stop("shore"));
        } else if (how == 2) {
            play.all.node("boat").stop();
            play.all.node("shore").stop();
        } else if (how == 3) {
            play.all.drop("boat");
        } else {
            play.all.process("shore").crash();
            play.all.drop("shore");
        }
        if (how != 3) REQUIRE(play.all.stop("boat"));
        if (how != 4) REQUIRE(play.all.stop("shore"));
        if (how != 3)
            for (const auto& report : play.all.node("boat").reports()) REQUIRE(report.still_running.empty());
        if (how != 4)
            for (const auto& report : play.all.node("shore").reports()) REQUIRE(report.still_running.empty());
        REQUIRE(play.frames.alive == 0);
        REQUIRE(n < 5000);
    }
}

} // namespace sweep_test
