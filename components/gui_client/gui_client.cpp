#include <components/gui_client/gui_client.hpp>
#include <ise/naming/name_servers.hpp>

#include <components/boat/find_component.hpp>
#include <components/boat/recall.hpp>
#include <components/gui_client/mission_control.hpp>
#include <components/gui_client/node_follower.hpp>
#include <components/gui_client/provider_search.hpp>
#include <components/gui_client/proxy_follower.hpp>

#include <fmt/format.h>

namespace atirma::console {
namespace {
using namespace std::chrono_literals;
constexpr ise::duration settling_time = 10s, parameter_deadline = 15s;
constexpr auto remembers_alarms = 10min;
} // namespace

struct gui_client::parts {
    parts(ise::component& self, const gui_client_options& options)
        : state(options.state), context{self, state, std::string(), false}, proxies(context),
          nodes(context, options.communication, options.look_back, options.state.max_links),
          search(context, options.space, options.name_servers,
                 [this](const auto& path, const auto& services) { follow(path, services); }),
          authority(context), sender(context, authority), mission(context, sender, options.tick),
          outlets(context, options.outlets) {}

    void start(const gui_client_options& options);
    void report(const gui_client_options& options);

    // What the operator does.
    void act(give_command what) { spawn("telecommand", give(std::move(what))); }
    void act(sail_to what) { spawn("sail to a place", mission.sail(std::move(what))); }
    void act(const call_back_command& what) { spawn("call back", sender.call_back(what.id)); }
    void act(change_authority what) { spawn("authority", authority.change(std::move(what))); }
    void act(upload_mission what) { mission.upload(std::move(what)); }
    void act(cancel_upload) { mission.cancel(); }
    void act(set_xbee_parameter what) { spawn("modem parameter", set_modem(std::move(what))); }
    void act(const acknowledge_alarm& what) { state.acknowledge(what.key, context.clock()); }
    void act(const remember_alarms& what) { state.remember(what.before, context.clock() + remembers_alarms); }
    void act(const set_limits& what) { state.set_limits(what.limits); }
    void act(forget_track) { state.clear_track(); }

    void follow(const std::string& path, const std::set<std::string>& services);
    void spawn(std::string name, ise::task<> body) { context.self.spawn(std::move(name), std::move(body)); }
    ise::task<> give(give_command what) { co_await sender.execute(std::move(what)); }
    ise::task<> set_modem(set_xbee_parameter what);

    console_state state;
    client_context context;
    proxy_follower proxies;
    node_follower nodes;
    provider_search search;
    authority_client authority;
    telecommand_sender sender;
    mission_control mission;
    alarm_outlets outlets;
};

void gui_client::parts::start(const gui_client_options& options) {
    state.set_self(context.self.path());
    for (const auto& path : options.proxies) proxies.follow(path, proxy_follower::followed_services());
    search.start();
    outlets.start();
}

void gui_client::parts::follow(const std::string& path, const std::set<std::string>& services) {
    // A node has what all proxies have: the role is followed, not each node.
    bool is_node = services.contains(std::string(services::communication.name()));
    if (is_node) nodes.follow(path);
    else proxies.follow(path, services);
}

void gui_client::parts::report(const gui_client_options& options) {
    proxies.report();
    nodes.report();
    finding_view finding;
    finding.uses_names = search.uses_names();
    finding.where = ise::text_of(options.name_servers);
    for (const auto& path : options.proxies) finding.where += (finding.where.empty() ? "" : ", ") + path;
    finding.looking_for = "telemetry below " + options.space;
    finding.reached = search.health().reached();
    finding.trouble = search.health().trouble();
    state.on_finding(std::move(finding));
}

ise::task<> gui_client::parts::set_modem(set_xbee_parameter what) {
    xbee_param_request request;
    request.name = what.name;
    request.value = what.value;
    auto show = [&](std::string text) {
        state.on_xbee_answer(what.path, std::move(text));
        context.news();
    };
    show(fmt::format("sets {} to {}…", what.name, what.value));
    auto proxy = find_component(context.self, what.path);
    auto answer = co_await proxy.try_call(services::xb_local_param, request, parameter_deadline);
    show(answer ? fmt::format("{} is {} now", answer->meaning, answer->value) : answer.error().message());
}

gui_client::gui_client(gui_client_options options)
    : options_(std::move(options)), parts_(std::make_unique<parts>(*this, options_)) {
    if (!options_.port) options_.port = std::make_shared<operator_port>();
}
gui_client::~gui_client() { options_.port->close(); }

const console_state& gui_client::state() const noexcept { return parts_->state; }

ise::task<> gui_client::run() {
    parts_ = std::make_unique<parts>(*this, options_);
    struct closing {
        operator_port& port;
        ~closing() { port.close(); }
    } guard{*options_.port};
    options_.port->open(on().gate(), [this] {
        for (auto& what : options_.port->take()) std::visit([this](auto& one) { parts_->act(std::move(one)); }, what);
        parts_->context.news();
    });
    require(services::telemetry);
    require(services::telecommand);
    require(services::raw_telecommand);
    require(services::telecommand_state);
    require(services::telecommand_recall);
    require(services::xb_local);
    require(services::xb_local_param);
    require(services::authority);
    require(services::communication);
    parts_->start(options_);
    // At first only some of what is there has been heard: no alarm is raised for the rest.
    for (auto settled = now() + settling_time;;) {
        if (now() >= settled && parts_->state.on_time(parts_->context.clock())) parts_->context.news();
        parts_->outlets.take(parts_->state.take_alarm_events());
        publish_snapshot();
        co_await sleep(options_.tick);
    }
}

void gui_client::publish_snapshot() {
    parts_->report(options_);
    auto& context = parts_->context;
    if (!context.changed && now() - published_ < options_.max_quiet && published_ != ise::time_point{}) return;
    context.changed = false;
    published_ = now();
    options_.port->publish(parts_->state.view(context.clock()));
}

} // namespace atirma::console
