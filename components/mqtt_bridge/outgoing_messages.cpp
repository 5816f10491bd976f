#include <components/mqtt_bridge/outgoing_messages.hpp>

#include <ise/core/time_text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

namespace ise::mqtt {
namespace {

constexpr duration refused_pause = std::chrono::seconds(5); // before a message that the broker does not want now
constexpr std::size_t max_answers = 1024;                   // that wait for the broker
constexpr std::size_t max_unconfirmed = 2 * max_topics;     // messages; answers wait then

} // namespace

result<std::shared_ptr<outgoing_messages>> outgoing_messages::open(std::shared_ptr<bridge_context> in,
                                                                   std::shared_ptr<database> disk) {
    auto queue = outgoing_queue::open(*disk, in->options.queue);
    if (!queue) return queue.error();
    return std::shared_ptr<outgoing_messages>(new outgoing_messages(std::move(in), std::move(disk), std::move(*queue)));
}

void outgoing_messages::push(queued_message packet) {
    queue_.push(std::move(packet), in_->self.now(), in_->self.wall());
    pump();
}

void outgoing_messages::put(queued_message packet) {
    packet.number = queue_.take_number(in_->self.wall());
    newest_message one;
    one.what = std::move(packet);
    enter(std::move(one));
    pump();
}

void outgoing_messages::put_plain(plain_message what) {
    newest_message one;
    one.what.topic = std::move(what.topic);
    one.what.payload = std::move(what.payload);
    one.what.retain = one.plain = true;
    one.content_type = std::move(what.content_type);
    one.user = std::move(what.user);
    enter(std::move(one));
    pump();
}

void outgoing_messages::forget(const std::string& topic, bool behind_queue) {
    if (!behind_queue) {
        plain_message nothing;
        nothing.topic = topic;
        return put_plain(std::move(nothing));
    }
    queued_message nothing;
    nothing.topic = topic;
    nothing.retain = true;
    nothing.published = in_->self.wall();
    push(std::move(nothing));
}

void outgoing_messages::answer(message what) {
    if (answers_.size() >= max_answers) {
        ++in_->counts.dropped;
        answers_.pop_front();
    }
    answers_.push_back(std::move(what));
    pump();
}

void outgoing_messages::enter(newest_message one) {
    one.came = in_->self.now();
    auto known = newest_.find(one.what.topic);
    const auto size = one.what.payload.size();
    const auto others = newest_bytes_ - (known == newest_.end() ? 0 : known->second.what.payload.size());
    const auto most = in_->options.queue.newest_bytes;
    if (size > most - std::min(most, others) && size > 0) {
        ++in_->counts.dropped;
        in_->note(fmt::format("a message of {} is not sent: with the newest of all topics it has more than {} bytes "
                              "(newest_bytes)",
                              one.what.topic, most));
        return;
    }
    newest_bytes_ = others + size;
    auto& here = newest_[one.what.topic];
    if (here.waiting && !here.plain) ++in_->counts.replaced;
    one.waiting = true;
    one.in_flight = here.in_flight;
    if (!here.waiting) waiting_.push_back(one.what.topic);
    here = std::move(one);
}

// Metadata of a packet: user properties, or an envelope in MQTT 3.1.1, which has none.
message outgoing_messages::packet_message(const queued_message& what, time_point came, bool sent_before,
                                          bool from_disk) {
    message made;
    made.topic = what.topic;
    made.retain = what.retain;
    const bool old = from_disk || came < connected_at_;
    in_->counts.history += old;
    in_->counts.resent += sent_before;
    if (what.payload.empty() && what.retain && !in_->options.protobuf) return made; // the end of a retained message
    if (!in_->options.broker.version_5) {
        made.payload = fmt::format(R"({{"published":"{}","number":{},"history":{},"resent":{},"packet":{}}})",
                                   iso_8601(what.published, 6), what.number, old, sent_before, what.payload);
        return made;
    }
    made.payload = what.payload;
    made.content_type = in_->options.protobuf ? "application/protobuf" : "application/json";
    made.user.emplace_back("published", iso_8601(what.published, 6));
    made.user.emplace_back("number", std::to_string(what.number));
    if (old) made.user.emplace_back("history", "true");
    if (sent_before) made.user.emplace_back("resent", "true");
    return made;
}

/// Sends; what cannot be sent at all is given up. Whether to go on.
bool outgoing_messages::send(const message& what, sent_message as) {
    auto token = session_->publish(what);
    if (token) {
        sent_.emplace(*token, std::move(as));
        return true;
    }
    if (token.error().code() == errc::peer_lost) return false;
    refuse(std::move(as), token.error());
    return true;
}

void outgoing_messages::pump() {
    while (session_ && !answers_.empty() && sent_.size() < max_unconfirmed) {
        auto one = std::move(answers_.front());
        answers_.pop_front();
        if (!send(one, one)) {
            answers_.push_front(std::move(one));
            return;
        }
    }
    for (auto left = waiting_.size(); session_ && left > 0; --left) {
        auto topic = std::move(waiting_.front());
        waiting_.pop_front();
        auto& one = newest_[topic];
        if (one.in_flight) { // the newest then
            waiting_.push_back(std::move(topic));
            continue;
        }
        message made;
        if (one.plain) {
            made.topic = topic;
            made.payload = one.what.payload;
            made.retain = true;
            made.content_type = one.content_type;
            made.user = one.user;
        } else {
            made = packet_message(one.what, one.came, false, false);
        }
        one.waiting = false;
        one.in_flight = true;
        if (!send(made, topic)) {
            one.waiting = true;
            one.in_flight = false;
            waiting_.push_back(std::move(topic));
            return;
        }
    }
    while (session_ && in_->self.now() >= not_before_) {
        const auto* one = queue_.next();
        if (!one) break;
        const auto number = one->what.number;
        auto made = packet_message(one->what, one->came, one->sent_before, one->from_disk);
        queue_.sent(number);
        if (!send(made, number)) return;
    }
}

// Confirmed, or given up.
void outgoing_messages::settle(const sent_message& what) {
    if (const auto* number = std::get_if<std::uint64_t>(&what)) queue_.done(*number);
    if (const auto* topic = std::get_if<std::string>(&what)) {
        auto found = newest_.find(*topic);
        if (found == newest_.end()) return;
        found->second.in_flight = false;
        if (!found->second.waiting && found->second.what.payload.empty()) newest_.erase(found);
    }
}

void outgoing_messages::refuse(sent_message what, const failure& why) {
    ++in_->counts.refused;
    auto of = std::holds_alternative<std::string>(what) ? std::get<std::string>(what) : std::string("a message");
    in_->counts.trouble = fmt::format("{} is refused: {}", of, why.message());
    in_->note(in_->counts.trouble);
    settle(what);
}

void outgoing_messages::on_confirmed(int token, const std::optional<failure>& why, bool later) {
    auto found = sent_.find(token);
    if (found == sent_.end()) return;
    auto what = std::move(found->second);
    sent_.erase(found);
    if (!why) {
        ++in_->counts.messages;
        settle(what);
    } else if (later && std::holds_alternative<std::uint64_t>(what)) {
        in_->counts.trouble = why->message();
        in_->note(fmt::format("the broker does not want a message now, it is sent again: {}", why->message()));
        queue_.again(std::get<std::uint64_t>(what));
        not_before_ = saturating_add(in_->self.now(), refused_pause);
    } else {
        refuse(std::move(what), *why);
    }
    pump();
}

void outgoing_messages::begin(broker_session& to, message online) {
    session_ = &to;
    connected_at_ = in_->self.now();
    not_before_ = {};
    send(online, none{});
}

void outgoing_messages::resume() {
    for (auto& [topic, one] : newest_) { // the broker may have forgotten what it retained
        if (one.waiting || (!one.plain && !in_->options.retain)) continue;
        one.waiting = true;
        waiting_.push_back(topic);
    }
    pump();
}

void outgoing_messages::end() {
    queue_.lost();
    std::deque<message> back;
    for (auto& [token, what] : sent_) {
        if (auto* topic = std::get_if<std::string>(&what)) {
            auto found = newest_.find(*topic);
            if (found == newest_.end()) continue;
            found->second.in_flight = false;
            if (!std::exchange(found->second.waiting, true)) waiting_.push_back(*topic);
        }
        if (auto* answer = std::get_if<message>(&what)) back.push_back(std::move(*answer));
    }
    for (auto& one : answers_) back.push_back(std::move(one));
    answers_ = std::move(back);
    sent_.clear();
}

void outgoing_messages::store(time_point older_than) {
    auto done = queue_.store(older_than);
    if (!done) {
        in_->counts.trouble = done.error().message();
        in_->note(fmt::format("packets wait in memory only: {}", done.error().message()));
        told_full_ = true;
    } else if (std::exchange(told_full_, false)) {
        in_->self.log().info("packets wait on disk again");
    }
    if (queue_.dropped() == told_dropped_) return;
    in_->note(fmt::format("{} packets are lost: more wait for the broker than there is room for (--store-mb)",
                          queue_.dropped() - told_dropped_));
    told_dropped_ = queue_.dropped();
}

void outgoing_messages::count_into(bridge_status& to) const {
    to.queued = queue_.waiting();
    to.queued_bytes = queue_.disk_bytes();
    to.dropped += queue_.dropped();
}

} // namespace ise::mqtt
