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

ise::result<node_store::kept> kept_telemetry::take(std::vector<telemetry_packet> packets) {
    for (auto& packet : packets) {
        packet.store = packet.position = packet.peer_store = packet.peer_position = 0;
        links_.heard(packet);
        mark_history(packet);
    }
    auto kept = store_.written(store_->add(packets));
    if (!kept) return kept;
    duplicates_ += packets.size() - kept->fresh;
    if (kept->fresh > 0) {
        peer_.notify_news();
        show();
    }
    kept_();
    return kept;
}

void kept_telemetry::receive(std::vector<telemetry_packet> packets) {
    refused_ += std::erase_if(packets, [](const auto& packet) { return !can_be_kept(packet); });
    if (packets.empty()) return;
    if (held_.empty() && store_.well() && take(packets)) return;
    for (auto& packet : packets) held_.push_back(std::move(packet));
    for (; held_.size() > here_.options.max_held; held_.pop_front()) ++dropped_;
}

void kept_telemetry::take_held() {
    if (held_.empty() && store_.well()) return;
    do {
        auto some = static_cast<std::ptrdiff_t>(std::min(held_.size(), disk_batch));
        if (!take(std::vector<telemetry_packet>(held_.begin(), held_.begin() + some))) return;
        held_.erase(held_.begin(), held_.begin() + some);
    } while (!held_.empty());
}

// What is restored into a new store was published before: followers find by its positions what they do not know, and
// request it.
void kept_telemetry::show() {
    auto limit = peer_.shown(store_->head());
    if (store_.refilling) shown_ = limit;
    while (shown_ < limit) {
        auto packets = store_->packets(shown_, limit, disk_batch);
        if (!packets) {
            store_.failed(packets.error());
            break;
        }
        shown_ = packets->empty() ? limit : packets->back().position;
        for (const auto& packet : *packets) {
            telemetry_(packet);
            note_fix(packet);
        }
    }
    peer_.notify_progress();
}

bool kept_telemetry::restore(const std::vector<telemetry_packet>& packets) {
    auto kept = store_.written(store_->add(packets));
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
    auto kept = take(std::move(request.packets));
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

track_page kept_telemetry::track(const track_request& request) {
    if (request.max_packets < 1 || request.max_packets > 1000)
        throw telemetry_refused(fmt::format("max_packets is 1 to 1000, not {}", request.max_packets));
    if (request.seen.size() > 8)
        throw telemetry_refused(
            fmt::format("`seen` names {} stores; a boat has two: begin anew, without it", request.seen.size()));
    auto page = store_.read(store_->track(request, shown_));
    if (!page) throw telemetry_refused(page.error().message());
    return std::move(*page);
}

void kept_telemetry::report(communication_state& into) const {
    into.shown = shown_;
    into.duplicates = duplicates_;
    into.refused = refused_;
    into.held = held_.size();
    into.dropped = dropped_;
    into.fix = fix_;
}

} // namespace atirma
