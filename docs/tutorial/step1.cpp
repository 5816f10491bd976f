#include <ise/ise.hpp>

#include <fmt/core.h>

using namespace std::chrono_literals;

class boat : public ise::component {
    ise::task<> run() override {
        for (int mile = 1; mile <= 3; ++mile) {
            co_await sleep(100ms);
            fmt::print("{} has sailed {} mi\n", path(), mile);
        }
        stop();
    }
};

int main() {
    ise::real_environment env;
    ise::node_options options;
    options.use_names = false; // nobody has to find it yet
    ise::node node(env, options);
    node.start<boat>("tutorial/boat");
    return ise::run_until_signal(node); // until Ctrl-C, or until every component has stopped
}
