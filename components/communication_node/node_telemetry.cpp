// What comes from the boat: kept once, told on when it is safe.
#include <components/communication_node/communication_node.hpp>
#include <components/communication_node/node_core.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t batch = 256, max_raw = 1024;

bool can_be_kept(const telemetry_packet& packet) { return packet.raw.size() >= 2 && packet.raw.size() <= max_raw; }

} // namespace

ise::task<> communication_node::follow_telemetry(std::size_t which) {
    auto& c = *core_;
    auto& here = c.proxies[which];
    for (;;) {
        try {
            auto packets = co_await here.proxy.subscribe(services::telemetry, ise::subscribe_options::last(4096));
            struct registered {
                node_core::proxy_state& of;
                ~registered() { of.stream = nullptr; }
            } guard{here};
            here.stream = &packets;
            if (!here.health.trouble.empty()) log().info("a proxy is reached again", {{"proxy", here.health.proxy}});
            here.health.trouble.clear();
            here.health.reached = true;
            c.links.reached(here.health.link, true);
            work();
            for (;;) {
                auto packet = co_await packets.next();
                if (!packet) break;
                std::vector<telemetry_packet> together;
                while (packet) {
                    if (auto lost = packet.lost_before()) here.health.lost += *lost;
                    else ++here.health.gaps;
                    together.push_back(*packet);
                    if (together.size() >= batch) break;
                    packet = packets.try_next();
                }
                take_or_hold(std::move(together));
            }
        } catch (const ise::error& problem) {
            // Also of a proxy that stops meanwhile (cancelled): our own end throws at the next suspension.
            unreached(which, problem);
        }
        here.health.reached = false;
        c.links.reached(here.health.link, false);
        co_await sleep(500ms);
    }
}

/// Said once for each cause: a proxy that was named and is never found is a mistake that somebody has to see.
void communication_node::unreached(std::size_t which, const ise::error& problem) {
    auto& health = core_->proxies[which].health;
    std::string why = problem.what();
    if (problem.code() == ise::errc::no_such_name)
        why = fmt::format("there is no {}: is its proxy running, and is that its path (--proxy {}=PATH)?", health.proxy,
                          name_of(health.link));
    if (why == health.trouble) return;
    health.trouble = why;
    log().warning("a proxy is not reached", {{"proxy", health.proxy}, {"cause", why}});
}

/// To disk, all of them or none. Gives the highest position of them.
ise::result<std::uint64_t> communication_node::take(std::vector<telemetry_packet> packets) {
    auto& c = *core_;
    for (auto& packet : packets) {
        packet.store = packet.position = packet.peer_store = packet.peer_position = 0;
        c.links.heard(packet.link, now());
        for (auto& one : c.proxies) {
            if (one.health.link != packet.link) continue;
            ++one.health.packets;
            one.health.last_heard = clock();
        }
        if (c.newest.is_history(packet)) packet.history = true;
    }
    auto kept = c.store.add(packets);
    disk(kept ? nullptr : &kept.error());
    if (!kept) return kept.error();
    c.duplicates += packets.size() - kept->fresh;
    if (kept->fresh > 0) {
        c.news.notify();
        show();
    }
    return kept->last;
}

void communication_node::take_or_hold(std::vector<telemetry_packet> packets) {
    auto& c = *core_;
    auto unfit = std::erase_if(packets, [](const auto& packet) { return !can_be_kept(packet); });
    c.refused += unfit;
    if (packets.empty()) return;
    if (c.held.empty() && c.trouble.empty() && take(packets)) {
        work(); // the link is alive: what waits for one may go
        return;
    }
    for (auto& packet : packets) c.held.push_back(std::move(packet));
    for (; c.held.size() > options_.max_held; c.held.pop_front()) ++c.dropped;
}

