#include <components/communication_node/kept_telemetry.hpp>

#include <components/boat/telemetry.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma {
namespace {

constexpr std::size_t disk_batch = 256, max_raw = 1024;

bool can_be_kept(const telemetry_packet& packet) { return packet.raw.size() >= 2 && packet.raw.size() <= max_raw; }

ise::error telemetry_refused(std::string why) { return ise::error(ise::errc::refused, std::move(why)); }

} // namespace

kept_telemetry::kept_telemetry(node_context& here, store_keeper& store, other_node& peer, boat_links& links,
                               const opened_store& opened, std::function<void()> kept)
    : here_(here), store_(store), peer_(peer), links_(links), kept_(std::move(kept)),
      telemetry_(here.self.publish(services::telemetry)),
      shown_(store->head()) { // subscribers that got less catch up by `track`
    for (const auto& [kind, at] : opened.known.newest) newest_.know(kind, at);
    if (opened.known.last_location) note_fix(*opened.known.last_location);
}

void kept_telemetry::take(std::vector<telemetry_packet> packets, node_store::then<node_store::kept> done) {
    for (auto& packet : packets) {
        packet.store = packet.position = packet.peer_store = packet.peer_position = 0;
        links_.heard(packet);
        mark_history(packet);
    }
    auto count = packets.size();
    node_store::then<node_store::kept> noted = [this, count,
                                                done = std::move(done)](ise::result<node_store::kept> kept) mutable {
        if (kept) {
            duplicates_ += count - kept->fresh;
            if (kept->fresh > 0) {
                peer_.notify_news();
                show();
            }
            kept_();
        }
        done(std::move(kept));
    };
    store_->add(std::move(packets), store_.written(std::move(noted)));
}

void kept_telemetry::receive(std::vector<telemetry_packet> packets) {
    refused_ += std::erase_if(packets, [](const auto& packet) { return !can_be_kept(packet); });
    for (auto& packet : packets) held_.push_back(std::move(packet));
    if (store_.well() && !held_.empty()) take_next();
    for (; held() > here_.options.max_held && !held_.empty(); held_.pop_front()) ++dropped_;
}

void kept_telemetry::take_held() {
    if (held_.empty() && store_.well()) return;
    take_next();
}

/// One batch at a time, until nothing is held or the store fails; an empty one if there is none, which finds out
/// whether the store is there again. A store that calls back at once does not nest.
void kept_telemetry::take_next() {
    if (take_loop_) return;
    take_loop_ = true;
    bool failed = false;
    for (bool first = true; !taking_ && !failed && (first || !held_.empty()); first = false) {
        taking_ = true;
        auto some = static_cast<std::ptrdiff_t>(std::min(held_.size(), disk_batch));
        under_way_.assign(std::make_move_iterator(held_.begin()), std::make_move_iterator(held_.begin() + some));
        held_.erase(held_.begin(), held_.begin() + some);
        take(under_way_, [this, &failed](ise::result<node_store::kept> kept) {
            taking_ = false;
            if (!kept)
                held_.insert(held_.begin(), std::make_move_iterator(under_way_.begin()),
                             std::make_move_iterator(under_way_.end()));
            under_way_.clear();
            if (take_loop_) failed = !kept;
            else if (kept && !held_.empty()) take_next();
        });
    }
    take_loop_ = false;
}

// What is restored into a new store was published before: followers find by its positions what they do not know, and
// request it.
void kept_telemetry::show() {
    if (show_loop_) return;
    show_loop_ = true;
    bool failed = false;
    while (!showing_ && !failed) {
        auto limit = peer_.shown(store_->head());
        if (store_.refilling) shown_ = limit;
        if (shown_ >= limit) break;
        showing_ = true;
        store_->packets(shown_, limit, disk_batch,
                        [this, limit, &failed](ise::result<std::vector<telemetry_packet>> packets) {
                            showing_ = false;
                            if (packets) show_page(*packets, limit);
                            else store_.failed(packets.error());
                            if (show_loop_) failed = !packets;
                            else if (packets) show();
                        });
    }
    show_loop_ = false;
    peer_.notify_progress();
}

