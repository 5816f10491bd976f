#include <components/foxglove_gateway/shown_channels.hpp>

#include <ise/bag/protobuf.hpp>
#include <ise/component/served_runs.hpp>
#include <ise/core/buffer.hpp>
#include <ise/core/bytes.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <functional>
#include <optional>

namespace ise::foxglove {
namespace {

constexpr duration first_pause = std::chrono::seconds(1); // before it subscribes again
constexpr duration longest_pause = std::chrono::seconds(30);
constexpr duration unused_time = std::chrono::seconds(5); // until a subscription without viewers ends
constexpr std::uint32_t derived_depth = 256;              // packets; a derivation keeps what it needs of each

} // namespace

struct shown_channels::channel {
    channel_info info;
    channel_kind kind = channel_kind::state;
    source* from = nullptr;
    std::shared_ptr<const channel_message> last; // of state: what a new viewer gets
    std::vector<viewer::subscription*> subscribers;

    /// The status that viewers get for an error in its subscription.
    std::string condition(const std::string& problem) const {
        auto id = "subscription:" + info.topic;
        if (problem.empty()) return write_status_removed(id);
        return write_status(status_level::error, fmt::format("no messages of {}: {}", info.topic, problem), id);
    }
};

/// A subscription of the gateway, made while a viewer wants one of its channels.
struct shown_channels::source : std::enable_shared_from_this<source> {
    source(std::string of, dynamic_contract service) : path(std::move(of)), contract(std::move(service)) {}
    std::string path;
    dynamic_contract contract;
    std::unique_ptr<derivation> derived; // null: the packets themselves
    std::unique_ptr<bag::protobuf_type> type;
    std::vector<std::unique_ptr<channel>> channels;
    std::function<void()> leave; // ends the subscription that there is
    bool running = false;        // its coroutine
    bool wanted = false;
    bool left = false;      // by `leave`
    bool withdrawn = false; // nothing is sent any more
    time_point unused_since{};
    std::string problem;
    bool has_events() const {
        return std::ranges::any_of(channels, [](const auto& one) { return one->kind == channel_kind::events; });
    }
    bool used() const {
        return (derived && derived->always()) ||
               std::ranges::any_of(channels, [](const auto& one) { return !one->subscribers.empty(); });
    }
};

namespace {

/// Of all runs of a component, those of one action.
class runs_of_action final : public derivation {
public:
    runs_of_action(std::string topic, const dynamic_contract& action)
        : action_(action.name()), type_(schema_of_runs(action)) {
        channel one;
        one.topic = std::move(topic);
        one.schema = protobuf_schema(type_.name(), type_.descriptors());
        one.kind = channel_kind::events;
        channels_.push_back(std::move(one));
    }
    const std::vector<channel>& channels() const override { return channels_; }
    void take(const dynamic_packet& packet, wall_time at, std::vector<derived_message>& to) override {
        auto event = packet.as<served_run>();
        if (event.action != action_) return;
        buffer payload;
        type_.encode(encode_run(event), payload, false, message_limits()).value();
        to.push_back({0, at, std::string(as_text(payload.view()))});
    }

private:
    std::string action_;
    bag::protobuf_type type_;
    std::vector<channel> channels_;
};

} // namespace

// --- coming and going ------------------------------------------------------------------------------------------------

void shown_channels::add_channel(source& from, const derivation::channel& shown) {
    auto made = std::make_unique<channel>();
    made->info.id = in_->number_of(fmt::format("channel\n{}\n{}", shown.topic, identity_of(shown.schema)));
    if (channels_.find(made->info.id)) { // two derivations under one name: the first one counts
        in_->self.log().warning(fmt::format("two channels have the topic {}: one is not shown", shown.topic));
        made->info.id = in_->fresh_number();
    }
    made->info.topic = shown.topic;
    made->info.schema = shown.schema;
    made->kind = shown.kind;
    made->from = &from;
    channels_.add(made.get());
    from.channels.push_back(std::move(made));
}

void shown_channels::add(const std::string& path, const dynamic_contract& service) {
    auto raw = std::make_shared<source>(path, service);
    raw->type = std::make_unique<bag::protobuf_type>(service.packet(role::published));
    auto& shown = sources_[{path, service.name()}];
    derivation::channel packets;
    packets.topic = fmt::format("{}/{}", path, service.name());
    packets.schema = protobuf_schema(raw->type->name(), raw->type->descriptors());
    add_channel(*raw, packets);
    shown.push_back(raw);
    for (const auto& make : in_->options.derivations) {
        auto derived = make(path, service);
        if (!derived) continue;
        auto from = std::make_shared<source>(path, service);
        for (const auto& one : derived->channels()) add_channel(*from, one);
        from->derived = std::move(derived);
        shown.push_back(from);
    }
    for (const auto& one : shown)
        if (one->used()) want(one);
}

void shown_channels::add_runs(const std::string& path, const dynamic_contract& action, const dynamic_contract& runs) {
    auto from = std::make_shared<source>(path, runs);
    from->derived = std::make_unique<runs_of_action>(fmt::format("{}/{}", path, action.name()), action);
    for (const auto& one : from->derived->channels()) add_channel(*from, one);
    sources_[{path, action.name()}].push_back(std::move(from));
}

void shown_channels::remove(const std::string& path, const std::string& service) {
    auto found = sources_.find({path, service});
    if (found == sources_.end()) return;
    for (const auto& from : found->second) {
        from->withdrawn = true;
        for (const auto& one : from->channels) {
            channels_.remove(one->info.id);
            for (auto* each : std::exchange(one->subscribers, {})) each->of->unsubscribe(each->id);
        }
        from->channels.clear();
        stop(*from);
    }
    sources_.erase(found);
}

void shown_channels::announce() { channels_.announce(*to_); }

std::shared_ptr<const std::string> shown_channels::list() { return channels_.list(); }

bool shown_channels::has(const std::string& path, const std::string& service) const {
    return sources_.contains({path, service});
}

// --- packets ---------------------------------------------------------------------------------------------------------

void shown_channels::want(const std::shared_ptr<source>& from) {
    from->wanted = true;
    if (std::exchange(from->running, true)) return;
    in_->self.spawn(fmt::format("show {}/{}", from->path, from->contract.name()), feed(shared_from_this(), from));
}

void shown_channels::stop(source& from) {
    from.wanted = false;
    for (const auto& one : from.channels) one->last.reset(); // it will be old for the next viewer
    if (!from.leave) return;
    from.left = true;
    from.leave();
}

task<> shown_channels::feed(std::shared_ptr<shown_channels> me, std::shared_ptr<source> from) {
    struct ending {
        source& mine;
        ~ending() { mine.running = false; }
    } guard{*from};
    auto& in = *me->in_;
    auto who = in.self.at(from->path);
    subscribe_options terms = subscribe_options::keep_latest();
    const bool events = from->has_events();
    if (events) terms = subscribe_options::keep_last(in.options.viewer.max_events);
    else if (from->derived) terms = subscribe_options::keep_last(derived_depth);
    else if (in.options.viewer.depth > 1) terms = subscribe_options::keep_last(in.options.viewer.depth);
    duration pause = first_pause;
    while (from->wanted) {
        auto made = co_await subscribe_dynamic(who, from->contract, terms);
        if (!from->wanted) break;
        std::string problem;
        from->left = false;
        if (made) {
            pause = first_pause;
            me->settle(*from, {});
            // Held here, so that it is not destroyed while it is awaited.
            auto held = std::make_shared<dynamic_stream>(std::move(*made));
            from->leave = [held] { held->unsubscribe(); };
            ++in.counts.subscriptions;
            struct counted {
                gateway_context& of;
                source& mine;
                ~counted() {
                    --of.counts.subscriptions;
                    mine.leave = nullptr;
                }
            } count{in, *from};
            for (;;) {
                auto packet = co_await held->next();
                if (!packet) break;
                const auto lost = packet.lost_before();
                if (events && (!lost || *lost > 0))
                    in.note(fmt::format("{} events of '{}/{}' did not reach this gateway",
                                        lost ? std::to_string(*lost) : "an unknown number of", from->path,
                                        from->contract.name()));
                if (!from->withdrawn) me->take(*from, *packet, packet.published_at().value_or(in.self.wall()));
            }
            if (held->ended()) problem = held->cause().message();
        } else {
            problem = made.error().message();
        }
        if (!from->wanted || from->withdrawn) break;
        if (from->left) continue; // and wanted again since
        me->settle(*from, problem);
        co_await in.self.sleep(pause);
        pause = std::min(2 * pause, longest_pause);
    }
}

// Tells viewers of a subscription that fails, or works again.
void shown_channels::settle(source& from, const std::string& problem) {
    if (from.problem == problem) return;
    from.problem = problem;
    if (!problem.empty())
        in_->note(fmt::format("'{}/{}' cannot be subscribed to: {}", from.path, from.contract.name(), problem));
    for (const auto& one : from.channels)
        for (auto* to : one->subscribers) to->of->text(one->condition(problem));
}

void shown_channels::take(source& from, const dynamic_packet& packet, wall_time at) {
    auto left_out = [&](std::string_view why) {
        in_->note(fmt::format("a packet of '{}/{}' is not shown: {}", from.path, from.contract.name(), why));
    };
    if (!from.derived) {
        buffer payload;
        if (auto done = from.type->encode(packet.encoded(), payload, false, message_limits()); !done)
            return left_out(done.error().message());
        publish(*from.channels[0], at, std::string(as_text(payload.view())));
        return;
    }
    std::vector<derived_message> made;
    try {
        from.derived->take(packet, at, made);
    } catch (const std::exception& why) {
        left_out(why.what());
    }
    for (auto& one : made)
        if (one.channel < from.channels.size()) publish(*from.channels[one.channel], one.at, std::move(one.payload));
}

void shown_channels::publish(channel& on, wall_time at, std::string payload) {
    if (payload.size() > max_message_bytes) {
        in_->note(fmt::format("a message of {} is not shown: it has {} bytes, {} at most (max_message_bytes)",
                              on.info.topic, payload.size(), max_message_bytes));
        return;
    }
    auto made = std::make_shared<channel_message>();
    made->at = at;
    made->payload = std::move(payload);
    if (on.kind == channel_kind::state) on.last = made;
    for (auto* to : on.subscribers) to->of->offer(*to, made);
}

// --- viewers ---------------------------------------------------------------------------------------------------------

void shown_channels::take(const std::shared_ptr<viewer>& who, const subscribe_message& asked) {
    for (const auto& one : asked.subscriptions) {
        auto* on = channels_.find(one.channel);
        if (!on) {
            to_->refuse(*who, fmt::format("subscribe: there is no channel {}", one.channel));
            continue;
        }
        auto made = who->subscribe(one.id, one.channel, on->kind);
        if (!made) {
            to_->refuse(*who, fmt::format("subscribe: {}", made.error().message()));
            continue;
        }
        on->subscribers.push_back(*made);
        if (on->last) who->offer(**made, on->last);
        want(on->from->shared_from_this());
        if (!on->from->problem.empty()) who->text(on->condition(on->from->problem));
    }
}

void shown_channels::take(const std::shared_ptr<viewer>& who, const unsubscribe_message& asked) {
    for (auto id : asked.ids) {
        auto* which = who->find(id);
        if (!which) {
            to_->refuse(*who, fmt::format("unsubscribe: there is no subscription {}", id));
            continue;
        }
        detach(*which);
        who->unsubscribe(id);
    }
}

void shown_channels::leave(viewer& who) {
    for (const auto& [id, one] : who.subscriptions()) detach(*one);
}

void shown_channels::detach(viewer::subscription& which) {
    if (auto* on = channels_.find(which.channel)) std::erase(on->subscribers, &which);
}

void shown_channels::tick() {
    const auto now = in_->self.now();
    for (const auto& [name, sources] : sources_)
        for (const auto& from : sources) {
            if (from->used()) from->unused_since = now;
            else if (from->wanted && now - from->unused_since >= unused_time) stop(*from);
        }
}

} // namespace ise::foxglove
