#include <components/mqtt_bridge/service_feeds.hpp>

#include <components/mqtt_bridge/payload_codec.hpp>
#include <components/mqtt_bridge/topics.hpp>

#include <ise/core/bytes.hpp>
#include <ise/service/action.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <functional>

namespace ise::mqtt {
namespace {

constexpr duration first_pause = std::chrono::seconds(1);
constexpr duration most_pause = std::chrono::seconds(10);
constexpr std::uint32_t subscription_depth = 1024; // packets between a provider and the bridge

} // namespace

struct service_feeds::source {
    source(std::string of, dynamic_contract service, bool protobuf)
        : path(std::move(of)), contract(std::move(service)), codec(contract.packet(role::published), protobuf) {}
    std::string path;
    dynamic_contract contract;
    payload_codec codec;
    std::string topic, schema_topic;
    bool queued = false;
    bool withdrawn = false;
    std::function<void()> leave;
    std::string problem;
};

void service_feeds::add(const std::string& path, const dynamic_contract& service) {
    if (is_action(*service.types())) return; // to subscribe would start a run
    const auto& options = in_->options;
    service_place place{path, service.name()};
    if (all_.size() >= max_topics) {
        in_->note(fmt::format("'{}/{}' is not sent: there are {} topics already (max_topics)", path, service.name(),
                              max_topics));
        return;
    }
    auto topic = topic_of(options.prefix, "out", place);
    auto schema_topic = topic_of(options.prefix, "schema", place);
    if (!topic || !schema_topic) {
        in_->note((topic ? schema_topic : topic).error().message());
        return;
    }
    auto made = std::make_shared<source>(path, service, options.protobuf);
    made->topic = std::move(*topic);
    made->queued = std::ranges::find(options.queued, service.name()) != options.queued.end();
    all_[{path, service.name()}] = made;
    if (const auto* type = made->codec.message()) {
        made->schema_topic = std::move(*schema_topic);
        outgoing_messages::plain_message about;
        about.topic = made->schema_topic;
        about.payload = std::string(as_text(type->descriptors()));
        about.content_type = "application/protobuf";
        about.user.emplace_back("message", type->name());
        to_->put_plain(std::move(about));
    }
    in_->self.spawn(fmt::format("send {}/{}", path, service.name()), feed(shared_from_this(), made));
}

void service_feeds::remove(const std::string& path, const std::string& service) {
    auto found = all_.find({path, service});
    if (found == all_.end()) return;
    auto gone = found->second;
    all_.erase(found);
    gone->withdrawn = true;
    if (gone->leave) gone->leave();
    if (!gone->schema_topic.empty()) to_->forget(gone->schema_topic, false);
    if (in_->options.retain) to_->forget(gone->topic, gone->queued);
}

task<> service_feeds::feed(std::shared_ptr<service_feeds> me, std::shared_ptr<source> from) {
    auto& self = me->in_->self;
    auto who = self.at(from->path);
    auto terms = from->queued ? subscribe_options::lossless(subscription_depth) : subscribe_options::keep_latest();
    terms.last_value = !from->queued; // an earlier life may have sent it
    duration pause = first_pause;
    bool before = false;
    while (!from->withdrawn) {
        auto made = co_await subscribe_dynamic(who, from->contract, terms);
        if (from->withdrawn) break;
        std::string problem;
        if (made) {
            pause = first_pause;
            before = true;
            me->settle(*from, {});
            // Held here, so that it is not destroyed while it is awaited.
            auto held = std::make_shared<dynamic_stream>(std::move(*made));
            from->leave = [held] { held->unsubscribe(); };
            struct ending {
                source& mine;
                ~ending() { mine.leave = nullptr; }
            } guard{*from};
            for (;;) {
                auto packet = co_await held->next();
                if (!packet || from->withdrawn) break;
                if (from->queued && packet.lost_before() != 0) me->gap(*from, packet.lost_before());
                me->take(*from, *packet, packet.published_at().value_or(self.wall()));
            }
            if (held->ended()) problem = held->cause().message();
        } else {
            problem = made.error().message();
        }
        if (from->withdrawn) break;
        if (from->queued && before) me->gap(*from, std::nullopt);
        me->settle(*from, problem);
        co_await self.sleep(pause);
        pause = std::min(2 * pause, most_pause);
    }
}

void service_feeds::gap(const source& of, std::optional<std::uint64_t> lost) {
    in_->counts.gaps += lost.value_or(1);
    in_->note(fmt::format("{} packets of '{}/{}' did not reach the bridge", lost ? std::to_string(*lost) : "some",
                          of.path, of.contract.name()));
}

void service_feeds::settle(source& of, const std::string& problem) {
    if (of.problem == problem) return;
    of.problem = problem;
    if (!problem.empty())
        in_->note(fmt::format("'{}/{}' cannot be subscribed to: {}", of.path, of.contract.name(), problem));
}

void service_feeds::take(const source& from, const dynamic_packet& packet, wall_time at) {
    auto payload = from.codec.encode(packet);
    if (!payload) {
        ++in_->counts.dropped;
        in_->note(fmt::format("a packet of '{}/{}' is not sent: {}", from.path, from.contract.name(),
                              payload.error().message()));
        return;
    }
    queued_message made;
    made.topic = from.topic;
    made.payload = std::move(*payload);
    made.retain = in_->options.retain;
    made.published = at;
    if (from.queued) to_->push(std::move(made));
    else to_->put(std::move(made));
}

} // namespace ise::mqtt