/// Tries the disk again, also where nothing is held: so it is seen that it is well again.
void communication_node::take_held() {
    auto& c = *core_;
    do {
        auto most = std::min(c.held.size(), batch);
        std::vector<telemetry_packet> together(c.held.begin(), c.held.begin() + static_cast<std::ptrdiff_t>(most));
        if (!take(std::move(together))) return;
        c.held.erase(c.held.begin(), c.held.begin() + static_cast<std::ptrdiff_t>(most));
    } while (!c.held.empty());
    put_changes();
}

/// Tells what is safe now, in the order of the store. What comes back into a new store was told before: followers find
/// by its positions what they do not know, and ask for it.
void communication_node::show() {
    auto& c = *core_;
    auto limit = c.peer.shown(c.store.head(), now());
    if (c.refilling) c.shown = limit;
    while (c.shown < limit) {
        auto packets = c.store.packets(c.shown, limit, batch);
        if (!packets) {
            disk(&packets.error());
            break;
        }
        c.shown = packets->empty() ? limit : packets->back().position;
        for (const auto& packet : *packets) {
            c.telemetry(packet);
            note_fix(packet);
        }
    }
    c.progress.notify();
}

/// The newest fix wins, whichever link it came over and in whichever order.
void communication_node::note_fix(const telemetry_packet& packet) {
    auto& c = *core_;
    auto measured = plausible_time(packet);
    if (packet.history || (c.fix && measured <= c.fix->measured_at)) return;
    auto message = parse_telemetry(packet.raw);
    const auto* at = message ? std::get_if<location>(&message->body) : nullptr;
    if (at && has_fix(*at)) c.fix = current_fix{packet.link, measured, at->latitude_deg, at->longitude_deg};
}

ise::task<keep_reply> communication_node::keep(keep_request request) {
    auto& c = *core_;
    if (request.packets.size() > keep_request::max_packets)
        throw ise::error(ise::errc::refused, fmt::format("{} packets at once; {} are possible: ask in parts",
                                                         request.packets.size(), keep_request::max_packets));
    for (const auto& packet : request.packets) {
        if (can_be_kept(packet)) continue;
        ++c.refused;
        throw ise::error(
            ise::errc::refused,
            fmt::format("packet {} of boot {} has {} raw bytes; 2 to {} can be kept: nothing of this request was",
                        packet.sequence, packet.boot, packet.raw.size(), max_raw));
    }
    keep_reply made;
    auto asked = static_cast<std::uint32_t>(request.packets.size());
    auto before = c.duplicates;
    auto store = c.store.number();
    auto kept = take(std::move(request.packets));
    if (!kept)
        throw ise::error(
            ise::errc::refused,
            fmt::format("{} cannot keep telemetry: {}; do not acknowledge it to the boat, and ask again later", path(),
                        kept.error().message()));
    made.fresh = asked - static_cast<std::uint32_t>(c.duplicates - before);
    while (c.store.number() == store && c.peer.lives(now()) && !c.peer.has_packets(*kept))
        co_await c.progress.wait(c.peer.silent_at());
    if (c.store.number() != store)
        throw ise::error(ise::errc::refused,
                         fmt::format("the store of {} was damaged and set aside meanwhile; do not acknowledge the "
                                     "packets to the boat, and ask again",
                                     path()));
    made.copies = !options_.peer.empty() && c.peer.lives(now()) ? 2 : 1;
    work();
    co_return made;
}

track_page communication_node::track(const track_request& request) {
    if (request.max_packets < 1 || request.max_packets > 1000)
        throw ise::error(ise::errc::refused, fmt::format("max_packets is 1 to 1000, not {}", request.max_packets));
    if (request.seen.size() > 8)
        throw ise::error(
            ise::errc::refused,
            fmt::format("`seen` names {} stores; a boat has two: begin anew, without it", request.seen.size()));
    auto page = core_->store.track(request, core_->shown);
    look_for_damage(page);
    if (!page) throw ise::error(ise::errc::refused, page.error().message());
    return std::move(*page);
}

} // namespace atirma
