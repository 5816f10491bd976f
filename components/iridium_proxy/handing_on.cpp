// What the boat's messages become: acknowledgements of telecommands, and telemetry for the others.
#include <components/iridium_proxy/iridium_proxy.hpp>
#include <components/iridium_proxy/proxy_state.hpp>

#include <components/iridium/bundle.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma {
namespace {
using namespace std::chrono_literals;
constexpr std::size_t handed_on_at_once = 64;
constexpr ise::duration mark_pause = 1s;
} // namespace

/// Not before a subscriber comes, as telemetry: a telecommand is decided by it.
void iridium_proxy::take_acknowledgements(const iridium::mo_message& message) {
    if (is_beacons(message)) return; // the second controller executes none
    auto packets = iridium::unbundle(message.data);
    if (!packets) return; // hand_on() says so
    for (auto& came : *packets) {
        auto plain = opened(std::move(came));
        if (!plain || plain->empty()) continue; // hand_on() says so
        const auto& raw = *plain;
        if (classify(raw) != packet_class::acknowledgement) {
            auto parsed = parse_telemetry(raw);
            if (parsed) state_->commands.tracker().on_heard(state_->commands.now(), parsed->header);
            continue;
        }
        auto ack = parse_acknowledgement(raw);
        if (ack) state_->commands.tracker().on_acknowledgement(state_->commands.now(), *ack);
        else ++state_->counts.malformed;
    }
}

/// The proxy may have ended between keeping a message and using it.
void iridium_proxy::take_kept_acknowledgements() {
    for (std::int64_t row = 0;;) {
        auto page = state_->store.unpublished(handed_on_at_once, row).value();
        for (const auto& one : page) take_acknowledgements(one.message);
        if (page.size() < handed_on_at_once) return;
        row = page.back().row;
    }
}

/// Hands on what is on disk and was not handed on. It stays there until the store has it; without one, until somebody
/// subscribes.
void iridium_proxy::hand_on() {
    auto& s = *state_;
    if (options_.store) return s.more.resume({});
    if (s.telemetry.subscribers() > 0) {
        auto waiting = s.store.unpublished(handed_on_at_once);
        if (!waiting) return disk_trouble(waiting.error());
        for (const auto& one : *waiting) {
            hand_on(one.message, one.received_at);
            auto marked = s.store.published(one.row);
            if (!marked) return disk_trouble(marked.error()); // with the next message, then
        }
        if (waiting->size() == handed_on_at_once) s.hand_on_soon.arm(now());
    }
    s.account(account());
}

/// A subscriber alone is not enough: it may be a console, while the communication nodes are away.
ise::task<> iridium_proxy::keep_messages() {
    auto& s = *state_;
    for (;;) {
        auto waiting = s.store.unpublished(1);
        if (!waiting) disk_trouble(waiting.error());
        if (!waiting || waiting->empty()) {
            s.account(account());
            co_await s.more.wait(); // throws what it was resumed with
            continue;
        }
        const auto& first = waiting->front();
        auto keeping = s.keeper->keep(hand_on(first.message, first.received_at));
        co_await std::move(keeping);
        auto marked = s.store.published(first.row);
        if (marked) continue;
        disk_trouble(marked.error()); // it is kept twice then, which changes nothing
        co_await sleep(mark_pause);
    }
}

/// The second controller's packets are not sealed: that they came from its modem is the gateway's word. So they may be
/// nothing but a position and its cause, under their own boot, which no packet of the main controller has.
ise::result<telemetry_message> iridium_proxy::telemetry_of(const iridium::mo_message& from,
                                                           const ise::bytes& raw) const {
    auto parsed = parse_telemetry(raw);
    if (!parsed) return parsed;
    bool beacon = is_beacons(from);
    bool may_be = std::holds_alternative<location>(parsed->body) || std::holds_alternative<notice>(parsed->body);
    if (beacon == (parsed->header.boot == beacon_boot) && (!beacon || may_be)) return parsed;
    return ise::failure(ise::errc::malformed,
                        fmt::format("{} of boot {} from the modem of the {} controller", name_of(parsed->body),
                                    parsed->header.boot, beacon ? "second" : "main"));
}

/// Publishes what was not published before; gives all packets of the message.
std::vector<telemetry_packet> iridium_proxy::hand_on(const iridium::mo_message& message, utc_time received_at) {
    auto& s = *state_;
    std::vector<telemetry_packet> all;
    if (message.data.empty()) return all; // the boat looked for messages
    auto dropped = [&](const std::string& why) {
        ++s.counts.malformed;
        log().warning("a packet of the boat is invalid; its message stays on disk",
                      {{"momsn", std::to_string(message.momsn)}, {"cause", why}});
    };
    auto packets = iridium::unbundle(message.data);
    if (!packets) {
        dropped(packets.error().message());
        return all;
    }
    for (auto& came : *packets) {
        auto plain = is_beacons(message) ? ise::result<ise::bytes>(std::move(came)) : read_sealed(std::move(came));
        if (!plain) {
            dropped(plain.error().message());
            continue;
        }
        if (plain->empty()) continue; // about the seal
        auto& raw = *plain;
        if (classify(raw) == packet_class::acknowledgement) continue; // was taken when it came
        auto parsed = telemetry_of(message, raw);
        if (!parsed) {
            dropped(parsed.error().message());
            continue;
        }
        telemetry_packet out;
        out.link = link_id::iridium;
        out.boot = parsed->header.boot;
        out.sequence = parsed->header.sequence;
        out.measured_at = parsed->header.measured_at;
        out.received_at = received_at;
        // Messages overtake each other, and those from before the first subscriber come at once.
        out.raw = std::move(raw);
        out.history = s.newest.is_history(out);
        if (s.seen.first_time(out.boot, out.sequence, out.raw)) {
            s.telemetry(out);
            ++s.counts.telemetry_published;
        } else {
            ++s.counts.duplicate_packets;
        }
        all.push_back(std::move(out));
    }
    return all;
}

} // namespace atirma
