#include <ise/subscription/remote_subscriber.hpp>

#include <ise/core/limits.hpp>
#include <ise/packet/codec.hpp>
#include <ise/subscription/packet_frame.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>

namespace ise {
namespace {

using wire::overflow;

// So much for a lossless subscriber is written at once, before the turn ends.
constexpr std::size_t written_at_once = 64 * 1024;

// Sequence, skipped packets, time of publication, trace.
constexpr std::size_t most_head_bytes = 8 + 4 + 8 + packet_frame::trace_bytes;

// The head of a packet's frame that is put together for one subscriber.
struct packet_head {
    packet_head(const net::connection& to, std::uint64_t id, std::uint64_t sequence, std::uint32_t skipped,
                wall_time published_at, const trace_id& trace) {
        header.type = wire::frame_type::packet;
        header.id = id;
        detail::store_little(body.data(), sequence);
        size = 8;
        if (skipped) {
            header.flags = wire::flag::skipped;
            detail::store_little(body.data() + size, skipped);
            size += 4;
        }
        if (to.tells_stamps()) {
            header.flags |= wire::flag::stamped;
            detail::store_little(body.data() + size,
                                 static_cast<std::int64_t>(published_at.time_since_epoch().count()));
            size += 8;
        }
        if (trace && to.tells_packet_traces()) {
            header.flags |= wire::flag::caused;
            packet_frame::put_trace(body.data() + size, trace);
            size += packet_frame::trace_bytes;
        }
    }
    bytes_view view() const noexcept { return bytes_view(body).first(size); }

