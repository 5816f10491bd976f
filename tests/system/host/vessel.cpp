// A provider in a process of its own, for tests to kill, stop and starve, or one that calls or follows it:
// usage: host_vessel (NAME_SERVER|-|call|follow) ENDPOINT
#include "vessel.hpp"

#include <ise/service/service_host.hpp>

#include <cstdio>

namespace {

class vessel final : public ise::component {
    ise::task<> run() override {
        provide(host_test::nap, [this](host_test::rest rq) -> ise::task<host_test::rest> {
            co_await sleep(std::chrono::milliseconds(rq.milliseconds));
            co_return rq;
        });
        auto out = publish(host_test::ticks);
        for (std::uint64_t n = 1;; ++n) {
            host_test::tick now{n};
            out(now);
            co_await sleep(std::chrono::milliseconds(10));
        }
    }
};

// Waits for an answer, or for packets, for as long as it lives.
int ask(const std::string& what, const ise::endpoint& at) {
    ise::real_environment env;
    ise::node_options options;
    options.use_names = false;
    ise::node node(env, std::move(options));
    ise::component_options anonymous;
    anonymous.listens = false;
    anonymous.registers = false;
    auto flow = [what, at](ise::component& self) -> ise::task<> {
        auto there = self.at(at);
        host_test::rest hour{3'600'000};
        if (what == "call") co_await there.call(host_test::nap, hour, std::chrono::hours(2));
        auto packets = co_await there.subscribe(host_test::ticks);
        for (;;) {
            auto packet = co_await packets.next();
            if (!packet) break;
        }
    };
    node.start("", flow, std::move(anonymous));
    return ise::run_until_signal(node);
}

} // namespace

int main(int count, char** words) {
    if (count != 3) return 2;
    try {
        std::string mode = words[1];
        if (mode == "call" || mode == "follow") return ask(mode, ise::endpoint::parse(words[2]).value());
        ise::real_environment env;
        ise::node_options options;
        options.log = ise::log_to_stderr(ise::log_level::info);
        options.use_names = std::string(words[1]) != "-";
        if (options.use_names) options.name_servers = {ise::endpoint::parse(words[1]).value()};
        ise::node node(env, std::move(options));
        ise::component_options where;
        where.listen = {ise::endpoint::parse(words[2]).value()};
        where.registers = std::string(words[1]) != "-";
        auto& started = node.start<vessel>("host/vessel", std::move(where));
        auto at = started.services().listening().front().text();
        return ise::run_until_signal(node, [&] {
            std::printf("%s\n", at.c_str());
            std::fflush(stdout);
        });
    } catch (const std::exception& why) {
        std::fprintf(stderr, "host_vessel: %s\n", why.what());
        return 1;
    }
}
