#include <ise/subscription/outgoing_subscriptions.hpp>

#include <ise/packet/codec.hpp>
#include <ise/subscription/packet_frame.hpp>
#include <ise/wire/body.hpp>

#include <fmt/format.h>

#include <utility>

namespace ise {

using wire::frame_type;

outgoing_subscriptions::outgoing_subscriptions(conversation& over)
    : over_(over),
      known_flags_(static_cast<std::uint8_t>(wire::flag::skipped |
                                             (over.wire().tells_stamps() ? wire::flag::stamped : 0) |
                                             (over.wire().tells_packet_traces() ? wire::flag::caused : 0))) {}

void outgoing_subscriptions::subscribe(subscriber_core& subscriber) {
    auto terms = subscriber.terms();
    auto& connection = over_.wire();
    auto& runtime = over_.runtime();
    if (connection.lossy() && terms.policy == wire::overflow::lossless) {
        subscriber.on_refused(
            failure(errc::invalid_argument,
                    fmt::format("'{}' cannot be subscribed to without loss: {} is reached over udp, which loses "
                                "packets; ask for the last ones, or reach it over tcp or a local socket",
                                subscriber.service(), over_.peer_name())));
        return;
    }
    const auto body = encode(terms);
    const auto what = fmt::format("the request to subscribe to '{}' at {}", subscriber.service(), over_.peer_name());
    if (auto wrong = over_.too_large(what, body.size())) {
        subscriber.on_refused(*wrong);
        return;
    }
    auto id = next_id_++;
    runtime.schemas().add_own(subscriber.types());
    subscribers_.emplace(id, &subscriber);
    subscriber.on_sent(*this, id);
    if (terms.policy ==
        wire::overflow::lossless) { // a publisher may wait for this side, and no longer than it hears of it
        connection.sign_often();
        runtime.signs()->hasten(connection.signs()->heartbeat());
    }
    const std::uint8_t flags =
        connection.passes_objects() && subscriber.takes_objects() ? wire::flag::objects : std::uint8_t{0};
    over_.send(frame_type::subscribe, flags, id, [&](buffer& out) { out.append(bytes_view(body)); });
}

void outgoing_subscriptions::unsubscribe(subscriber_core& subscriber, bytes_view farewell,
                                         std::weak_ptr<departure> waiting) {
    auto id = subscriber.id();
    if (subscribers_.erase(id) == 0 || !over_.open()) return;
    auto wrong = over_.too_large(
        fmt::format("the unsubscribe packet of '{}' at {}", subscriber.service(), over_.peer_name()), farewell.size());
    if (wrong) { // it is left all the same
        farewell = {};
        if (auto who = waiting.lock()) who->outcome.emplace(std::move(*wrong));
    } else if (!waiting.expired()) {
        departures_.emplace(id, std::move(waiting));
    }
    over_.send(frame_type::unsubscribe, 0, id, [&](buffer& body) { body.append(farewell); });
}

void outgoing_subscriptions::on_unsubscribed(const net::carried_frame& received) {
    auto found = departures_.find(received.header.id);
    if (found == departures_.end()) return; // mostly nobody waits for it
    auto waiting = found->second.lock();
    departures_.erase(found);
    if (!waiting) return; // no longer
    waiting->outcome.emplace(bytes(received.body.begin(), received.body.end()));
    waiting->answered.resume();
}

subscriber_core* outgoing_subscriptions::find(std::uint64_t id) const noexcept {
    auto found = subscribers_.find(id);
    return found == subscribers_.end() ? nullptr : found->second;
}

void outgoing_subscriptions::grant(const subscriber_core& subscriber, std::uint64_t total) {
    if (!over_.open()) return;
    over_.send_ahead(frame_type::credit, subscriber.id(), [&](buffer& body) { body.append(total); });
}

result<void> outgoing_subscriptions::on_subscribed(const net::carried_frame& received) {
    auto answer = wire::read_body<wire::subscribed>(received.body);
    if (!answer) return answer.error();
    auto* subscriber = find(received.header.id);
    if (!subscriber) return {}; // left meanwhile; the unsubscribe is on its way
    return subscriber->on_subscribed(std::move(*answer));
}

[[gnu::hot]] result<void> outgoing_subscriptions::on_packet(const net::carried_frame& received) {
    const auto& header = received.header;
    if (received.run.empty()) return on_one(header, received.body, received.object);
    auto frames = received.run;
    if (header.flags == wire::flag::stamped && (known_flags_ & wire::flag::stamped)) [[likely]]
        if (auto* subscriber = find(header.id)) frames = frames.subspan(subscriber->take_run(frames));
    while (!frames.empty()) {
        const auto size = packet_frame::size_of(frames.data());
        auto taken = on_one(header, frames.subspan(wire::frame_header::size, size - wire::frame_header::size), nullptr);
        if (!taken) return taken;
        frames = frames.subspan(size);
    }
    return {};
}

result<void> outgoing_subscriptions::on_one(const wire::frame_header& header, bytes_view body, passed_object* object) {
    const auto flags = header.flags & known_flags_;
    const bool skipped = flags & wire::flag::skipped;
    const bool stamped = flags & wire::flag::stamped;
    const bool traced = flags & wire::flag::caused;
    const std::size_t stamp_at = 8 + (skipped ? 4u : 0u), trace_at = stamp_at + (stamped ? 8u : 0u);
    const std::size_t head = trace_at + (traced ? packet_frame::trace_bytes : 0);
    if (body.size() < head)
        return failure(errc::protocol_error, "a packet came without its sequence, its time or its trace");
    packet_place place;
    place.sequence = detail::load_little<std::uint64_t>(body.data());
    if (skipped) place.skipped = detail::load_little<std::uint32_t>(body.data() + 8);
    if (stamped) place.published_at = wall_time(duration(detail::load_little<std::int64_t>(body.data() + stamp_at)));
    if (traced) place.trace = packet_frame::read_trace(body.data() + trace_at);
    auto* subscriber = find(header.id);
    if (!subscriber) return {};
    incoming_packet packet(body.subspan(head), object);
    return subscriber->on_packet(place, packet);
}

result<void> outgoing_subscriptions::on_ended(const net::carried_frame& received) {
    auto why = wire::read_body<wire::ended>(received.body);
    if (!why) return why.error();
    auto found = subscribers_.find(received.header.id);
    if (found == subscribers_.end()) return {};
    auto* subscriber = found->second;
    subscribers_.erase(found);
    subscriber->on_ended(failure(static_cast<errc>(why->code),
                                 fmt::format("'{}' at {}: {}", subscriber->service(), over_.peer_name(), why->reason)),
                         why->lost);
    return {};
}

void outgoing_subscriptions::on_session_end(const failure& cause) {
    for (auto& [id, subscriber] : std::exchange(subscribers_, {})) subscriber->on_session_end(cause);
    for (auto& [id, left] : std::exchange(departures_, {})) {
        auto waiting = left.lock();
        if (!waiting) continue;
        waiting->outcome.emplace(failure(
            errc::peer_lost, fmt::format("the session ended before the answer to the farewell: {}", cause.message()),
            execution::unknown));
        waiting->answered.resume();
    }
}

void outgoing_subscriptions::add_used(std::set<std::string>& names) const {
    for (const auto& [id, subscriber] : subscribers_) names.insert(subscriber->service());
}

} // namespace ise
