// A system of several hosts with a name server on one of them, for tests on the virtual world.
#pragma once
#include <ise/component/node.hpp>
#include <ise/core/log.hpp>
#include <ise/name_server/name_server.hpp>
#include <ise/sim/world.hpp>

#include <support/catch.hpp>

#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace names_test {

using namespace std::chrono_literals;

struct number {
    std::int64_t value = 0;
};

inline constexpr ise::request_response<number, number> twice{"twice"};
inline constexpr ise::subscription<number> count{"count"};

inline ise::node_options node_options() {
    ise::node_options options;
    options.log = std::getenv("ISE_TEST_LOG") ? ise::log_to_stderr(ise::log_level::debug)
                                              : ise::log_sink([](const ise::log_record&) {});
    return options;
}

inline ise::component_options everywhere(const std::string& at = "tcp://0.0.0.0:0") {
    ise::component_options options;
    options.listen = {ise::endpoint::parse(at).value()};
    return options;
}

/// Doubles numbers, and publishes one ten times a second.
class doubler final : public ise::component {
    ise::task<> run() override {
        provide(twice, [](number rq) {
            number answer{rq.value * 2};
            return answer;
        });
        auto out = publish(count);
        for (std::int64_t n = 1;; ++n) {
            co_await sleep(100ms);
            out(number{n});
        }
    }
};

/// What a process of a test runs: a node, and what the test wants to look at.
struct program {
    explicit program(ise::sim::process& env, ise::node_options options = node_options())
        : node(env, std::move(options)) {}
    ise::node node;
};

using body = std::function<ise::task<>(ise::component&)>;

/// A process that runs `run` and nothing else: nobody finds it, it listens nowhere and asks no name server.
inline std::shared_ptr<program> lone_program(ise::sim::process& env, body run) {
    auto options = node_options();
    options.use_names = false;
    auto made = std::make_shared<program>(env, std::move(options));
    ise::component_options silent;
    silent.listens = false;
    made->node.start("", std::move(run), std::move(silent));
    return made;
}

class system {
public:
    explicit system(bool fresh = true, std::uint64_t seed = 1, ise::registry_limits limits = ise::registry_limits(),
                    std::shared_ptr<ise::server_memory> memory = nullptr)
        : world(seed), fresh_(fresh) {
        server = &world.host("ns").start_process("names", [this, limits, memory](ise::sim::process& env) {
            auto options = node_options();
            options.use_names = false;
            auto made = std::make_shared<program>(env, std::move(options));
            ise::component_options where;
            where.listen = {ise::endpoint::parse("tcp://0.0.0.0:7400").value()};
            where.registers = false;
            ise::name_server_options terms;
            terms.limits = limits;
            terms.memory = memory;
            terms.fresh = std::exchange(fresh_, false); // the next one has been there before
            names = &made->node.start<ise::name_server>(std::string(ise::naming::server_path), where, terms);
            return made;
        });
    }

    /// A process on a host, with the system's name server.
    ise::sim::process& start(const std::string& host, const std::string& process,
                             std::function<void(ise::node&)> begin) {
        auto run = [begin, this](ise::sim::process& env) {
            auto options = node_options();
            options.log = [this, print = options.log](const ise::log_record& record) {
                if (record.level >= ise::log_level::warning) warnings.push_back(ise::format_line(record));
                print(record);
            };
            auto made = std::make_shared<program>(env, std::move(options));
            begin(made->node);
            return made;
        };
        return world.host(host).start_process(process, run,
                                              {{"ISE_NAME_SERVER", "tcp://" + world.host("ns").address() + ":7400"}});
    }
    ise::sim::process& start_doubler(const std::string& host, const std::string& path,
                                     const std::string& listens = "tcp://0.0.0.0:0") {
        return start(host, path.substr(path.rfind('/') + 1),
                     [path, listens](ise::node& node) { node.start<doubler>(path, everywhere(listens)); });
    }
    ise::sim::process& start_body(const std::string& host, const std::string& process, body run) {
        return start(host, process,
                     [process, run](ise::node& node) { node.start("test/" + process, run, everywhere()); });
    }
    bool holds(const std::string& path) const { return epoch_of(path) != 0; }
    std::uint64_t epoch_of(const std::string& path) const {
        if (!server->running() || !names->names()) return 0;
        for (const auto& event : names->names()->snapshot(path))
            if (event.name.path == path) return event.name.epoch;
        return 0;
    }
    void restart_server() { server = &server->restart(); }

    std::vector<std::string> warnings; ///< of what was started here; outlives the world, which logs to the end
    ise::sim::world world;
    ise::sim::process* server = nullptr;
    ise::name_server* names = nullptr;

private:
    bool fresh_;
};

inline ise::remote name_server_of(ise::component& self) {
    return self.at(ise::endpoint::parse(*self.env().variable("ISE_NAME_SERVER")).value());
}

} // namespace names_test