void kept_telemetry::show_page(const std::vector<telemetry_packet>& packets, std::uint64_t limit) {
    shown_ = packets.empty() ? limit : packets.back().position;
    for (const auto& packet : packets) {
        telemetry_(packet);
        note_fix(packet);
        if (!packet.history && packet.raw.size() > 1) // another node may have kept it
            newest_.know(std::to_integer<std::uint8_t>(packet.raw[1]), plausible_time(packet));
    }
}

void kept_telemetry::went_back() {
    shown_ = std::min(shown_, store_->head());
    show();
}

bool kept_telemetry::restore(const std::vector<telemetry_packet>& packets) {
    auto kept = store_.written(store_.file().add(packets));
    if (!kept) return false;
    peer_.notify_news();
    show();
    return true;
}

/// The newest fix wins, whichever link it came over and in whichever order.
void kept_telemetry::note_fix(const telemetry_packet& packet) {
    auto measured = plausible_time(packet);
    if (packet.history || (fix_ && measured <= fix_->measured_at)) return;
    auto message = parse_telemetry(packet.raw);
    const auto* at = message ? std::get_if<location>(&message->body) : nullptr;
    if (at && has_fix(*at))
        fix_ = current_fix{packet.link, measured, at->latitude_deg, at->longitude_deg, packet.boot == beacon_boot};
}

ise::task<keep_reply> kept_telemetry::keep(keep_request request) {
    if (request.packets.size() > keep_request::max_packets)
        throw telemetry_refused(fmt::format("{} packets at once; {} are possible: ask in parts", request.packets.size(),
                                            keep_request::max_packets));
    for (const auto& packet : request.packets) {
        if (can_be_kept(packet)) continue;
        ++refused_;
        throw telemetry_refused(
            fmt::format("packet {} of boot {} has {} raw bytes; 2 to {} can be kept: nothing of this request was",
                        packet.sequence, packet.boot, packet.raw.size(), max_raw));
    }
    auto store = store_->number();
    store_answer<node_store::kept> answer(here_.self.on());
    take(std::move(request.packets), answer.here());
    auto kept = co_await answer.get();
    if (!kept)
        throw telemetry_refused(
            fmt::format("{} cannot keep telemetry: {}; do not acknowledge it to the boat, and ask again later",
                        here_.self.path(), kept.error().message()));
    while (store_->number() == store && peer_.lives() && !peer_.has_packets(kept->last))
        co_await peer_.wait_for_progress();
    if (store_->number() != store)
        throw telemetry_refused(fmt::format("the store of {} was damaged and set aside meanwhile; do not acknowledge "
                                            "the packets to the boat, and ask again",
                                            here_.self.path()));
    keep_reply made;
    made.fresh = kept->fresh;
    made.copies = peer_.lives() ? 2 : 1;
    co_return made;
}

ise::task<track_page> kept_telemetry::track(track_request request) {
    if (request.max_packets < 1 || request.max_packets > 1000)
        throw telemetry_refused(fmt::format("max_packets is 1 to 1000, not {}", request.max_packets));
    if (request.seen.size() > 8)
        throw telemetry_refused(
            fmt::format("`seen` names {} stores; a boat has two: begin anew, without it", request.seen.size()));
    store_answer<track_page> answer(here_.self.on());
    store_->track(request, shown_, store_.read(answer.here()));
    auto page = co_await answer.get();
    if (!page) throw telemetry_refused(page.error().message());
    co_return std::move(*page);
}

void kept_telemetry::report(communication_state& into) const {
    into.shown = shown_;
    into.duplicates = duplicates_;
    into.refused = refused_;
    into.held = held();
    into.dropped = dropped_;
    into.fix = fix_;
}

} // namespace atirma
