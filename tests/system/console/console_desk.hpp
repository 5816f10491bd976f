// A console on the virtual world, as its windows see it.
#pragma once
#include <system/atirma/sea.hpp>

#include <components/gui_client/gui_client.hpp>

#include <support/catch.hpp>

namespace console_test {

using namespace std::chrono_literals;
using namespace atirma;
using namespace atirma::console;

inline ise::node_options quiet(bool names = false) {
    ise::node_options options;
    options.use_names = names;
    options.log = {};
    return options;
}

/// A console on a host of its own, as its windows see it.
struct desk {
    desk(ise::sim::world& world, const std::string& host, gui_client_options options, const std::string& path = "",
         bool names = false)
        : port(options.port) {
        ise::component_options where;
        where.listens = !path.empty();
        if (where.listens) where.listen = {ise::endpoint::parse("tcp://0.0.0.0:0").value()};
        std::map<std::string, std::string> variables;
        if (names) variables["ISE_NAME_SERVER"] = "tcp://" + world.host("ns").address() + ":7400";
        process = &world.host(host).start_process(
            "console",
            [options, where, path, names](ise::sim::process& here) -> std::shared_ptr<void> {
                auto node = std::make_shared<ise::node>(here, quiet(names));
                node->start<gui_client>(path, where, options);
                return node;
            },
            variables);
    }
    std::shared_ptr<const snapshot> see() const { return port->latest(); }
    const command_entry* last_command() const {
        auto all = see()->commands;
        return all->empty() ? nullptr : &all->back();
    }
    const alarm_entry* alarm_of(const std::string& key) {
        held = see();
        for (const auto& one : held->alarms)
            if (one.key == key) return &one;
        return nullptr;
    }
    std::shared_ptr<operator_port> port;
    std::shared_ptr<const snapshot> held;
    ise::sim::process* process = nullptr;
};

inline gui_client_options at_the_proxy() {
    gui_client_options options;
    options.proxies = {"tcp://shore:7411"};
    return options;
}

inline give_command set_mode(sailing_mode mode) {
    give_command made;
    made.command = commands::set_mode{mode};
    made.valid_s = 300;
    return made;
}

inline bool works(const desk& at) {
    return at.see()->boat.position && at.see()->boat.sailing && !at.see()->links.empty() &&
           at.see()->links[0].connected;
}

inline const std::vector<waypoint> triangle{
    {28.1530, -15.4480}, {28.1600, -15.4520}, {28.1545, -15.4580}, {28.1540, -15.4500}};

} // namespace console_test
