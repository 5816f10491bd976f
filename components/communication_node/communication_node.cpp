#include <components/communication_node/communication_node.hpp>

#include <components/boat/recall.hpp>
#include <components/communication_node/node_core.hpp>
#include <components/communication_node/services.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

using namespace std::chrono_literals;

constexpr std::int32_t primary_priority = 100, secondary_priority = 50;
constexpr ise::duration housekeeping = 1s;

} // namespace

communication_node::communication_node(communication_node_options options) : options_(std::move(options)) {
    announce_when_ready();
}
communication_node::~communication_node() = default;

utc_time communication_node::clock() const { return std::chrono::floor<std::chrono::milliseconds>(wall()); }

ise::task<> communication_node::run() {
    auto refuse = [](const std::string& why) { throw ise::error(ise::errc::invalid_argument, why); };
    if (options_.silence < 1s)
        refuse("a communication node gives the other one up after 1 s of silence at the earliest");
    if (!options_.peer.empty() && options_.peer == path())
        refuse(fmt::format("'{}' cannot back itself: name the other node as its peer", path()));
    for (const auto& proxy : options_.proxies)
        if (std::ranges::count_if(options_.proxies, [&](auto& other) { return other.link == proxy.link; }) > 1)
            refuse(fmt::format("two proxies for {}: each link has one", name_of(proxy.link)));
    co_await open_store();
    auto& c = *core_;
    log().info("its store is open", {{"file", options_.file},
                                     {"packets", std::to_string(c.store.head())},
                                     {"telecommands open", std::to_string(c.desk.open_count())}});
    provide_all();
    require_all();
    co_await ready();
    for (std::size_t i = 0; i < options_.proxies.size(); ++i) {
        const auto& one = options_.proxies[i];
        c.proxies[i].proxy = find_component(*this, one.path);
        c.proxies[i].health.link = one.link;
        c.proxies[i].health.proxy = one.path;
        spawn(fmt::format("telemetry over {}", name_of(one.link)), follow_telemetry(i));
        spawn(fmt::format("telecommands over {}", name_of(one.link)), follow_states(i));
    }
    if (!options_.peer.empty()) spawn("the other node", follow_peer());
    for (;;) {
        tick();
        co_await sleep(housekeeping);
    }
}

void communication_node::provide_all() {
    auto& c = *core_;
    c.telemetry = publish(services::telemetry);
    c.authorities = publish(services::authority_changes);
    c.state = publish(services::communication);
    c.audience.provide([this](std::uint32_t id) {
        if (id == 0) return core_->desk.open();
        std::vector<telecommand_status> one;
        if (const auto* known = core_->desk.find(id)) one.push_back(known->status);
        return one;
    });
    c.authorities(c.authority.now());
    provide(services::telemetry_store, [this](keep_request request) { return keep(std::move(request)); });
    provide(services::track, [this](track_request request) { return track(request); });
    provide(services::telecommand, [this](telecommand_request request, const ise::call_context& context) {
        return command(std::move(request), operator_of(context.caller), context.deadline);
    });
    provide(services::authority, [this](authority_request request, const ise::call_context& context) {
        return change_authority(std::move(request), operator_of(context.caller));
    });
    provide(services::telecommand_record, [this](record_request request) { return record(request); });
    provide(services::replication, [this](replication_request request) { return tell_peer(std::move(request)); });
}

void communication_node::require_all() {
    if (!options_.proxies.empty()) {
        require(services::telemetry);
        require(services::telecommand);
        require(services::telecommand_state);
        require(services::telecommand_recall);
    }
    if (!options_.peer.empty()) require(services::replication);
}

void communication_node::tick() {
    auto& c = *core_;
    for (auto& one : c.proxies) {
        one.health.reached = one.stream && one.stream->connected();
        c.links.reached(one.health.link, one.health.reached);
    }
    if (c.peer.silent(now())) c.desk.take_over(now(), clock(), path());
    else c.silence.arm(c.peer.silent_at());
    if (!c.store.is_open()) begin_store_anew();
    if (!c.held.empty() || !c.trouble.empty()) take_held();
    if (now() >= c.next_prune && c.trouble.empty()) {
        auto removed = c.store.prune(options_.max_packets, options_.max_commands);
        if (!removed) disk(&removed.error());
        auto sealed = c.store.seal();
        if (!sealed) disk(&sealed.error());
        bool more = (removed && *removed > 0) || (sealed && *sealed > 0);
        c.next_prune = now() + (more ? ise::duration(10s) : ise::duration(1h));
    }
    show();
    work();
    consider_serving();
    if (now() < c.next_state) return;
    c.next_state = now() + options_.state_period;
    c.state(how());
}

/// Under the role stands who can keep what he is given and knows what the other one knows; or who is the only one.
void communication_node::consider_serving() {
    auto& c = *core_;
    bool alone = c.peer.silent(now());
    if (c.refilling && c.salvaging == 0 && c.trouble.empty() && (c.caught_up || alone)) {
        c.refilling = false;
        log().info("its store is filled again", {{"packets", std::to_string(c.store.head())}});
    }
    bool complete = c.caught_up && c.held.empty() && !c.refilling;
    bool serve = alone || (c.trouble.empty() ? complete : !c.peer.lives(now()));
    if (serve == c.serving || options_.role.empty()) return;
    c.serving = serve;
    if (serve) serve_role(options_.role, options_.secondary ? secondary_priority : primary_priority);
    else leave_role(options_.role);
    log().info(serve ? "serves the role" : "leaves the role to the other node",
               {{"role", options_.role}, {"trouble", c.trouble}});
}

/// How the disk fared; null: it took what it was given.
void communication_node::disk(const ise::failure* why) {
    auto& c = *core_;
    if (why && why->code() == ise::errc::malformed) return replace_store(*why);
    if (!why) {
        if (c.trouble.empty()) return;
        log().info("the store takes packets again", {{"held", std::to_string(c.held.size())}});
        c.trouble.clear();
        c.caught_up = options_.peer.empty(); // the other one may have gone on alone
        return;
    }
    if (c.trouble.empty()) log().error("nothing can be kept", {{"cause", why->message()}});
    c.trouble = why->message();
    consider_serving();
}

communication_state communication_node::how() const {
    communication_state made;
    made.node = path();
    made.secondary = options_.secondary;
    made.peer = options_.peer;
    if (!core_) return made;
    const auto& c = *core_;
    made.serving = c.serving;
    made.trouble = !c.trouble.empty() ? c.trouble : c.peer_trouble;
    if (c.refilling && made.trouble.empty()) made.trouble = c.store_notice;
    made.store_notice = c.store_notice;
    made.store = c.store.number();
    made.packets = c.store.head();
    made.shown = c.shown;
    made.duplicates = c.duplicates;
    made.refused = c.refused;
    made.held = c.held.size();
    made.dropped = c.dropped;
    made.peer_lives = c.peer.lives(now());
    made.peer_misses = options_.peer.empty() ? 0 : c.store.head() - std::min(c.store.head(), c.peer.packets());
    for (const auto& one : c.proxies) {
        made.links.push_back(one.health);
        made.links.back().alive = c.links.alive(one.health.link, now());
    }
    made.fix = c.fix;
    made.telecommands_open = c.desk.open_count();
    made.authority = c.authority.now();
    return made;
}

} // namespace atirma
