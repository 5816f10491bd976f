// A program with an io_context of its own, run by four threads: two gateways serve one role over udp, and whoever uses
// the role goes on with the second when the first is gone.
#include <ise/asio.hpp>
#include <ise/ise.hpp>
#include <ise/name_server/name_server.hpp>
#include <ise/service/service_host.hpp>

#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>

#include <cstdio>
#include <string>
#include <thread>
#include <vector>

using namespace std::chrono_literals;

struct question {};
struct answer {
    std::string by;
};
inline constexpr ise::request_response<question, answer> who{"who"};

int main() {
    asio::io_context io; // the program's own
    ise::real_environment env;
    ise::node_options alone;
    alone.use_names = false;
    ise::node names(env, alone); // a name server, where none runs
    ise::component_options port;
    port.listen = {ise::endpoint::parse("tcp://127.0.0.1:0").value()};
    port.registers = false;
    ise::name_server_options fresh;
    fresh.fresh = true;
    auto& server = names.start<ise::name_server>(std::string(ise::naming::server_path), port, fresh);
    ise::node_options options;
    options.name_servers = {server.services().listening().front()};
    ise::node node(env, options);

    for (int priority : {2, 1}) {
        ise::component_options serves;
        serves.executor = io.get_executor();
        serves.roles["demo/gateway"] = priority;
        serves.listen = {ise::endpoint::parse("udp://127.0.0.1:0").value()};
        auto path = "demo/gateway" + std::to_string(priority);
        node.start(
            path,
            [path](ise::component& self) -> ise::task<> {
                self.provide(who, [path](question) -> ise::task<answer> { co_return answer{path}; });
                co_return;
            },
            serves);
    }
    ise::component_options client;
    client.executor = io.get_executor();
    std::string first, second;
    node.start(
        "demo/client",
        [&](ise::component& self) -> ise::task<> {
            auto gateway = co_await self.find("demo/gateway", ise::role_options::failback_after(100ms));
            question ask;
            while (first != "demo/gateway2") { // the preferred one may come up last
                auto got = co_await gateway.try_call(who, ask, 5s);
                if (got) first = got->by;
                co_await self.sleep(10ms);
            }
            node.stop("demo/gateway2");
            while (second != "demo/gateway1") {
                auto got = co_await gateway.try_call(who, ask, 5s);
                if (got) second = got->by;
                co_await self.sleep(10ms);
            }
            node.stop();
        },
        client);

    auto busy = asio::make_work_guard(io);
    std::vector<std::thread> threads;
    for (int i = 0; i < 4; ++i) threads.emplace_back([&io] { io.run(); });
    node.wait(); // until all three have stopped
    names.stop();
    busy.reset();
    for (auto& one : threads) one.join();
    std::printf("%s, then %s\n", first.c_str(), second.c_str());
    return first == "demo/gateway2" && second == "demo/gateway1" ? 0 : 1;
}
