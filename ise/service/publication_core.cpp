#include <ise/service/publication_core.hpp>

#include <ise/core/limits.hpp>
#include <ise/packet/codec.hpp>
#include <ise/service/packet_frame.hpp>
#include <ise/service/provided_subscription.hpp>
#include <ise/service/service_host.hpp>
#include <ise/service/session.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>

namespace ise {
namespace {

using wire::overflow;

// So much for a lossless subscriber is written at once, before the turn ends.
constexpr std::size_t written_at_once = 64 * 1024;

} // namespace

provided_subscription::provided_subscription(publication_core& of, const wire::subscribe& terms, subscriber_info info, bool takes_objects)
    : publication_(of), policy_(terms.policy), depth_(std::clamp<std::uint32_t>(terms.depth, 1, limit::subscription_depth)), credit_(terms.credit),
      min_interval_(static_cast<std::int64_t>(std::min<std::uint64_t>(terms.min_interval_ns, std::int64_t{1} << 62))),
      info_(std::move(info)) {
    if (policy_ == overflow::keep_latest) depth_ = 1;
    auto& env = of.host().env();
    for (std::size_t half = 0; half < ticket_.size(); half += 8) detail::store_little(reinterpret_cast<std::byte*>(&ticket_[half]), env.random());
    if (policy_ == overflow::lossless) ++publication_.lossless_;
    take_objects(takes_objects);
}

provided_subscription::~provided_subscription() {
    stop_lingering();
    if (session_) session_->subscriber_bytes() -= held();
    if (session_) session_->wire().out().remove(*this);
    if (policy_ == overflow::lossless) --publication_.lossless_;
    if (takes_objects_) --publication_.object_takers_;
}

void provided_subscription::take_objects(bool wanted) noexcept {
    if (wanted == takes_objects_) return;
    takes_objects_ = wanted;
    if (wanted) ++publication_.object_takers_;
    else --publication_.object_takers_;
    if (!wanted) write_objects();
}

// It came back over another way, which takes bytes only.
void provided_subscription::write_objects() {
    std::uint32_t carried = 0; // by packets that cannot be written
    waiting_packets written;
    while (!queue_.empty()) {
        auto next = queue_.pop(std::numeric_limits<std::size_t>::max());
        next.skipped += std::exchange(carried, 0);
        try {
            if (next.object) next.frames = publication_.frame_of(std::exchange(next.object, {}), next.sequence);
            written.push(std::move(next));
        } catch (const std::exception& thrown) {
            publication_.host().log().warning(thrown.what(), {{"service", publication_.name()}, {"peer", info_.peer}});
            carried = next.skipped;
            ++dropped_;
            if (loses_nothing()) ++beyond_;
        }
    }
    skipped_ += carried;
    queue_ = std::move(written);
}

void provided_subscription::attach(session& over, std::uint64_t id) {
    stop_lingering();
    session_ = &over;
    session_->subscriber_bytes() += held();
    id_ = publication_.usual_id_ = id;
    queue_.readdress();
    sent_ = 0;
    info_.peer = over.peer_name();
    wake();
}

void provided_subscription::let_go(const session& of) {
    if (session_ != &of) return;
    session_->wire().out().remove(*this);
    session_ = nullptr;
}

void provided_subscription::detach() {
    if (!session_) return;
    session_->wire().out().remove(*this);
    session_->subscriber_bytes() -= held();
    session_ = nullptr;
    auto& host = publication_.host();
    linger_ = std::make_unique<timer>(host.on(), [this] { publication_.vanish(*this); });
    linger_->arm(saturating_add(host.on().now(), host.options().linger));
    publication_.began_to_linger(*this);
    publication_.room_made();
}

void provided_subscription::stop_lingering() {
    if (linger_) std::erase(publication_.lingering_, this);
    linger_.reset();
}

waiting_packets::stretch provided_subscription::pop(std::size_t most) {
    auto taken = queue_.pop(most);
    popped(taken);
    return taken;
}

void provided_subscription::popped(const waiting_packets::stretch& taken) noexcept {
    if (session_) session_->subscriber_bytes() -= taken.cost();
    resent_ -= std::min(resent_, taken.packets);
    full_since_ = time_point::max();
}

void provided_subscription::keep(const waiting_packets::stretch& sent) {
    sent_packets_.push(sent);
    if (session_) session_->subscriber_bytes() += sent.cost();
}

// A subscriber grants `depth` packets ahead of those that its user has taken. Whole stretches go: what is kept beyond that is
// recognised by its number.
void provided_subscription::forget_arrived() {
    const auto arrived = credit_ > depth_ ? credit_ - depth_ : 0;
    const auto needed = sent_ > arrived ? sent_ - arrived : 0;
    while (!sent_packets_.empty() && sent_packets_.size() - sent_packets_.front().packets >= needed) {
        const auto cost = sent_packets_.pop(std::numeric_limits<std::size_t>::max()).cost();
        if (session_) session_->subscriber_bytes() -= cost;
    }
}

void provided_subscription::resume_at(std::uint64_t next) {
    waiting_packets again;
    while (!sent_packets_.empty()) {
        auto one = sent_packets_.pop(1);
        const auto sequence = one.object ? one.sequence : packet_frame::sequence_of(one.frames.view().data());
        if (sequence >= next) again.push(std::move(one));
    }
    resent_ += again.size();
    while (!queue_.empty()) again.push(queue_.pop(std::numeric_limits<std::size_t>::max()));
    queue_ = std::move(again);
}

bool provided_subscription::may_send() const noexcept { return policy_ != overflow::lossless || sent_ < credit_; }
bool provided_subscription::holds_up() const noexcept { return policy_ == overflow::lossless && session_ && full(0); }

void provided_subscription::wake() {
    if (!session_ || queue_.empty() || !may_send()) return;
    session_->wire().out().add(*this);
    session_->wire().written();
}

void provided_subscription::grant(std::uint64_t total) {
    if (total <= credit_) return;
    credit_ = total;
    if (policy_ == overflow::lossless) {
        forget_arrived();
        publication_.room_made();
    }
    wake();
}

bool provided_subscription::full(std::size_t more) const noexcept {
    if (queue_.size() - resent_ >= depth_) return true;
    const auto waiting = session_ ? session_->subscriber_bytes() : held();
    return !queue_.empty() && waiting + more > publication_.host().options().max_subscriber_bytes;
}

bool provided_subscription::offer(const published_packet& packet) {
    const bool object = takes_objects_ && packet.object;
    const auto size = object ? packet.object.weight : packet.frame.size();
    if (min_interval_ > duration{}) {
        auto now = publication_.host().on().now();
        if (now < next_allowed_) {
            ++skipped_;
            return true;
        }
        next_allowed_ = saturating_add(now, min_interval_);
    }
    // A publisher that waits asks for room before it knows how large the next packet is: that one may go beyond the bytes.
    while (beyond_ > 0 || full(policy_ == overflow::lossless ? 0 : size)) {
        if (loses_nothing()) {
            ++beyond_;
            return !session_; // out of reach it is told when it comes back
        }
        auto& losses = publication_.losses_;
        drop_oldest(queue_.size() < depth_ ? losses.too_many_bytes : policy_ == overflow::keep_latest ? losses.replaced : losses.overrun);
    }
    const auto skipped = std::exchange(skipped_, 0);
    if (object) queue_.push(packet.object, packet.sequence, skipped);
    else queue_.push(packet.frame, skipped, packet_frame::id_of(packet.frame.view().data()) == id_);
    if (!session_) return true;
    session_->subscriber_bytes() += size + waiting_packets::item_bytes;
    if (queue_.size() == 1) wake(); // else it is awake, or waits for credit
    if (policy_ == overflow::lossless && queue_.cost() >= written_at_once && may_send()) session_->wire().written_much();
    return true;
}

// What was skipped before it is told with the next one.
void provided_subscription::drop_oldest(std::uint64_t& reason) {
    ++reason;
    waiting_packets::stretch dropped;
    skipped_ += queue_.drop(dropped);
    popped(dropped);
    ++dropped_;
    ++publication_.host().counts().packets_dropped;
}

bool provided_subscription::take(net::outbox& out, std::size_t quantum) {
    const auto& wire = session_->wire();
    const auto largest = wire.terms().peer_accepts.max_message_bytes;
    // Where none of them can be too large for the peer, nor goes in pieces or beside the stream.
    const bool together = !wire.lossy() && largest >= shared_bytes_maker::small_bytes;
    std::size_t taken = 0;
    while (!queue_.empty() && may_send() && taken < quantum) {
        const auto& next = queue_.front();
        const auto size = next.object ? next.object.weight + packet_frame::head_bytes : packet_frame::size_of(next.frames.view().data());
        if (together && !next.object && size <= shared_bytes_maker::small_bytes && next.skipped == 0) {
            auto packets = pop(policy_ == overflow::lossless ? credit_ - sent_ : next.packets);
            if (policy_ == overflow::lossless) keep(packets);
            sent_ += packets.packets;
            taken += packets.frames.size();
            out.put_frames(std::move(packets.frames), id_, packets.addressed);
            continue;
        }
        if (size - packet_frame::head_bytes + 12 > largest) {
            publication_.host().tell(peer_trouble::excess, fmt::format("a packet of '{}' with {} bytes is larger than its subscriber accepts: {} (max_message_bytes)",
                                                                       publication_.name(), size - packet_frame::head_bytes, largest), info_.peer);
            drop_oldest(publication_.losses_.too_large);
            continue;
        }
        if (next.object) put_object(out);
        else put_alone(out);
        taken += size;
        if (size > net::outbox::whole_bytes && !wire.passes_objects()) break; // goes in pieces: the rest waits for it
    }
    if (policy_ == overflow::lossless) publication_.room_made();
    return !queue_.empty() && may_send();
}

namespace {

// The head of a packet's frame that is put together for one subscriber.
struct packet_head {
    packet_head(std::uint64_t id, std::uint64_t sequence, std::uint32_t skipped) {
        detail::store_little(body.data(), sequence);
        detail::store_little(body.data() + 8, skipped);
        header.type = wire::frame_type::packet;
        header.flags = skipped ? wire::flag::skipped : std::uint8_t{0};
        header.id = id;
        size = skipped ? 12 : 8;
    }
    bytes_view view() const noexcept { return bytes_view(body).first(size); }

