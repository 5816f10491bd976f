#include <ise/instantiation/access.hpp>
#include <ise/instantiation/changes.hpp>
#include <ise/instantiation/instantiation_server.hpp>
#include <ise/instantiation/output_feed.hpp>
#include <ise/instantiation/start_checks.hpp>
#include <ise/instantiation/takeover.hpp>
#include <ise/naming/services.hpp>
#include <ise/service/service_host.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise::instantiation {

std::string path_of_host(std::string_view host_name) {
    std::string name;
    for (char letter : host_name.substr(0, 100))
        name += letter != '/' && naming::is_path(std::string_view(&letter, 1)) ? letter : '-';
    return fmt::format("{}/{}", hosts_path, name.empty() ? "unnamed" : name);
}

result<void> may_listen(const endpoint& at, const security& credentials) {
    auto demanding = credentials;
    demanding.demanded = true;
    auto may = demanding.may_listen(at);
    if (may) return {};
    return failure(may.error().code(),
                   fmt::format("an instantiation server starts programs: {}", may.error().message()));
}

/// Each part knows those before it.
struct instantiation_server::parts {
    parts(server_context& context, remote name_server);
    void publish();
    void provide();
    void stop();

    server_context& here;
    publication<std::remove_const_t<decltype(services::events)>> events;
    installed_types types;
    instance_table table;
    state_keeper state;
    supervisor instances;
    prober probes;
    instance_names names;
    shared_processes shared;
    launcher processes;
    starts starting;
    changes changing;
    start_checks checking;
    takeover former;
    std::unique_ptr<output_feed> output; // once there is something to look at

private:
    supervisor::actions actions();
    // Of an instance; empty: there is none.
    std::string type_of(const std::string& path) const {
        auto one = table.find(path);
        return one ? one->asked.type : std::string();
    }
};

instantiation_server::parts::parts(server_context& context, remote name_server)
    : here(context), types(here), table(here), state(here, table), instances(here, table, state, actions()),
      probes(here, instances), names(here, instances, std::move(name_server)),
      shared(here, table, state, instances, names), processes(here, types, state, instances, names, shared),
      starting(here, types, table, instances, names, shared),
      changing(here, types, table, state, instances, probes, shared, starting),
      checking(here, types, table, names, shared), former(here, types, instances, names, shared, processes) {}

supervisor::actions instantiation_server::parts::actions() {
    supervisor::actions made;
    made.launch = [this](const instance_ptr& one) {
        here.self.spawn("launch " + one->plan.path, processes.launch(one, one->life));
    };
    made.changed = [this](const instance_ptr& one) {
        probes.begin(one);
        if (!one->asked.process.empty()) shared.tend();
    };
    made.publish = [this](const host_event& event) {
        events.publish_if(event, [&](const subscriber_info& who) {
            auto by = peer_of(who);
            return !objection_to_read(here, &by, event.instance.path, false);
        });
    };
    return made;
}

void instantiation_server::parts::publish() {
    events = here.self.publish(services::events);
    output = std::make_unique<output_feed>(here, table);
}

void instantiation_server::parts::provide() {
    auto& self = here.self;
    self.provide(services::types, [this](types_request) { return types.describe(); });
    self.provide(services::start, [this](start_request request, const call_context& by) {
        return starting.start(std::move(request), by.verified);
    });
    self.provide(services::restart, [this](restart_request request, const call_context& by) {
        auto one = table.find(request.path);
        check_access(here, by.verified, access::action::stop, request.path, type_of(request.path));
        check_start(here, by.verified, request.path, one ? one->asked : start_request());
        return starting.restart(std::move(request.path));
    });
    self.provide(services::stop, [this](stop_request request, const call_context& by) {
        check_access(here, by.verified, access::action::stop, request.path, type_of(request.path));
        return starting.end(std::move(request), false);
    });
    self.provide(services::kill, [this](kill_request request, const call_context& by) {
        check_access(here, by.verified, access::action::stop, request.path, type_of(request.path));
        stop_request at_once;
        at_once.path = std::move(request.path);
        return starting.end(std::move(at_once), true);
    });
    self.provide(services::set, [this](set_request request, const call_context& by) {
        for (const auto& [name, value] : request.settings) check_setting(here, by.verified, request.path, name);
        return changing.set(std::move(request));
    });
    self.provide(services::change, [this](change_request request, const call_context& by) {
        return changing.change(std::move(request), by.verified);
    });
    self.provide(services::check, [this](checks_request request) { return checking.check(std::move(request)); });
    self.provide(services::instances, [this](instances_request request, const call_context& by) {
        instances_response made;
        for (const auto& [path, one] : table.instances())
            if (naming::lies_below(path, request.prefix) && !objection_to_read(here, by.verified, path, false))
                made.instances.push_back(table.info_of(*one));
        return made;
    });
    self.provide(services::last_output, [this](output_request request, const call_context& by) {
        constexpr std::uint32_t most = 1 << 20;
        if (auto denied = objection_to_read(here, by.verified, request.path, true)) throw error(std::move(*denied));
        auto piece = table.at(request.path)->output->last(std::min(request.max_bytes, most));
        piece.path = request.path;
        return piece;
    });
}

void instantiation_server::parts::stop() {
    here.stopping = true;
    output->stop();
    instances.stop();
    shared.stop();
}

instantiation_server::instantiation_server(machine& host, server_options options)
    : here_{*this, host, std::move(options)} {
    announce_when_ready();
}
instantiation_server::~instantiation_server() = default;

task<> instantiation_server::run() {
    here_.stopping = took_over_ = false; // a run before this one may have failed
    for (const auto& at : this->services().listening()) may_listen(at, this->services().peers().credentials()).value();
    parts_ = std::make_unique<parts>(here_, at(here_.options.name_servers, std::string(naming::server_path)));
    parts_->publish(); // at once: subscribers of the server before may come back
    struct ending {    // whatever ends from now on
        parts& all;
        ~ending() { all.stop(); }
    } guard{*parts_};
    co_await parts_->types.refresh();
    for (const auto& problem : parts_->types.known().problems()) log().warning(problem);
    parts_->former.restore(parts_->state.load());
    took_over_ = true;
    parts_->state.begin();
    parts_->provide(); // a request before would be answered, or carried out, without what runs already
    co_await ready();
    co_await sleep_till(time_point::max());
}

} // namespace ise::instantiation
