#include <ise/subscription/publication_core.hpp>

#include <ise/core/limits.hpp>
#include <ise/core/listed_waiter.hpp>
#include <ise/packet/codec.hpp>
#include <ise/session/tracer.hpp>
#include <ise/subscription/packet_frame.hpp>
#include <ise/subscription/remote_subscriber.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>

namespace ise {

using wire::overflow;

namespace {

constexpr std::size_t max_frame_bytes = std::numeric_limits<std::uint32_t>::max();

} // namespace

publication_core::publication_core(service_runtime& runtime, std::string name, const packet_types& types)
    : subscriber_group(runtime, std::move(name)), types_(types) {}

publication_core::~publication_core() { settle(); }

void publication_core::throw_empty() {
    throw error(errc::invalid_argument, "an empty publication: assign what `publish(service)` gave first");
}

bool publication_core::wants_object() const noexcept { return object_takers > 0 || all_.empty(); }

std::size_t publication_core::subscribers() const noexcept { return all_.size(); }

std::uint64_t publication_core::longest_for(std::uint64_t number) const noexcept {
    const auto found = std::ranges::find_if(all_, [&](const auto& who) { return who.info().number == number; });
    return found == all_.end() ? std::numeric_limits<std::uint64_t>::max() : found->longest();
}

// The head is completed in publish.
[[gnu::hot]] published_packet publication_core::encoded(const trace_id& trace,
                                                        function_ref<void(buffer&)> write_packet) {
    settle(); // the new frame is placed behind the run
    auto& room = maker_.room();
    room.grow(packet_frame::head_size(trace));
    write_packet(room);
    if (room.size() > max_frame_bytes) throw_too_large(room.size());
    return {maker_.share(), trace};
}

[[gnu::hot]] published_packet publication_core::encoded(const trace_id& trace, bytes_view packet) {
    settle();
    const auto head = packet_frame::head_size(trace);
    const auto size = head + packet.size();
    if (size > max_frame_bytes) throw_too_large(size);
    auto frame = maker_.make(size);
    if (!packet.empty()) std::memcpy(shared_bytes_maker::open(frame) + head, packet.data(), packet.size());
    return {std::move(frame), trace};
}

void publication_core::throw_too_large(std::size_t frame) const {
    throw error(errc::too_large, fmt::format("a packet of '{}' has {} bytes, which no frame holds", name(), frame));
}

shared_bytes publication_core::frame_of(const shared_packet& object, std::uint64_t sequence, wall_time published_at,
                                        const trace_id& trace) {
    auto frame = encoded(trace, [&](buffer& out) { object.write(out); }).frame;
    packet_frame::complete(shared_bytes_maker::open(frame), frame.size(), usual_id, sequence, published_at, trace);
    return frame;
}

// Its span causes what the subscribers do with the packet.
void publication_core::record_publication(trace_id& trace) const {
    auto* traces = runtime().options().traces.get();
    if (!traces) return;
    const auto id = traces->next_id();
    traces->ended(trace, id, span::side::producer, {}, runtime().on().now(), {}, name(), runtime().self().path, {});
    trace.parent = id;
}

[[gnu::hot]] void publication_core::publish(const trace_id& trace, function_ref<void(buffer&)> write_packet) {
    auto& room = maker_.room();
    const auto head = packet_frame::head_size(trace);
    room.grow(head);
    write_packet(room);
    if (room.size() <= shared_bytes_maker::small_bytes) {
        publish(trace, room.view().subspan(head));
        return maker_.drop_small();
    }
    if (room.size() > max_frame_bytes) throw_too_large(room.size());
    publish({maker_.share(), trace});
}

[[gnu::hot]] void publication_core::publish(const trace_id& trace, bytes_view packet) {
    const auto size = packet_frame::head_bytes + packet.size();
    if (!run_.takes(size) || trace) [[unlikely]]
        return publish_behind(trace, packet);
    auto* frame = run_.take(size);
    packet_frame::complete(frame, size, usual_id, ++sequence_, runtime().publication_time());
    if (!packet.empty()) std::memcpy(frame + packet_frame::head_bytes, packet.data(), packet.size());
    ++runtime().counts().packets_published;
}

// The run is over, or there was none.
void publication_core::publish_behind(const trace_id& trace, bytes_view packet) { publish(encoded(trace, packet)); }

// A run begins once every subscriber has queued a few packets that lie one behind the other.
void publication_core::begin_run() noexcept {
    const auto memory = maker_.room_behind(last_->frame);
    if (memory.empty() || all_.empty()) return;
    remote_subscriber::run_room room{memory.size() / packet_frame::head_bytes, max_frame_bytes};
    for (const auto& who : all_) {
        const auto its = who.room_for_run(last_->frame);
        room.packets = std::min(room.packets, its.packets);
        room.cost = std::min(room.cost, its.cost / all_.size());
        if (room.packets == 0) return;
    }
    // Up to half of the room is for what holding the packets costs, the rest for their frames.
    const auto packets = std::min(room.packets, room.cost / (2 * send_queue::item_bytes));
    if (packets == 0) return;
    const auto items = packets * send_queue::item_bytes;
    const auto bytes_left = std::min(memory.size(), room.cost - items);
    run_ = {packets, memory.data(), memory.data() + bytes_left, nullptr, items + bytes_left};
    for (auto& who : all_) who.reserve(run_.reserved);
}

void publication_core::end_run() noexcept {
    const auto ended = std::exchange(run_, {});
    const auto packets = static_cast<std::size_t>(sequence_ - last_->sequence);
    const auto begin = last_->frame.view();
    const auto size = static_cast<std::size_t>(ended.next - (begin.data() + begin.size()));
    for (auto& who : all_) who.extend(packets, size, ended.reserved);
    if (packets == 0) return;
    maker_.grow(size);
    last_->frame.grow(size);
    last_->frame.drop_front(static_cast<std::size_t>(ended.newest - begin.data()));
    last_->sequence = sequence_;
    last_->published_at = packet_frame::published_at(ended.newest);
    last_->object = {};
    last_->trace = {};
}

// The predicate is asked before anything of the packet counts: it may publish, end subscribers and throw.
void publication_core::publish_to(published_packet packet, choice wants) {
    std::vector<subscriber_info> asked;
    for (const auto& who : all_) asked.push_back(who.info());
    std::vector<std::uint64_t> chosen;
    for (const auto& who : asked)
        if (wants(who)) chosen.push_back(who.number);
    publish(std::move(packet), &chosen);
}

[[gnu::hot]] void publication_core::publish(published_packet&& packet, const std::vector<std::uint64_t>* chosen) {
    settle();
    packet.sequence = sequence_ + 1;
    packet.published_at = runtime().publication_time();
    if (packet.trace) [[unlikely]]
        record_publication(packet.trace);
    if (packet.frame) {
        packet_frame::complete(shared_bytes_maker::open(packet.frame), packet.frame.size(), usual_id, packet.sequence,
                               packet.published_at, packet.trace);
    } else if (object_takers < all_.size()) {
        packet.frame = frame_of(packet.object, packet.sequence, packet.published_at, packet.trace);
    }
    ++sequence_;
    ++runtime().counts().packets_published;
    bool too_slow = false;
    for (auto& who : all_) {
        if (chosen && !std::ranges::binary_search(*chosen, who.info().number)) who.pass();
        else if (!who.offer(packet)) too_slow = true;
    }
    if (chosen) {
        selective_ = true;
    } else {
        last_ = std::move(packet);
        begin_run();
    }
    if (too_slow) end_too_slow();
}

// The last value is the newest for who comes now, also where later ones were for some only. Who comes later has no part
// in its trace.
std::optional<published_packet> publication_core::last_packet(bool as_object) {
    if (!last_) return std::nullopt;
    published_packet made;
    made.sequence = sequence_;
    made.published_at = last_->published_at;
    if (as_object && last_->object) {
        made.object = last_->object;
        return made;
    }
    try {
        if (!last_->frame) last_->frame = frame_of(last_->object, last_->sequence, last_->published_at, {});
        made.frame = last_->frame;
        const auto head = packet_frame::head_size(made.frame.view().data());
        if (last_->sequence == sequence_ && head == packet_frame::head_bytes) return made;
        made.frame = encoded({}, last_->frame.view().subspan(head)).frame;
        packet_frame::complete(shared_bytes_maker::open(made.frame), made.frame.size(), usual_id, sequence_,
                               made.published_at);
        return made;
    } catch (const std::exception& thrown) { // of a packet with functions of its own
        runtime().log().warning(thrown.what(), {{"service", name()}});
        return std::nullopt;
    }
}

// Once the packet has been offered to all: the user is called back, and may publish.
void publication_core::end_too_slow() {
    for (;;) {
        auto found = std::ranges::find_if(all_, [](const auto& who) { return who.attached() && who.overrun(); });
        if (found == all_.end()) return;
        ++losses.ended;
        end(*found, failure(errc::overloaded,
                            fmt::format("the subscriber of '{}' did not take its packets in time: {} are lost", name(),
                                        found->unsent())));
    }
}

std::size_t publication_core::queued() noexcept {
    settle();
    std::size_t sum = 0;
    for (const auto& who : all_) sum += who.queued();
    return sum;
}

bool publication_core::each_has_room() noexcept {
    settle();
    for (const auto& who : all_)
        if (who.holds_up()) return false;
    return true;
}

task<> publication_core::wait_for_room() {
    listed_waiter room(runtime().on(), waiting_);
    // The publisher offered to wait, not to be held up for ever.
    auto began = runtime().on().now();
    timer patience(runtime().on(), [this, &room, &patience, &began] {
        const auto now = runtime().on().now();
        // Where it is this side that did not come round for a while, what the subscribers sent meanwhile is still
        // unread.
        if (now - patience.at() > runtime().options().max_silence / 2) began = now;
        else end_holding_up(began);
        room.resume();
    });
    while (!has_room()) {
        auto first = time_point::max();
        for (auto& who : all_)
            if (who.holds_up()) first = std::min(first, who.held_up_until(began));
        patience.arm(first);
        co_await room.wait();
    }
}

task<> publication_core::send_when_room(std::shared_ptr<publication_core> to, published_packet packet) {
    if (!to->has_room()) co_await to->wait_for_room();
    to->publish(std::move(packet));
}

void publication_core::end_holding_up(time_point since) {
    const auto now = runtime().on().now();
    for (;;) {
        auto found =
            std::ranges::find_if(all_, [&](auto& who) { return who.holds_up() && who.held_up_until(since) <= now; });
        if (found == all_.end()) return;
        ++losses.ended;
        const bool silent = now < found->stalled_at(since);
        const auto* limit = silent ? "max_silence" : "max_stall";
        runtime().tell(
            peer_trouble::broken,
            fmt::format("a lossless subscriber of '{}' held up its publisher ({}) and was ended", name(), limit),
            found->info().peer);
        end(*found,
            failure(
                errc::overloaded,
                fmt::format(
                    "the subscriber of '{}' {} for as long as it may hold up the publisher ({}): {} packets are lost",
                    name(), silent ? "was not heard" : "took nothing", limit, found->unsent())));
    }
}

// Who vanishes again and again leaves no more than this behind; the oldest goes as if its time were over.
void publication_core::began_to_linger(remote_subscriber& who) {
    lingering_.push_back(&who);
    if (lingering_.size() <= runtime().options().max_lingering) return;
    lingering_.front()->vanish_now();
    lingering_.pop_front();
}

void publication_core::room_made() {
    if (waiting_.empty() || !has_room()) return;
    for (auto* room : waiting_) room->resume();
}

result<remote_subscriber*> publication_core::resume(remote_subscriber& who, const wire::subscribe& terms,
                                                    bool takes_objects, wire::subscribed& answer, std::uint64_t& lost) {
    const auto& wanted = terms.resume.front();
    who.resume(terms, takes_objects);
    if (who.overrun()) {
        lost = who.unsent();
        failure why(
            errc::overloaded,
            fmt::format(
                "the subscriber of '{}' was out of reach for longer than its packets could be kept: {} are lost",
                name(), lost));
        ++losses.ended;
        drop(who);
        return why;
    }
    // But for a lossless one, what was sent and did not arrive is a gap that the sequence tells.
    answer.ticket = who.ticket();
    answer.first_sequence = wanted.next_sequence;
    answer.resumed = true;
    // The latest packet may have been under way when the session ended, and none may follow for long.
    const bool missed = last_ && wanted.next_sequence <= last_->sequence && who.queued() == 0;
    if (terms.last_value && missed)
        if (auto last = last_packet(takes_objects)) who.offer(*last);
    return &who;
}

// Every packet, or the end.
failure publication_core::cannot_resume(const wire::subscribe& terms, std::uint64_t& lost) const {
    const auto& wanted = terms.resume.front();
    const bool same_life = wanted.incarnation == runtime().self().incarnation;
    const bool known = same_life && !selective_ && terms.min_interval_ns == 0 && wanted.next_sequence <= sequence_ + 1;
    lost = known ? sequence_ + 1 - wanted.next_sequence : wire::unknown_loss;
    return {errc::peer_lost,
            fmt::format("the subscription to '{}' without loss cannot go on: {}, and {} packets are lost", name(),
                        same_life ? "it was ended while its subscriber was out of reach"
                                  : "the provider was restarted, or is another one",
                        known ? std::to_string(lost) : "an unknown number of")};
}

result<remote_subscriber*> publication_core::subscribe(subscriber_line& from, const wire::subscribe& terms,
                                                       const adapter* adapt, bool takes_objects,
                                                       wire::subscribed& answer, std::uint64_t& lost) {
    if (stopped_) return *stopped_;
    settle();
    answer.incarnation = runtime().self().incarnation;
    if (!terms.resume.empty()) {
        if (terms.resume.front().incarnation == runtime().self().incarnation)
            for (auto& who : all_)
                if (who.ticket() == terms.resume.front().ticket && who.info().who == from.over().verified().who)
                    return resume(who, terms, takes_objects, answer, lost);
        if (terms.policy == overflow::lossless) return cannot_resume(terms, lost);
    }
    subscriber_info info;
    info.peer = from.over().peer_name();
    info.who = from.over().verified().who;
    info.number = next_number_++;
    bytes response;
    if (accept) { // it may publish: who is not accepted yet gets nothing of that but the last value
        auto decided = accept(std::as_bytes(std::span(terms.request)), adapt, info);
        if (!decided) return decided.error();
        response = std::move(*decided);
    }
    settle(); // the callback may have published
    auto& who = all_.emplace_back(*this, terms, std::move(info), takes_objects);
    if (stopped_) { // by that decision
        drop(who);
        return *stopped_;
    }
    answer.ticket = who.ticket();
    answer.response.assign(reinterpret_cast<const std::uint8_t*>(response.data()),
                           reinterpret_cast<const std::uint8_t*>(response.data()) + response.size());
    auto last = terms.last_value ? last_packet(takes_objects) : std::nullopt;
    answer.first_sequence = last ? sequence_ : sequence_ + 1;
    if (last) who.offer(*last);
    return &who;
}

bytes publication_core::unsubscribe(remote_subscriber& who, bytes_view request, const adapter* adapt) {
    auto info = take_out(who);
    return removed ? removed(request, adapt, info) : bytes();
}

void publication_core::end(remote_subscriber& who, const failure& why) {
    settle();
    who.end(why);
    drop(who);
}

void publication_core::vanish(remote_subscriber& who) {
    runtime().log().debug("a subscriber did not come back", {{"service", name()}, {"peer", who.info().peer}});
    drop(who);
}

// The user's callback comes when nothing of the subscriber is left, and may withdraw the service.
void publication_core::drop(remote_subscriber& who) {
    auto held = shared_from_this();
    auto info = take_out(who);
    if (!removed) return;
    try {
        removed({}, nullptr, info);
    } catch (const std::exception& thrown) {
        runtime().tell(peer_trouble::callback, fmt::format("'{}': {}", name(), thrown.what()), info.peer);
    }
}

subscriber_info publication_core::take_out(remote_subscriber& who) {
    settle();
    std::list<remote_subscriber> gone;
    auto found = std::find_if(all_.begin(), all_.end(), [&](const auto& entry) { return &entry == &who; });
    gone.splice(gone.end(), all_, found);
    auto info = gone.front().info();
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
        if (auto* line = who.line()) line->forget(who.id());
        drop(who);
    }
    for (auto* room : waiting_) room->resume();
}

} // namespace ise
