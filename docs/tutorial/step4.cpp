#include <ise/ise.hpp>

#include <fmt/core.h>

using namespace std::chrono_literals;

struct reef {
    int reefs = 0;
};
struct reefed {
    int reefs = 0;
};

inline constexpr ise::request_response<reef, reefed> sails{"sails"};
inline constexpr ise::request_response<reef, reefed> engine{"engine"};

class boat : public ise::component {
    ise::task<> run() override {
        provide(sails, [this](reef rq) -> ise::task<reefed> {
            if (rq.reefs < 0) throw ise::error(ise::errc::refused, "it blows too hard to shake out a reef");
            if (rq.reefs > 3) throw std::runtime_error("there are three reefs");
            for (; reefs_ < rq.reefs; ++reefs_) co_await sleep(300ms);
            co_return reefed{reefs_};
        });
        co_return;
    }
    int reefs_ = 0;
};

class shore : public ise::component {
    ise::task<> run() override {
        auto boat = co_await find("tutorial/boat");
        for (int reefs : {1, -1, 4, 3}) {
            auto limit = reefs == 3 ? 500ms : 5000ms; // two more reefs take longer
            auto outcome = co_await boat.try_call(sails, reefs, limit);
            if (outcome) fmt::print("{} reefs in\n", outcome->reefs);
            else fmt::print("{}, {}\n", name_of(outcome.error().code()), name_of(outcome.error().executed()));
        }
        try {
            co_await boat.call(engine, 2s);
        } catch (const ise::error& thrown) {
            fmt::print("{}, {}\n", name_of(thrown.code()), name_of(thrown.executed()));
        }
        stop();
    }
};

int main() {
    ise::real_environment env;
    ise::node boats(env), people(env);
    boats.start<boat>("tutorial/boat");
    people.start<shore>("tutorial/shore");
    return ise::run_until_signal(people);
}
