#include <ise/net/heartbeats.hpp>

#include <ise/core/buffer.hpp>
#include <ise/core/object_stream.hpp>
#include <ise/transport/datagram_stream.hpp>
#include <ise/wire/frame.hpp>

#include <asio/buffer.hpp>

#include <algorithm>
#include <array>
#include <thread>

namespace ise::net {
namespace {

// A peer that is not heard for this many of its heartbeats is lost.
constexpr int missed_heartbeats = 3;
// A peer is sent a ping at least once in so many heartbeats, however much else it is sent: its clock is read by that.
constexpr int heartbeats_a_ping = 4;

} // namespace

liveness::verdict liveness::look(time_point now, duration theirs) noexcept {
    verdict found;
    auto lost_at = heard_ + ours_ * missed_heartbeats;
    // Where it is this side that did not come round for a while, what the peer sent meanwhile is still unread.
    const bool slept = due_ != time_point{} && now - due_ > ours_ / 2;
    if (now >= lost_at && slept) {
        heard_ = now - ours_ * (missed_heartbeats - 1);
        lost_at = now + ours_;
    } else if (now >= lost_at) {
        found.lost = true;
        return found;
    }
    found.ping = now - sent_ >= theirs || round_trip_ == duration{} || now - pinged_ >= theirs * heartbeats_a_ping;
    if (found.ping) sent_ = pinged_ = now;
    due_ = std::min(lost_at, sent_ + theirs);
    found.look_again = due_;
    return found;
}

heartbeat_sender::heartbeat_sender(stream& transport, duration heartbeat, time_point now)
    : transport_(transport), datagrams_(dynamic_cast<datagram_stream*>(&transport)), full_heartbeat_(heartbeat),
      heartbeat_(heartbeat.count()), sent_(now.time_since_epoch().count()) {
    const auto* objects = dynamic_cast<object_stream*>(&transport);
    on_one_loop_ = objects && objects->on_one_loop();
}

void heartbeat_sender::wait_for_claim() noexcept {
    while (claimed_.exchange(true, std::memory_order_acquire)) std::this_thread::yield();
}

void heartbeat_sender::release(time_point sent) noexcept {
    sent_.store(sent.time_since_epoch().count(), std::memory_order_relaxed);
    held_ = false;
    claimed_.store(false, std::memory_order_release);
}

void heartbeat_sender::show(time_point now) {
    if (on_one_loop_) return;
    // The connection itself sends at each heartbeat; it gets some time for that.
    auto overdue = time_point(duration(sent_.load(std::memory_order_relaxed))) + heartbeat() + heartbeat() / 4;
    if (now < overdue) return;
    buffer sign;
    wire::put_frame(sign, wire::frame_type::pong, wire::flag::stalled, 0, [](buffer&) {});
    std::array<asio::const_buffer, 1> whole{asio::buffer(sign.data(), sign.size())};
    if (claimed_.exchange(true, std::memory_order_acquire)) return;
    transfer wrote;
    if (datagrams_) {
        if (datagrams_->show_sign()) wrote.bytes = sign.size();
    } else if (!broken_) {
        wrote = transport_.try_write(whole);
    }
    broken_ = broken_ || (wrote.bytes != 0 && wrote.bytes != sign.size());
    if (wrote.bytes == sign.size()) sent_.store(now.time_since_epoch().count(), std::memory_order_relaxed);
    claimed_.store(false, std::memory_order_release);
}

void heartbeat_senders::add(const std::shared_ptr<heartbeat_sender>& made) {
    {
        std::lock_guard lock(mutex_);
        if (all_.size() >= pruned_at_) {
            std::erase_if(all_, [](const auto& known) { return known.expired(); });
            pruned_at_ = std::max<std::size_t>(64, all_.size() * 2);
        }
        all_.push_back(made);
    }
    hasten(made->heartbeat());
}

// On the component's loop only.
void heartbeat_senders::hasten(duration heartbeat) {
    if (heartbeat >= min_heartbeat()) return;
    shortest_.store(heartbeat.count(), std::memory_order_relaxed);
    if (on_shorter_) on_shorter_();
}

void heartbeat_senders::show(time_point now) {
    std::lock_guard lock(mutex_);
    auto shortest = duration::max();
    for (const auto& known : all_) {
        const auto held = known.lock();
        if (!held) continue;
        held->show(now);
        shortest = std::min(shortest, held->heartbeat());
    }
    shortest_.store(shortest.count(), std::memory_order_relaxed); // whoever hastens one meanwhile has it shown anew
}

} // namespace ise::net
