// Components that a name server knows, for the command line to find.
#pragma once
#include "boat.hpp"

#include <ise/name_server/name_server.hpp>
#include <ise/naming/services.hpp>
#include <ise/service/service_host.hpp>

#include <support/program.hpp>

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace cli_test {

/// A name server and two boats that it knows, on real sockets.
class port {
public:
    port() : names(env, without_names()) {
        ise::component_options options;
        options.listen = {ise::endpoint::parse("tcp://127.0.0.1:0").value()};
        options.registers = false;
        ise::name_server_options fresh;
        fresh.fresh = true;
        auto& server = names.start<ise::name_server>(std::string(ise::naming::server_path), options, fresh);
        at = server.services().listening().front();
        boats.emplace(env, with_names(at));
        for (const char* path : {"atirma/boat", "atirma/shore/xbee"}) {
            auto& one = boats->start<boat>(path);
            one.wait(one.ready());
        }
    }

    /// Two more that serve the role atirma/gateway.
    void start_gateways() {
        for (int priority : {1, 7}) {
            ise::component_options options;
            options.roles["atirma/gateway"] = priority;
            auto& one = boats->start<boat>("shore/gateway" + std::to_string(priority), options);
            one.wait(one.ready());
        }
    }

    ise_test::ran ise(std::vector<std::string> arguments) {
        arguments.insert(arguments.begin(), {"ise", "--name-server", at.text()});
        return ise_test::run_program(std::move(arguments));
    }

    ise::real_environment env;
    ise::node names;
    ise::endpoint at;
    std::optional<ise::node> boats;

private:
    static ise::node_options without_names() {
        ise::node_options options;
        options.use_names = false;
        options.log = {};
        return options;
    }
    static ise::node_options with_names(const ise::endpoint& server) {
        ise::node_options options;
        options.name_servers = {server};
        options.log = std::getenv("ISE_TEST_LOG") ? ise::log_to_stderr(ise::log_level::debug) : ise::log_sink();
        return options;
    }
};

} // namespace cli_test