    wire::frame_header header;
    std::array<std::byte, most_head_bytes> body;
    std::size_t size;
};

} // namespace

remote_subscriber::remote_subscriber(subscriber_group& of, const wire::subscribe& terms, subscriber_info info,
                                     bool takes_objects)
    : group_(of), policy_(terms.policy), depth_(std::clamp<std::uint32_t>(terms.depth, 1, limit::subscription_depth)),
      credit_(terms.credit),
      min_interval_(static_cast<std::int64_t>(std::min<std::uint64_t>(terms.min_interval_ns, std::int64_t{1} << 62))),
      max_bytes_(of.runtime().options().queued_bytes()), info_(std::move(info)) {
    if (policy_ == overflow::keep_latest) depth_ = 1;
    auto& env = of.runtime().env();
    for (std::size_t half = 0; half < ticket_.size(); half += 8)
        detail::store_little(reinterpret_cast<std::byte*>(&ticket_[half]), env.random());
    if (policy_ == overflow::lossless) ++group_.lossless;
    take_objects(takes_objects);
}

remote_subscriber::~remote_subscriber() {
    stop_lingering();
    if (line_) line_->held_bytes() -= held();
    if (line_) line_->wire().out().remove(*this);
    if (policy_ == overflow::lossless) --group_.lossless;
    if (takes_objects_) --group_.object_takers;
}

void remote_subscriber::take_objects(bool wanted) noexcept {
    if (wanted == takes_objects_) return;
    takes_objects_ = wanted;
    if (wanted) ++group_.object_takers;
    else --group_.object_takers;
    if (!wanted) write_objects();
}

// It came back over another way, which takes bytes only.
void remote_subscriber::write_objects() {
    std::uint32_t carried = 0; // by packets that cannot be written
    send_queue written;
    while (!queue_.empty()) {
        auto next = queue_.pop(std::numeric_limits<std::size_t>::max());
        next.skipped += std::exchange(carried, 0);
        try {
            if (next.object)
                next.frames =
                    group_.frame_of(std::exchange(next.object, {}), next.sequence, next.published_at, next.trace);
            written.push(std::move(next));
        } catch (const std::exception& thrown) {
            group_.runtime().log().warning(thrown.what(), {{"service", group_.name()}, {"peer", info_.peer}});
            carried = next.skipped;
            ++dropped_;
            if (loses_nothing()) ++beyond_;
        }
    }
    skipped_ += carried;
    queue_ = std::move(written);
}

void remote_subscriber::attach(subscriber_line& over, std::uint64_t id) {
    group_.settle();
    stop_lingering();
    line_ = &over;
    line_->held_bytes() += held();
    stay_within_bytes();
    id_ = group_.usual_id = id;
    if (auto* memory = over.wire().loan_memory()) group_.use(*memory);
    queue_.readdress();
    sent_ = 0;
    info_.peer = over.over().peer_name();
    wake();
}

void remote_subscriber::let_go(const subscriber_line& of) {
    if (line_ != &of) return;
    group_.settle();
    line_->wire().out().remove(*this);
    line_ = nullptr;
}

void remote_subscriber::detach() {
    if (!line_) return;
    group_.settle();
    line_->wire().out().remove(*this);
    line_->held_bytes() -= held();
    line_ = nullptr;
    auto& runtime = group_.runtime();
    linger_ = std::make_unique<timer>(runtime.on(), [this] { group_.vanish(*this); });
    linger_->arm(saturating_add(runtime.on().now(), runtime.options().linger));
    group_.began_to_linger(*this);
    group_.room_made();
}

void remote_subscriber::stop_lingering() {
    if (linger_) group_.stopped_lingering(*this);
    linger_.reset();
}

[[gnu::hot]] send_queue::stretch remote_subscriber::pop(std::uint64_t most) {
    auto taken = queue_.pop(most);
    if (line_) line_->held_bytes() -= taken.cost();
    resent_ -= std::min(resent_, taken.packets);
    full_since_ = time_point::max();
    return taken;
}

void remote_subscriber::keep(const send_queue::stretch& sent) {
    sent_packets_.push(sent);
    if (!line_) return;
    line_->held_bytes() += sent.cost();
    stay_within_bytes();
}

// A session beyond its bytes has no open runs, so an open run implies that its sessions have room.
void remote_subscriber::stay_within_bytes() noexcept {
    if (line_->held_bytes() > max_bytes_) line_->settle();
}

void remote_subscriber::resume(const wire::subscribe& terms, bool takes_objects) {
    if (auto* old = line_) { // which may not have noticed its end yet
        detach();
        old->forget(id_);
    }
    credit_ = terms.credit;
    resume_at(terms.resume.front().next_sequence);
    take_objects(takes_objects);
}

void remote_subscriber::end(const failure& why) {
    if (line_) line_->end(id_, why, unsent());
}

time_point remote_subscriber::stalled_at(time_point since) const {
    return saturating_add(std::max(full_since_, since), group_.runtime().options().max_stall);
}

time_point remote_subscriber::held_up_until(time_point since) {
    const auto& options = group_.runtime().options();
    if (full_since_ == time_point::max()) full_since_ = group_.runtime().on().now();
    const auto began = std::max(full_since_, since);
    const auto& wire = line_->wire();
    // It sends a sign four times in this period.
    const auto heartbeat = duration(static_cast<std::int64_t>(wire.terms().we_accept.heartbeat_ns));
    return std::min(stalled_at(since),
                    saturating_add(std::max(began, wire.last_heard()), std::max(options.max_silence, heartbeat)));
}

void remote_subscriber::vanish_now() { linger_->arm(group_.runtime().on().now()); }

// A subscriber grants `depth` packets ahead of those that its user has taken. Whole stretches go: what is kept beyond
// that is recognised by its number.
void remote_subscriber::forget_arrived() {
    const auto arrived = credit_ > depth_ ? credit_ - depth_ : 0;
    const auto needed = sent_ > arrived ? sent_ - arrived : 0;
    while (!sent_packets_.empty() && sent_packets_.size() - sent_packets_.front().packets >= needed) forget_sent();
}

// Beyond its bytes a session forgets what was sent first. Should it be lost before that has arrived, the subscription
// ends, and the subscriber is told how many packets it has missed.
void remote_subscriber::limit_sent() {
    while (!sent_packets_.empty() && line_->held_bytes() > max_bytes_) forget_sent();
}

void remote_subscriber::forget_sent() {
    const auto cost = sent_packets_.pop(std::numeric_limits<std::size_t>::max()).cost();
    if (line_) line_->held_bytes() -= cost;
}

void remote_subscriber::resume_at(std::uint64_t next) {
    send_queue again;
    while (!sent_packets_.empty()) {
        auto one = sent_packets_.pop(1);
        const auto sequence = one.object ? one.sequence : packet_frame::sequence_of(one.frames.view().data());
        if (sequence >= next) again.push(std::move(one));
    }
    resent_ += again.size();
    while (!queue_.empty()) again.push(queue_.pop(std::numeric_limits<std::size_t>::max()));
    queue_ = std::move(again);
    std::uint32_t skipped = 0;
    while (!sent_skips_.empty()) {
        const auto [sequence, before] = sent_skips_.pop_front();
        if (sequence >= next) skipped += before;
    }
    if (!queue_.carry_over(skipped)) skipped_ += skipped;
}

// Of a lossless one, the packets that did not arrive go again as they were.
void remote_subscriber::note_skipped(std::uint64_t sequence, std::uint32_t skipped) {
    constexpr std::size_t most = 64;
    if (skipped == 0 || policy_ == overflow::lossless) return;
    if (sent_skips_.size() == most) sent_skips_.pop_front();
    sent_skips_.push_back({sequence, skipped});
}

bool remote_subscriber::may_send() const noexcept { return policy_ != overflow::lossless || sent_ < credit_; }
bool remote_subscriber::holds_up() const noexcept { return policy_ == overflow::lossless && line_ && full(0); }

[[gnu::hot]] void remote_subscriber::wake() {
    if (!line_ || queue_.empty() || !may_send()) return;
    line_->wire().out().add(*this);
    line_->wire().written();
}

void remote_subscriber::grant(std::uint64_t total) {
    if (total <= credit_) return;
    credit_ = total;
    if (policy_ == overflow::lossless) {
        forget_arrived();
        group_.room_made();
    }
    wake();
}

bool remote_subscriber::full(std::size_t more, std::size_t same) const noexcept {
    if (queue_.size() - resent_ >= depth_) return true;
    auto beyond = [&] { return !queue_.empty() && (line_ ? line_->held_bytes() : held()) + more > max_bytes_ + same; };
    if (!beyond()) return false;
    if (line_) line_->settle();
    return beyond();
}

remote_subscriber::run_room remote_subscriber::room_for_run(const shared_bytes& newest) const noexcept {
    if (!line_ || min_interval_ > duration{} || beyond_ > 0 || !queue_.ends_with_run(newest)) return {0, 0};
    const auto waiting = queue_.size() - resent_;
    const auto held = line_->held_bytes();
    run_room room{depth_ - std::min(depth_, waiting), max_bytes_ - std::min(max_bytes_, held)};
    if (policy_ == overflow::lossless && may_send() && queue_.cost() < written_at_once)
        room.cost = std::min(room.cost, written_at_once - queue_.cost());
    return room;
}

void remote_subscriber::reserve(std::size_t cost) noexcept {
    line_->reserved_bytes() += cost;
    line_->held_bytes() += cost;
}

void remote_subscriber::extend(std::size_t packets, std::size_t size, std::size_t reserved) noexcept {
    line_->reserved_bytes() -= reserved;
    line_->held_bytes() -= reserved;
    if (packets == 0) return;
    line_->held_bytes() += size + packets * send_queue::item_bytes;
    queue_.extend(packets, size);
}

[[gnu::hot]] bool remote_subscriber::offer(const published_packet& packet) {
    const bool object = takes_objects_ && packet.object;
    const auto size = object ? packet.object.weight : packet.frame.size();
    if (min_interval_ > duration{}) {
        auto now = group_.runtime().on().now();
        if (now < next_allowed_) {
            ++skipped_;
            return true;
        }
        next_allowed_ = saturating_add(now, min_interval_);
    }
    // A publisher that waits asks for room before it knows how large the next packet is: that one may go beyond the
    // bytes, at every lossless subscriber of a session.
    const bool waits = policy_ == overflow::lossless;
    const auto more = waits ? 0 : size;
    const auto same = waits && line_ ? line_->held_by(group_, packet.sequence) : 0;
    if ((beyond_ > 0 || full(more, same)) && !make_room(more))
        return !line_; // an unreachable subscriber gets the failure when it resumes
    const auto skipped = std::exchange(skipped_, 0);
    if (object) queue_.push(packet.object, packet.sequence, packet.published_at, packet.trace, skipped);
    else queue_.push(packet.frame, skipped, packet_frame::id_of(packet.frame.view().data()) == id_);
    if (!line_) return true;
    line_->hold(size + send_queue::item_bytes, group_, packet.sequence);
    stay_within_bytes();
    if (queue_.size() == 1) wake(); // else it is awake, or waits for credit
    if (policy_ == overflow::lossless && queue_.cost() >= written_at_once && may_send()) line_->wire().written_much();
    return true;
}

// By its policy; where that is to lose nothing, the packet does not fit.
bool remote_subscriber::make_room(std::size_t more) {
    if (loses_nothing()) {
        ++beyond_;
        return false;
    }
    auto& losses = group_.losses;
    while (full(more))
        drop_oldest(queue_.size() < depth_             ? losses.too_many_bytes
                    : policy_ == overflow::keep_latest ? losses.replaced
                                                       : losses.overrun);
    return true;
}

// What was skipped before it is told with the next one.
void remote_subscriber::drop_oldest(std::uint64_t& reason) {
    ++reason;
    const auto dropped = pop(1);
    if (!queue_.carry_over(dropped.skipped)) skipped_ += dropped.skipped;
    ++dropped_;
    ++group_.runtime().counts().packets_dropped;
}

std::uint64_t remote_subscriber::longest() const noexcept {
    if (!line_) return std::numeric_limits<std::uint64_t>::max();
    const auto most = line_->wire().terms().peer_accepts.max_message_bytes;
    return most - std::min<std::uint64_t>(most, most_head_bytes);
}

[[gnu::hot]] bool remote_subscriber::take(net::outbox& out, std::size_t quantum) {
    group_.settle();
    const auto& wire = line_->wire();
    const auto most = longest();
    // Where none of them can be too large for the peer, nor goes in pieces or beside the stream, nor without its time
    // or its trace.
    const bool together =
        !wire.lossy() && wire.tells_stamps() && wire.tells_packet_traces() && most >= shared_bytes_maker::small_bytes;
    std::size_t taken = 0;
    while (!queue_.empty() && may_send() && taken < quantum) {
        const auto& next = queue_.front();
        const auto size = next.object ? next.object.weight + packet_frame::head_bytes
                                      : packet_frame::size_of(next.frames.view().data());
        if (together && !next.object && size <= shared_bytes_maker::small_bytes && next.skipped == 0) {
            auto packets = pop(policy_ == overflow::lossless ? credit_ - sent_ : next.packets);
            if (policy_ == overflow::lossless) keep(packets);
            sent_ += packets.packets;
            taken += packets.frames.size();
            out.put_frames(std::move(packets.frames), id_, packets.addressed);
            continue;
        }
        const auto packet =
            next.object ? next.object.weight : size - packet_frame::head_size(next.frames.view().data());
        if (packet > most) {
            group_.runtime().tell(
                peer_trouble::excess,
                fmt::format(
                    "a packet of '{}' with {} bytes is larger than its subscriber accepts: {} (max_message_bytes)",
                    group_.name(), packet, most),
                info_.peer);
            group_.settle(); // the log sink may have published
            drop_oldest(group_.losses.too_large);
            continue;
        }
        if (next.object) put_object(out);
        else put_alone(out);
        taken += size;
        if (size > net::outbox::whole_bytes && !wire.passes_objects()) break; // goes in pieces: the rest waits for it
    }
    if (policy_ == overflow::lossless) {
        forget_arrived();
        limit_sent();
        group_.room_made();
    }
    return !queue_.empty() && may_send();
}

void remote_subscriber::put_object(net::outbox& out) {
    auto next = pop(1);
    if (policy_ == overflow::lossless) keep(next);
    packet_head head(line_->wire(), id_, next.sequence, next.skipped, next.published_at, next.trace);
    out.put_object(head.header, head.view(), next.object.pass());
    note_skipped(next.sequence, next.skipped);
    ++sent_;
}

void remote_subscriber::put_alone(net::outbox& out) {
    auto next = pop(1);
    if (policy_ == overflow::lossless) keep(next);
    const auto* frame = next.frames.view().data();
    const auto sequence = packet_frame::sequence_of(frame);
    packet_head head(line_->wire(), id_, sequence, next.skipped, packet_frame::published_at(frame),
                     packet_frame::trace_of(frame));
    note_skipped(sequence, next.skipped);
    out.put_packet(*this, head.header, head.view(), next.frames.behind(packet_frame::head_size(frame)));
    ++sent_;
}

} // namespace ise