    wire::frame_header header;
    std::array<std::byte, 12> body;
    std::size_t size;
};

} // namespace

void provided_subscription::put_object(net::outbox& out) {
    auto next = pop(1);
    if (policy_ == overflow::lossless) keep(next);
    packet_head head(id_, next.sequence, next.skipped);
    out.put_object(head.header, head.view(), next.object.pass());
    ++sent_;
}

void provided_subscription::put_alone(net::outbox& out) {
    auto next = pop(1);
    if (policy_ == overflow::lossless) keep(next);
    packet_head head(id_, packet_frame::sequence_of(next.frames.view().data()), next.skipped);
    out.put_packet(*this, head.header, head.view(), next.frames.behind(packet_frame::head_bytes));
    ++sent_;
}

publication_core::publication_core(service_host& host, std::string name, const packet_types& types)
    : host_(host), name_(std::move(name)), types_(types) {}

publication_core::~publication_core() = default;

bool publication_core::wants_object() const noexcept { return object_takers_ > 0 || all_.empty(); }

std::size_t publication_core::subscribers() const noexcept { return all_.size(); }

shared_bytes publication_core::share(function_ref<void(buffer&)> write_packet) {
    auto& room = maker_.room();
    room.grow(packet_frame::head_bytes); // is stamped in begin_packet
    write_packet(room);
    if (room.size() > std::numeric_limits<std::uint32_t>::max()) throw error(errc::too_large, fmt::format("a packet of '{}' has {} bytes, which no frame holds", name_, room.size()));
    return maker_.share();
}

void publication_core::begin_packet(published_packet& packet) {
    packet.sequence = sequence_ + 1;
    if (packet.has_frame) {
        packet_frame::stamp(shared_bytes_maker::open(packet.frame), packet.frame.size(), usual_id_, packet.sequence);
    } else if (object_takers_ < all_.size()) {
        packet.frame = frame_of(packet.object, packet.sequence);
        packet.has_frame = true;
    }
    ++sequence_;
    ++host_.counts().packets_published;
}

shared_bytes publication_core::frame_of(const shared_packet& object, std::uint64_t sequence) {
    auto frame = share([&](buffer& out) { object.write(out); });
    packet_frame::stamp(shared_bytes_maker::open(frame), frame.size(), usual_id_, sequence);
    return frame;
}

void publication_core::publish(published_packet packet) {
    begin_packet(packet);
    std::vector<std::uint64_t> too_slow;
    for (auto& who : all_)
        if (!who.offer(packet)) too_slow.push_back(who.info_.number);
    last_ = std::move(packet);
    if (!too_slow.empty()) end_too_slow(too_slow);
}

void publication_core::publish_to(published_packet packet, function_ref<bool(const subscriber_info&)> wants) {
    begin_packet(packet);
    selective_ = true;
    std::vector<std::uint64_t> too_slow;
    for (auto& who : all_) {
        if (!wants(who.info())) {
            who.pass();
        } else if (!who.offer(packet)) {
            too_slow.push_back(who.info_.number);
        }
    }
    if (!too_slow.empty()) end_too_slow(too_slow);
}

// The last value is the newest for who comes now, also where later ones were for some only.
std::optional<published_packet> publication_core::last_packet(bool as_object) {
    if (!last_) return std::nullopt;
    published_packet made;
    made.sequence = sequence_;
    if (as_object && last_->object) {
        made.object = last_->object;
        return made;
    }
    try {
        if (!last_->has_frame) last_->frame = frame_of(last_->object, last_->sequence);
        last_->has_frame = made.has_frame = true;
        made.frame = last_->frame;
        if (last_->sequence == sequence_) return made;
        made.frame = share([&](buffer& out) { out.append(last_->frame.view().subspan(packet_frame::head_bytes)); });
        packet_frame::stamp(shared_bytes_maker::open(made.frame), made.frame.size(), usual_id_, sequence_);
        return made;
    } catch (const std::exception& thrown) { // of a packet with functions of its own
        host_.log().warning(thrown.what(), {{"service", name_}});
        return std::nullopt;
    }
}

// Once the packet has been offered to all: the user is called back, and may publish.
void publication_core::end_too_slow(const std::vector<std::uint64_t>& numbers) {
    for (auto number : numbers) {
        auto found = std::find_if(all_.begin(), all_.end(), [&](const auto& who) { return who.info_.number == number; });
        if (found == all_.end()) continue;
        ++losses_.ended;
        end(*found, failure(errc::overloaded, fmt::format("the subscriber of '{}' did not take its packets in time: {} are lost", name_, found->unsent())));
    }
}

std::size_t publication_core::queued() const noexcept {
    std::size_t sum = 0;
    for (const auto& who : all_) sum += who.queued();
    return sum;
}

bool publication_core::has_room() const noexcept {
    if (lossless_ == 0) return true;
    for (const auto& who : all_)
        if (who.holds_up()) return false;
    return true;
}

task<> publication_core::wait_for_room() {
    waiter<> room(host_.on(), [&room] { room.resume(); });
    struct entry {
        std::vector<waiter<>*>& all;
        waiter<>* mine;
        ~entry() { std::erase(all, mine); }
    } guard{waiting_, &room};
    waiting_.push_back(&room);
    // The publisher offered to wait, not to be held up for ever.
    auto began = host_.on().now();
    timer patience(host_.on(), [this, &room, &patience, &began] {
        const auto now = host_.on().now();
        // Where it is this side that did not come round for a while, what the subscribers sent meanwhile is still unread.
        if (now - patience.at() > host_.options().longest_silence / 2) began = now;
        else end_holding_up(began);
        room.resume();
    });
    while (!has_room()) {
        auto first = time_point::max();
        for (auto& who : all_)
            if (who.holds_up()) first = std::min(first, held_up_until(who, began));
        patience.arm(first);
        co_await room.wait();
    }
}

// When a subscriber that holds up a publisher which waits since then must have moved, or been heard.
time_point publication_core::held_up_until(provided_subscription& who, time_point since) const {
    const auto& options = host_.options();
    if (who.full_since_ == time_point::max()) who.full_since_ = host_.on().now();
    const auto began = std::max(who.full_since_, since);
    const auto& wire = who.session_->wire();
    // It sends a sign four times in this period.
    const auto heartbeat = duration(static_cast<std::int64_t>(wire.terms().we_accept.heartbeat_ns));
    return std::min(saturating_add(began, options.longest_stall),
                    saturating_add(std::max(began, wire.last_heard()), std::max(options.longest_silence, heartbeat)));
}

void publication_core::end_holding_up(time_point since) {
    const auto now = host_.on().now();
    for (;;) {
        auto found = std::ranges::find_if(all_, [&](auto& who) { return who.holds_up() && held_up_until(who, since) <= now; });
        if (found == all_.end()) return;
        ++losses_.ended;
        const bool silent = now < saturating_add(std::max(found->full_since_, since), host_.options().longest_stall);
        const auto* limit = silent ? "longest_silence" : "longest_stall";
        host_.tell(peer_trouble::broken, fmt::format("a lossless subscriber of '{}' held up its publisher ({}) and was ended", name_, limit), found->info_.peer);
        end(*found, failure(errc::overloaded, fmt::format("the subscriber of '{}' {} for as long as it may hold up the publisher ({}): {} packets are lost", name_,
                                                          silent ? "was not heard" : "took nothing", limit, found->unsent())));
    }
}

// Who vanishes again and again leaves no more than this behind; the oldest goes as if its time were over.
void publication_core::began_to_linger(provided_subscription& who) {
    lingering_.push_back(&who);
    if (lingering_.size() <= host_.options().max_lingering) return;
    lingering_.front()->linger_->arm(host_.on().now());
    lingering_.pop_front();
}

void publication_core::room_made() {
    if (waiting_.empty() || !has_room()) return;
    for (auto* room : waiting_) room->resume();
}

result<provided_subscription*> publication_core::resume(provided_subscription& who, const wire::subscribe& terms, bool takes_objects, wire::subscribed& answer,
                                                        std::uint64_t& lost) {
    const auto& wanted = terms.resume.front();
    if (auto* old = who.session_) { // which may not have noticed its end yet
        who.detach();
        old->forget_provided(who.id_);
    }
    who.credit_ = terms.credit;
    who.resume_at(wanted.next_sequence);
    who.take_objects(takes_objects);
    if (who.beyond_ > 0) {
        lost = who.unsent();
        failure why(errc::overloaded, fmt::format("the subscriber of '{}' was out of reach for longer than its packets could be kept: {} are lost", name_, lost));
        ++losses_.ended;
        drop(who);
        return why;
    }
    // But for a lossless one, what was sent and did not arrive is a gap that the sequence tells.
    answer.ticket = who.ticket();
    answer.first_sequence = wanted.next_sequence;
    answer.resumed = true;
    // The latest packet may have been under way when the session ended, and none may follow for long.
    bool missed = wanted.next_sequence <= sequence_ && who.queue_.empty();
    if (terms.last_value && missed)
        if (auto last = last_packet(takes_objects)) who.offer(*last);
    return &who;
}

// Every packet, or the end.
failure publication_core::cannot_resume(const wire::subscribe& terms, std::uint64_t& lost) const {
    const auto& wanted = terms.resume.front();
    const bool same_life = wanted.incarnation == host_.self().incarnation;
    const bool known = same_life && !selective_ && terms.min_interval_ns == 0 && wanted.next_sequence <= sequence_ + 1;
    lost = known ? sequence_ + 1 - wanted.next_sequence : wire::unknown_loss;
    return {errc::peer_lost, fmt::format("the subscription to '{}' without loss cannot go on: {}, and {} packets are lost", name_,
                                         same_life ? "it was ended while its subscriber was out of reach" : "the provider was restarted, or is another one",
                                         known ? std::to_string(lost) : "an unknown number of")};
}

result<provided_subscription*> publication_core::subscribe(session& from, const wire::subscribe& terms, const adapter* adapt, bool takes_objects,
                                                           wire::subscribed& answer, std::uint64_t& lost) {
    if (stopped_) return *stopped_;
    answer.incarnation = host_.self().incarnation;
    if (!terms.resume.empty()) {
        if (terms.resume.front().incarnation == host_.self().incarnation)
            for (auto& who : all_)
                if (who.ticket() == terms.resume.front().ticket) return resume(who, terms, takes_objects, answer, lost);
        if (terms.policy == overflow::lossless) return cannot_resume(terms, lost);
    }
    subscriber_info info;
    info.peer = from.peer_name();
    info.number = next_number_++;
    bytes response;
    if (accept) { // it may publish: who is not accepted yet gets nothing of that but the last value
        auto decided = accept(std::as_bytes(std::span(terms.request)), adapt, info);
        if (!decided) return decided.error();
        response = std::move(*decided);
    }
    auto& who = all_.emplace_back(*this, terms, std::move(info), takes_objects);
    answer.ticket = who.ticket();
    answer.response.assign(reinterpret_cast<const std::uint8_t*>(response.data()),
                           reinterpret_cast<const std::uint8_t*>(response.data()) + response.size());
    auto last = terms.last_value ? last_packet(takes_objects) : std::nullopt;
    answer.first_sequence = last ? sequence_ : sequence_ + 1;
    if (last) who.offer(*last);
    return &who;
}

bytes publication_core::unsubscribe(provided_subscription& who, bytes_view request, const adapter* adapt) {
    auto info = take_out(who);
    return removed ? removed(request, adapt, info) : bytes();
}

void publication_core::end(provided_subscription& who, const failure& why) {
    if (who.session_) who.session_->end_provided(who.id_, why, who.unsent());
    drop(who);
}

void publication_core::vanish(provided_subscription& who) {
    host_.log().debug("a subscriber did not come back", {{"service", name_}, {"peer", who.info_.peer}});
    drop(who);
}

// The user's callback comes when nothing of the subscriber is left.
void publication_core::drop(provided_subscription& who) {
    auto info = take_out(who);
    if (!removed) return;
    try {
        removed({}, nullptr, info);
    } catch (const std::exception& thrown) {
        host_.tell(peer_trouble::callback, fmt::format("'{}': {}", name_, thrown.what()), info.peer);
    }
}

subscriber_info publication_core::take_out(provided_subscription& who) {
    std::list<provided_subscription> gone;
    auto found = std::find_if(all_.begin(), all_.end(), [&](const auto& entry) { return &entry == &who; });
    gone.splice(gone.end(), all_, found);
    auto info = std::move(gone.front().info_);
    gone.clear();
    room_made();
    return info;
}

void publication_core::stop(const failure& why) {
    stopped_ = why; // also for those whose packets are compared with ours just now
    while (!all_.empty()) end(all_.front(), why);
    for (auto* room : waiting_) room->resume();
}

void publication_core::let_go() {
    while (!all_.empty()) {
        auto& who = all_.front();
        if (who.session_) who.session_->forget_provided(who.id_);
        drop(who);
    }
    for (auto* room : waiting_) room->resume();
}

} // namespace ise
