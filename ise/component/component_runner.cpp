#include <ise/component/component_runner.hpp>

#include <ise/component/node_state.hpp>
#if __has_include(<ise/naming/name_resolver.hpp>)
#include <ise/naming/name_resolver.hpp>
#define ISE_HAS_NAMES 1
#endif
#include <ise/service/session.hpp>

#include <asio/bind_cancellation_slot.hpp>
#include <asio/co_spawn.hpp>
#include <asio/detached.hpp>

#include <fmt/format.h>

namespace ise {
namespace {

constexpr duration name_wait = std::chrono::seconds(5);

// What a component listens on unless it is told: the nearest for each who asks.
std::vector<endpoint> default_endpoints(environment& env, std::uint64_t incarnation) {
    auto unique = fmt::format("ise-{}-{:016x}", env.identity().process_id, incarnation);
    endpoint near{protocol::inproc, {}, 0, unique};
    endpoint local{protocol::local, {}, 0, "@" + unique};
    endpoint loopback{protocol::tcp, "127.0.0.1", 0, {}};
    return {near, local, loopback};
}

// A listener on every interface is reached by each of them.
std::vector<endpoint> reachable(environment& env, const endpoint& at) {
    if (at.host != "0.0.0.0" && at.host != "::") return {at};
    std::vector<endpoint> all;
    for (const auto& address : env.interface_addresses()) {
        bool v6 = address.find(':') != std::string::npos;
        if (at.host == "0.0.0.0" && v6) continue;
        auto one = at;
        one.host = address;
        all.push_back(std::move(one));
    }
    return all;
}

} // namespace

component_runner::component_runner(std::weak_ptr<node::state> of, environment& env, std::shared_ptr<loop_host> host, std::string path,
                                   std::unique_ptr<component> made, component_options options, const node_options& node, std::uint64_t incarnation)
    : node_(std::move(of)), env_(env), host_(std::move(host)), path_(std::move(path)), options_(std::move(options)), grace_(node.grace),
      names_(node.use_names), name_server_(node.name_server), log_(env, path_.empty() ? "(anonymous)" : path_, node.log),
      component_(std::move(made)), announced_wake_(host_->loop(), [this] { announced_wake_.resume(); }),
      pause_(env, std::chrono::milliseconds(200), std::chrono::seconds(30)) {
    wire::identity self;
    self.path = path_;
    self.host_name = env.identity().host_name;
    self.process_key = env.identity().process_key;
    self.incarnation = incarnation;
    auto failed = [this](const std::string& name, std::exception_ptr thrown) { log_.error(describe(thrown), {{"coroutine", name}}); };
    connections_ = std::make_unique<task_scope>(on(), failed);
    services_ = std::make_unique<service_host>(env, on(), *connections_, std::move(self), node.services, log_);
    report_.path = path_;
    component_->runner_ = this;
}

component_runner::~component_runner() = default;

void component_runner::start() {
#ifdef ISE_HAS_NAMES
    if (names_ && name_server_) services_->use_resolver(std::make_shared<name_resolver>(*services_, *name_server_));
#endif
    services_->services().add(make_call_service(*services_, describe_service, [this](const describe_request&) { return describe_self(); })).value();
    if (options_.listens) {
        auto wanted = options_.listen.empty() ? default_endpoints(env_, services_->self().incarnation) : options_.listen;
        for (const auto& at : wanted) services_->listen(at).value();
    }
    begin_flow();
}

void component_runner::begin_flow() {
    flow_ = std::make_unique<task_scope>(on(), [this](const std::string& name, std::exception_ptr thrown) { on_child_failure(name, thrown); });
    flow_->spawn("run", component_->run());
    // Posted behind the flow's first step: it has provided what it provides before it first suspends.
    if (!component_->announce_when_ready_)
        asio::post(on().get_executor(), [self = shared_from_this()] { self->announce(); });
}

void component_runner::announce() {
    if (announcing_ || stop_asked_) return;
    announcing_ = true;
    auto expected = component_state::starting;
    state_.compare_exchange_strong(expected, component_state::ready);
    auto owner = node_.lock();
    if (path_.empty() || !options_.registers || !owner || !owner->names) {
        announced_ = true;
        announced_wake_.resume();
        return;
    }
    connections_->spawn("registration", enroll(shared_from_this()));
}

task<> component_runner::enroll([[maybe_unused]] std::shared_ptr<component_runner> self) {
    auto owner = node_.lock();
    if (!owner) co_return;
    // On the node's loop; not cancelled from here, it ends by its deadline.
    auto asked = owner->enroll(describe_for_names(), name_wait);
    auto granted = co_await asio::co_spawn(owner->loop().get_executor(), std::move(asked),
                                           asio::bind_cancellation_slot(asio::cancellation_slot(), asio::use_awaitable));
    if (granted) {
        services_->set_epoch(*granted);
        log_.info("registered", {{"epoch", std::to_string(*granted)}});
    } else if (granted.error().code() == errc::name_taken) {
        {
            std::lock_guard lock(report_mutex_);
            report_.failure = granted.error().message();
        }
        log_.error(granted.error().message());
        stop();
    } else {
        log_.warning(granted.error().message());
    }
    announced_ = true;
    announced_wake_.resume();
}

task<> component_runner::ready() {
    announce();
    while (!announced_) co_await announced_wake_.wait();
}

registration component_runner::describe_for_names() const {
    registration made;
    made.path = path_;
    made.incarnation = services_->self().incarnation;
    made.state = name_of(state());
    for (const auto& at : services_->listening())
        for (auto& one : reachable(env_, at)) made.endpoints.push_back(std::move(one));
    made.endpoints.insert(made.endpoints.end(), options_.advertise.begin(), options_.advertise.end());
    made.services = services_->services().describe();
    return made;
}

void component_runner::services_changed() {
    if (!announcing_ || path_.empty() || !options_.registers) return;
    auto owner = node_.lock();
    if (!owner || !owner->names) return;
    asio::post(owner->loop().get_executor(), [owner, told = describe_for_names()]() mutable { owner->names->update(std::move(told)); });
}

void component_runner::add(std::shared_ptr<call_service> service) {
    auto name = service->name();
    services_->schemas().add_own(service->types());
    services_->services().add(std::move(service)).value();
    own_services_.push_back(name);
    services_changed();
}

void component_runner::add(std::shared_ptr<publication_core> service) {
    auto name = service->name();
    services_->schemas().add_own(service->types());
    services_->services().add(std::move(service)).value();
    own_services_.push_back(name);
    services_changed();
}

void component_runner::withdraw_service(const std::string& name) {
    services_->services().remove(name);
    std::erase(own_services_, name);
    services_changed();
}

void component_runner::declare_required(const std::string& name, const packet_types& types) {
    services_->services().declare_required(name, types);
    services_changed();
}

component_text component_runner::describe_self() const {
    component_text made;
    made.path = path_;
    made.state = name_of(state());
    made.incarnation = services_->self().incarnation;
    made.epoch = services_->self().epoch;
    made.host_name = env_.identity().host_name;
    made.process_id = env_.identity().process_id;
    for (const auto& at : services_->listening()) made.endpoints.push_back(at.text());
    for (const auto& one : services_->services().describe()) {
        service_text text;
        text.name = one.name;
        text.kind = static_cast<std::uint8_t>(one.kind);
        text.provided = one.provided;
        for (const auto& packet : one.types->schemas) text.packets.push_back(packet_text{packet.fingerprint(), packet.text()});
        made.services.push_back(std::move(text));
    }
    for (const auto& [raw, held] : services_->sessions()) {
        session_text text;
        text.peer = held->peer_name();
        text.bytes_in = held->wire().counts().bytes_in;
        text.bytes_out = held->wire().counts().bytes_out;
        text.round_trip_ns = held->wire().round_trip().count();
        made.sessions.push_back(std::move(text));
    }
    const auto& counts = services_->counts();
    made.calls_served = counts.calls_served;
    made.packets_published = counts.packets_published;
    made.packets_dropped = counts.packets_dropped;
    return made;
}

void component_runner::on_child_failure(const std::string& name, std::exception_ptr thrown) {
    auto text = fmt::format("{}: {}", name, describe(thrown));
    log_.error("an exception escaped", {{"coroutine", name}, {"cause", describe(thrown)}});
    {
        std::lock_guard lock(report_mutex_);
        report_.failure = text;
    }
    if (stop_asked_) return;
    switch (options_.policy) {
        case on_failure::stop_component: stop(); break;
        case on_failure::stop_node:
            stop();
            if (auto owner = node_.lock()) owner->stop_all();
            break;
        case on_failure::restart:
            if (!std::exchange(restarting_, true)) connections_->spawn("restart", restart());
            break;
    }
}

task<> component_runner::restart() {
    flow_->stop();
    co_await flow_->join_until(saturating_add(on().now(), grace_));
    if (flow_->size() > 0) {
        log_.error("cannot be restarted: coroutines of its last flow still run", {{"count", std::to_string(flow_->size())}});
        stop();
        co_return;
    }
    for (const auto& name : std::vector(own_services_)) withdraw_service(name);
    co_await sleep_for(on(), pause_.next());
    restarting_ = false;
    log_.info("restarts");
    begin_flow();
}

void component_runner::stop() {
    if (stop_asked_.exchange(true)) return;
    asio::post(on().get_executor(), [self = shared_from_this()] {
        asio::co_spawn(self->on().get_executor(), shut_down(self), asio::detached);
    });
}

// Its own coroutines first, then its sessions say goodbye, then everything that carried them.
task<> component_runner::shut_down(std::shared_ptr<component_runner> self) {
    auto& me = *self;
    auto limit = saturating_add(me.on().now(), me.grace_);
    me.state_ = component_state::stopping;
    if (auto owner = me.node_.lock(); owner && owner->names && me.announcing_ && !me.path_.empty() && me.options_.registers)
        asio::co_spawn(owner->loop().get_executor(), owner->names->withdraw(me.path_), asio::detached);

    std::vector<std::string> still;
    auto note = [&still](const task_scope& scope) {
        auto names = scope.running();
        still.insert(still.end(), names.begin(), names.end());
    };
    if (me.flow_) {
        me.flow_->stop();
        bool ended = co_await me.flow_->join_until(limit);
        if (!ended) note(*me.flow_);
    }
    me.services_->stop(me.grace_ / 2);
    auto goodbye = saturating_add(me.on().now(), me.grace_ / 2);
    while (!me.services_->sessions().empty() && me.on().now() < goodbye) co_await sleep_for(me.on(), std::chrono::milliseconds(2));
    me.connections_->stop();
    bool closed = co_await me.connections_->join_until(saturating_add(me.on().now(), me.grace_));
    if (!closed) note(*me.connections_);
    bool failed = false;
    {
        std::lock_guard lock(me.report_mutex_);
        me.report_.still_running = still;
        failed = !me.report_.failure.empty();
    }
    for (const auto& name : still) me.log_.error("a coroutine did not end in time", {{"coroutine", name}});
    if (still.empty()) {
        me.component_.reset();
        me.flow_.reset();
    }
    me.state_ = failed ? component_state::failed : component_state::stopped;
    if (auto owner = me.node_.lock()) owner->on_stopped();
}

void component_runner::on_name_change(result<std::uint64_t> epoch) {
    asio::post(on().get_executor(), [self = shared_from_this(), epoch] {
        if (epoch) {
            self->services_->set_epoch(*epoch);
            return;
        }
        self->log_.error(epoch.error().message());
        {
            std::lock_guard lock(self->report_mutex_);
            self->report_.failure = epoch.error().message();
        }
        self->stop();
    });
}

bool component_runner::poke() {
    if (state() == component_state::stopped || state() == component_state::failed) return true;
    if (poked_.exchange(true)) return false;
    asio::post(on().get_executor(), [self = shared_from_this()] { self->poked_ = false; });
    return true;
}

stop_report component_runner::report() const {
    std::lock_guard lock(report_mutex_);
    return report_;
}

} // namespace ise
