// ise stop, ise restart, ise kill: one component that an instantiation server has started.
#include "hosts.hpp"
#include "options.hpp"

#include <memory>

namespace ise::cli {
namespace {

namespace host_services = instantiation::services;

struct instance_options {
    std::string name, host;
    std::optional<duration> grace; ///< of a stop
};

task<> stop(context& in, instance_options options) {
    auto found = co_await find_instance(in, options.host, options.name);
    instantiation::stop_request request{options.name, options.grace};
    auto response = co_await found.host.server.try_call(host_services::stop, std::move(request), in.left());
    if (!response) throw problem(response.error());
    co_await print_instance(in, found.host.name, std::move(response->ended));
}

task<> kill(context& in, instance_options options) {
    auto found = co_await find_instance(in, options.host, options.name);
    instantiation::kill_request request{options.name};
    auto response = co_await found.host.server.try_call(host_services::kill, std::move(request), in.left());
    if (!response) throw problem(response.error());
    co_await print_instance(in, found.host.name, std::move(response->ended));
}

task<> restart(context& in, instance_options options) {
    auto found = co_await find_instance(in, options.host, options.name);
    instantiation::restart_request request{options.name};
    auto response = co_await found.host.server.try_call(host_services::restart, std::move(request), in.left());
    if (!response) throw problem(response.error());
    auto what = started(*response);
    co_await print_instance(in, found.host.name, std::move(what));
}

template <task<> (*act)(context&, instance_options)>
void declare_for_one(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<instance_options>();
    app.add_option("INSTANCE", given->name, "its path: ise ps")->required();
    add_host(app, given->host);
    if constexpr (act == stop) add_time(app, "--grace", given->grace, "between SIGTERM and SIGKILL (default: its own)");
    app.callback([&made, given] {
        constexpr duration usual_grace = std::chrono::seconds(10), until_it_is_gone = std::chrono::seconds(10);
        made.patience = given->grace.value_or(usual_grace) + until_it_is_gone + besides_own_terms;
        made.work = [given](context& in) { return act(in, *given); };
    });
}

} // namespace

extern const command stop_command{"stop", run_group, "stops a component, with all that it started itself",
                                  "  ise stop sea/wind\n", declare_for_one<stop>};

extern const command restart_command{"restart", run_group, "stops and starts a component with the same arguments",
                                     "  ise restart sea/wind\n", declare_for_one<restart>};

extern const command kill_command{"kill", run_group, "ends a component at once; it is not started again",
                                  "  ise kill sea/wind\n", declare_for_one<kill>};

} // namespace ise::cli
