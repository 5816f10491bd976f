#include <ise/component/component_runner.hpp>

#include <ise/access/guard.hpp>
#include <ise/call/pending_call.hpp>
#include <ise/call/provide.hpp>
#include <ise/component/access_services.hpp>
#include <ise/component/health.hpp>
#include <ise/component/served_calls.hpp>
#include <ise/component/served_runs.hpp>
#include <ise/core/async_run.hpp>
#include <ise/core/limits.hpp>
#include <ise/core/listed_waiter.hpp>
#include <ise/core/real/ownership.hpp>
#include <ise/core/use_task.hpp>
#include <ise/naming/name_resolver.hpp>
#include <ise/service/session.hpp>
#include <ise/subscription/publication_core.hpp>

#include <asio/post.hpp>

#include <fmt/format.h>

#include <cxxabi.h>

#include <algorithm>
#include <cstdlib>
#include <set>
#include <typeinfo>

namespace ise {
namespace {

constexpr duration name_wait = std::chrono::seconds(5);

// What a component listens on unless it is told: the nearest for each who asks.
std::vector<endpoint> default_endpoints(environment& env, std::uint64_t incarnation) {
    auto unique = fmt::format("ise-{}-{:016x}", env.identity().process_id, incarnation);
    std::vector<endpoint> nearest_first;
    for (auto kind : all_transports())
        if (kind->by_default) nearest_first.push_back(endpoint::any_of(kind, unique));
    std::ranges::stable_sort(nearest_first, {}, [](const endpoint& at) { return at.kind->rank; });
    return nearest_first;
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

// The class of a component for people; empty for one that is a bare coroutine.
std::string class_of(const runnable& of) {
    int status = 0;
    std::unique_ptr<char, decltype(&std::free)> name(abi::__cxa_demangle(typeid(of).name(), nullptr, nullptr, &status),
                                                     &std::free);
    std::string_view text = name ? name.get() : "";
    constexpr std::string_view anonymous = "(anonymous namespace)::";
    if (auto at = text.find(anonymous); at != text.npos) text.remove_prefix(at + anonymous.size());
    return text == "coroutine_component" ? std::string() : std::string(text);
}

} // namespace

component_runner::component_runner(std::weak_ptr<component_owner> of, environment& env,
                                   std::shared_ptr<loop_share> share, std::string path, std::unique_ptr<runnable> made,
                                   component_options options, const node_options& node, const security& credentials,
                                   std::uint64_t incarnation)
    : node_(std::move(of)), env_(env), share_(std::move(share)), path_(std::move(path)), options_(std::move(options)),
      grace_(node.grace), names_(node.use_names), name_servers_(node.name_servers),
      log_(env, path_.empty() ? "(anonymous)" : path_, node.log), component_(std::move(made)),
      pause_(env, std::chrono::milliseconds(200), std::chrono::seconds(30)) {
    wire::identity self;
    self.path = path_;
    self.host_name = env.identity().host_name;
    self.process_key = env.identity().process_key;
    self.incarnation = incarnation;
    auto failed = [this](const std::string& name, std::exception_ptr thrown) {
        log_.error(describe(thrown), {{"coroutine", name}});
    };
    connections_ = std::make_unique<task_scope>(on(), failed);
    services_ =
        std::make_unique<service_host>(env, on(), *connections_, std::move(self), node.services, log_, credentials);
    signs_ = services_->signs();
    signs_->on_shorter([owner = node_, signs = signs_.get()] {
        if (auto held = owner.lock()) held->watch_sooner(signs->min_heartbeat());
    });
    services_->uses().on_change = [this] { services_changed(); };
    report_.path = path_;
    tell_roles();
    component_->runner_ = this;
    ++share_->unfinished;
}

component_runner::~component_runner() = default;

void component_runner::start() {
    if (stop_asked_) throw error(errc::cancelled, fmt::format("'{}' was stopped before it started", path_));
    try {
        open();
    } catch (...) {
        services_->stop(duration{}); // nobody may come in any more
        stop();
        throw;
    }
}

void component_runner::open() {
    services_->follow_access();
    if (names_ && !name_servers_.empty())
        services_->use_resolver(std::make_shared<name_resolver>(*services_, name_servers_));
    services_->services()
        .add(make_call_service(*services_, describe_service,
                               [this](const describe_request&) { return describe_self(); }))
        .value();
    services_->services()
        .add(make_call_service(*services_, health_service,
                               [this](const health_request&) { return health_of(*services_); }))
        .value();
    if (services_->access())
        services_->services()
            .add(make_call_service(*services_, access_service,
                                   [this](const access_request&, const call_context& by) { return tell_access(by); }))
            .value();
    provide_served_calls(*services_);
    provide_served_runs(*services_);
    if (options_.listens) {
        auto wanted = options_.listen.empty() ? default_endpoints(env_, incarnation()) : options_.listen;
        services_->acceptor().advertise(options_.advertise);
        services_->acceptor().hold(); // until it has provided its services
        for (const auto& at : wanted) services_->listen(at).value();
    }
    make_flow();
    // Whoever starts it does not wait for its first step, which may take its time.
    asio::post(on().get_executor(), [self = shared_from_this()] { self->begin_flow(); });
}

void component_runner::make_flow() {
    flow_ = std::make_unique<task_scope>(
        on(), [this](const std::string& name, std::exception_ptr thrown) { on_child_failure(name, thrown); });
}

void component_runner::begin_flow() {
    if (stop_asked_) return;
    flow_began_ = on().now();
    try {
        flow_->spawn("run", component_->run());
    } catch (...) { // a run() that is no coroutine
        on_child_failure("run", std::current_exception());
    }
    // Posted behind the flow's first step: it has provided what it provides before it first suspends.
    asio::post(on().get_executor(), [self = shared_from_this()] {
        self->services_->acceptor().begin();
        if (!self->component_->announce_when_ready_) self->announce();
    });
}

void component_runner::announce() {
    if (stop_asked_) return;
    auto expected = component_state::starting;
    bool news = state_.compare_exchange_strong(expected, component_state::ready);
    if (!name_lost_) services_->go_on();
    if (std::exchange(announcing_, true)) {
        if (news) services_changed(); // it was restarted
        return;
    }
    auto owner = node_.lock();
    if (path_.empty() || !options_.registers || !owner || !owner->names()) {
        tell_announced();
        return;
    }
    connections_->spawn("registration", enroll(shared_from_this()));
}

task<> component_runner::enroll([[maybe_unused]] std::shared_ptr<component_runner> self) {
    auto owner = node_.lock();
    if (!owner) co_return;
    // On the node's loop; not cancelled from here, it ends by its deadline.
    co_await this_task::ignore_cancellation;
    auto asked = owner->names()->enroll(describe_for_names(), name_wait);
    auto granted = co_await async_run(owner->loop().get_executor(), std::move(asked), use_task);
    if (granted) {
        services_->set_epoch(*granted);
        log_.info("registered", {{"epoch", std::to_string(*granted)}});
    } else if (granted.error().code() == errc::name_taken) {
        log_.error(granted.error().message());
        stop_as_failed(granted.error().message());
    } else {
        log_.warning(granted.error().message());
    }
    tell_announced();
}

void component_runner::tell_announced() {
    announced_ = true;
    for (auto* waiting : awaiting_announced_) waiting->resume();
}

task<> component_runner::ready() {
    announce();
    listed_waiter result(on(), awaiting_announced_);
    while (!announced_) co_await result.wait();
}

registration component_runner::describe_for_names() const {
    registration made;
    made.path = path_;
    made.type = class_of(*component_);
    made.incarnation = incarnation();
    made.state = name_of(state());
    for (const auto& at : services_->listening())
        for (auto& one : reachable(env_, at)) made.endpoints.push_back(std::move(one));
    made.endpoints.insert(made.endpoints.end(), options_.advertise.begin(), options_.advertise.end());
    made.services = services_->services().describe();
    made.roles = options_.roles;
    made.waits_for = services_->uses().summary();
    return made;
}

void component_runner::services_changed() {
    if (!announcing_ || path_.empty() || !options_.registers) return;
    auto owner = node_.lock();
    if (!owner || !owner->names()) return;
    owner->loop().gate()->post(
        [owner, info = describe_for_names()]() mutable { owner->names()->update(std::move(info)); });
}

void component_runner::add(std::shared_ptr<call_service> service) {
    auto name = service->name();
    services_->services().add(std::move(service)).value();
    own_services_.push_back(name);
    services_changed();
}

void component_runner::add(std::shared_ptr<publication_core> service) {
    auto name = service->name();
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

void component_runner::serve_role(const std::string& role, std::int32_t priority) {
    if (!naming::is_path(role))
        throw error(errc::invalid_argument,
                    fmt::format("'{}' is not a role: write it like a component's path, atirma/gateway", role));
    if (role == path_)
        throw error(errc::invalid_argument,
                    fmt::format("'{}' is the component's own name: it is found without being a role", role));
    options_.roles[role] = priority;
    tell_roles();
    services_changed();
}

void component_runner::tell_roles() {
    std::vector<std::string> roles;
    for (const auto& [role, priority] : options_.roles) roles.push_back(role);
    services_->serve_as(std::move(roles));
}

void component_runner::leave_role(const std::string& role) {
    if (options_.roles.erase(role) == 0) return;
    tell_roles();
    services_changed();
}

bool component_runner::name_confirmed() const {
    auto owner = node_.lock();
    return owner && owner->names() && !name_lost_ && services_->self().epoch != 0 && owner->names()->confirmed();
}

void component_runner::stop_as_failed(std::string why) {
    fail(std::move(why));
    stop();
}

access_report component_runner::tell_access(const call_context& by) const {
    auto* guard = services_->access();
    auto policy = guard->current();
    access_report made;
    made.file = policy->file();
    made.hash = policy->hash();
    made.read_at = guard->read_at();
    if (auto broken = guard->broken()) made.problem = broken->message();
    made.who = services_->own_identity();
    made.asked_by = by.who;
    made.rules = policy->rules().size();
    return made;
}

component_info component_runner::describe_self() const {
    component_info made;
    made.path = path_;
    made.state = name_of(state());
    made.incarnation = incarnation();
    made.epoch = services_->self().epoch;
    made.host_name = env_.identity().host_name;
    made.process_id = env_.identity().process_id;
    if (!env_.is_virtual()) made.user = process_user();
    for (const auto& at : services_->listening()) made.endpoints.push_back(at.text());
    auto add = [&](const std::string& name, const packet_types& types, bool provided, bool declared) {
        service_info text;
        text.name = name;
        text.kind = static_cast<std::uint8_t>(types.kind);
        text.provided = provided;
        text.declared = declared;
        for (const auto& packet : types.schemas)
            text.packets.push_back(packet_info{packet.fingerprint(), packet.text()});
        made.services.push_back(std::move(text));
    };
    std::set<std::string> required;
    for (const auto& one : services_->services().describe()) {
        if (!one.provided) required.insert(one.name);
        add(one.name, *one.types, one.provided, true);
    }
    for (const auto& one : services_->uses().services())
        if (!required.contains(one.name)) add(one.name, *one.types, false, false);
    for (const auto& [raw, held] : services_->sessions()) {
        session_info text;
        text.peer = held->peer_name();
        text.bytes_in = held->wire().counts().bytes_in;
        text.bytes_out = held->wire().counts().bytes_out;
        text.round_trip_ns = held->wire().round_trip().count();
        text.peer_stalled = held->wire().peer_stalled();
        text.uses = held->used_services();
        text.who = held->verified().who;
        made.sessions.push_back(std::move(text));
    }
    const auto& counts = services_->counts();
    made.calls_served = counts.calls_served;
    made.packets_published = counts.packets_published;
    made.packets_dropped = counts.packets_dropped;
    made.confirmed = name_confirmed();
    made.roles = options_.roles;
    for (const auto& one : services_->ended_subscriptions()) {
        ended_subscription_info text;
        text.service = one.service;
        text.provider = one.provider;
        text.cause = one.cause;
        made.ended_subscriptions.push_back(std::move(text));
    }
    services_->calls().each_awaited([&](const pending_call& call) {
        if (made.awaited.size() == limit::described_calls) return;
        awaited_call_info text;
        text.provider = call.owner->name();
        text.service = call.service;
        text.id = call.id;
        text.handler = call.made_in->service;
        text.caller = call.made_in->caller;
        text.caller_id = call.made_in->id;
        if (call.where.line() != 0) text.where = fmt::format("{}:{}", call.where.file_name(), call.where.line());
        text.waited = services_->on().now() - call.began;
        made.awaited.push_back(std::move(text));
    });
    for (const auto& [raw, held] : services_->sessions())
        held->calls_in().each([&](const std::string& service, std::uint64_t id, bool runs) {
            if (made.served.size() == limit::described_calls) return;
            served_call_info text;
            text.service = service;
            text.caller = held->peer_name();
            text.id = id;
            text.running = runs;
            made.served.push_back(std::move(text));
        });
    for (auto& one : services_->uses().awaited()) {
        wait_info text;
        text.target = std::move(one.target);
        text.service = std::move(one.service);
        text.stage = name_of(one.stage);
        text.waited = share_->host->loop().now() - one.since;
        text.since = env_.wall() - text.waited;
        text.cause = std::move(one.cause);
        made.waits.push_back(std::move(text));
    }
    return made;
}

void component_runner::on_name_change(result<std::uint64_t> epoch) {
    on().gate()->post([self = shared_from_this(), epoch] {
        if (epoch) {
            self->services_->set_epoch(*epoch);
            return;
        }
        self->lose_name(epoch.error());
    });
}

// Nobody is answered under the name from now on: peers hear why, and find the one who holds it.
void component_runner::lose_name(const failure& why) {
    if (stop_asked_ || std::exchange(name_lost_, true)) return;
    log_.error(why.message());
    services_->set_epoch(0);
    services_->pause(why, grace_ / 2);
    component_->on_name_lost(why);
}

stop_report component_runner::report() const {
    std::lock_guard lock(report_mutex_);
    return report_;
}

} // namespace ise
