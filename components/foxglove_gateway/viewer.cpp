#include <components/foxglove_gateway/viewer.hpp>

#include <ise/http/web_socket_frames.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace ise::foxglove {
namespace {

constexpr std::size_t batch_bytes = 64 * 1024;
constexpr std::size_t message_overhead = 64; // of one that waits, beside its bytes

} // namespace

viewer::viewer(viewer_limits limits, std::function<void()> wake) : limits_(limits), wake_(std::move(wake)) {}

void viewer::put(frame one) {
    if (gone) return;
    control_bytes_ += one.counted;
    control_.push_back(std::move(one));
    wake_();
}

void viewer::text(std::string message) {
    auto size = message.size() + message_overhead;
    put({true, std::make_shared<const std::string>(std::move(message)), size});
}

void viewer::binary(std::string message) {
    auto size = message.size() + message_overhead;
    put({false, std::make_shared<const std::string>(std::move(message)), size});
}

void viewer::text(std::shared_ptr<const std::string> message) {
    auto size = message->size() + message_overhead;
    put({true, std::move(message), size});
}

void viewer::greet(std::shared_ptr<const std::string> message) { put({true, std::move(message), 0}); }

void viewer::clock(std::string message) {
    if (gone) return;
    time_ = std::move(message);
    wake_();
}

result<viewer::subscription*> viewer::subscribe(std::uint32_t id, std::uint32_t channel, channel_kind kind) {
    if (all_.contains(id)) return failure(errc::invalid_argument, fmt::format("the subscription id {} is in use", id));
    if (by_channel_.contains(channel))
        return failure(errc::invalid_argument, fmt::format("the channel {} has a subscription already", channel));
    if (all_.size() >= limits_.max_subscriptions)
        return failure(errc::overloaded,
                       fmt::format("more than {} subscriptions (max_subscriptions)", limits_.max_subscriptions));
    auto& made = all_[id] = std::make_unique<subscription>();
    made->of = this;
    made->id = id;
    made->channel = channel;
    made->depth = std::max(kind == channel_kind::events ? limits_.max_events : limits_.depth, 1u);
    by_channel_[channel] = id;
    return made.get();
}

viewer::subscription* viewer::find(std::uint32_t id) noexcept {
    auto found = all_.find(id);
    return found == all_.end() ? nullptr : found->second.get();
}

void viewer::unsubscribe(std::uint32_t id) noexcept {
    auto found = all_.find(id);
    if (found == all_.end()) return;
    auto& which = *found->second;
    if (which.listed) std::erase(ready_, &which);
    for (const auto& one : which.waiting) waiting_bytes_ -= one->payload.size() + message_overhead;
    by_channel_.erase(which.channel);
    all_.erase(found);
}

void viewer::skip_oldest() {
    auto& which = *ready_.front();
    waiting_bytes_ -= which.waiting.front()->payload.size() + message_overhead;
    which.waiting.pop_front();
    ++skipped_;
    ready_.pop_front();
    which.listed = !which.waiting.empty();
    if (which.listed) ready_.push_back(&which);
}

void viewer::offer(subscription& to, std::shared_ptr<const channel_message> message) {
    if (gone) return;
    waiting_bytes_ += message->payload.size() + message_overhead;
    to.waiting.push_back(std::move(message));
    if (to.waiting.size() > to.depth) {
        waiting_bytes_ -= to.waiting.front()->payload.size() + message_overhead;
        to.waiting.pop_front();
        ++skipped_;
    }
    if (!std::exchange(to.listed, true)) ready_.push_back(&to);
    while (waiting_bytes_ > limits_.max_waiting_bytes && (ready_.size() > 1 || ready_.front()->waiting.size() > 1))
        skip_oldest();
    wake_();
}

void viewer::fill(std::string& to) {
    const auto enough = to.size() + batch_bytes;
    while (!control_.empty() && to.size() < enough) {
        auto next = std::move(control_.front());
        control_.pop_front();
        control_bytes_ -= next.counted;
        ise::append_frame(to, next.is_text ? ise::web_socket_opcode::text : ise::web_socket_opcode::binary,
                          *next.content);
    }
    if (!control_.empty()) return; // messages may belong to a channel that is still to be advertised
    if (time_) ise::append_frame(to, ise::web_socket_opcode::binary, *std::exchange(time_, std::nullopt));
    while (!ready_.empty() && to.size() < enough) {
        auto& from = *ready_.front();
        ready_.pop_front();
        auto next = std::move(from.waiting.front());
        from.waiting.pop_front();
        waiting_bytes_ -= next->payload.size() + message_overhead;
        auto head = write_message_head(from.id, next->at);
        ise::append_frame_head(to, ise::web_socket_opcode::binary, head.size() + next->payload.size());
        to += head;
        to += next->payload;
        ++sent_;
        from.listed = !from.waiting.empty();
        if (from.listed) ready_.push_back(&from);
    }
}

} // namespace ise::foxglove
