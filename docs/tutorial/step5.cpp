#include "boat.hpp"

#include <fmt/core.h>

#include <cstdio>

using namespace std::chrono_literals;

class shore : public ise::component {
    ise::task<> run() override {
        auto boat = at("tutorial/boat"); // there or not: calls wait for it within their deadline
        set_mode hold{"hold"};
        auto reply = co_await boat.call(helm, hold, 10s);
        fmt::print("hold: {}\n", reply.accepted ? "accepted" : reply.reason);
        auto lines = co_await boat.subscribe(logbook, ise::subscribe_options::keep_latest());
        for (;;) {
            auto line = co_await lines.next();
            if (!line || line->mile >= 2) break;
        }
        fmt::print("two miles out\n");
        stop();
    }
};

int main(int argc, char** argv) {
    const std::string_view which = argc > 1 ? argv[1] : "";
    if (which != "boat" && which != "shore") {
        fmt::print(stderr, "usage: step5 boat|shore\n");
        return 2;
    }
    ise::real_environment env;
    ise::node node(env);
    if (which == "boat") node.start<boat>("tutorial/boat");
    else node.start<shore>("tutorial/shore");
    return ise::run_until_signal(node);
}
