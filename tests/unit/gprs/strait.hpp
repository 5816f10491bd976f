#pragma once
#include "packets.hpp"

#include <components/boat/newest_by_kind.hpp>
#include <components/gprs/shore.hpp>
#include <components/gprs/uplink.hpp>

#include <functional>
#include <map>
#include <memory>
#include <random>

namespace gprs_test {

/// Boat and shore, and between them a way that does what a test wants, on a clock of its own.
class strait {
public:
    explicit strait(bool datagrams, std::uint64_t seed = 1, atirma::gprs::uplink_options options = {}) : random(seed) {
        options.datagrams = datagrams;
        boat_options = options;
        boat = std::make_unique<atirma::gprs::uplink>(5, options);
        dial();
    }

    std::mt19937_64 random;
    atirma::gprs::uplink_options boat_options;
    std::unique_ptr<atirma::gprs::uplink> boat;
    atirma::gprs::shore shore;
    std::map<std::uint64_t, atirma::newest_by_kind> news; // as the proxy, by the life of the boat

    ise::time_point now{std::chrono::hours(1)};
    ise::duration delay = std::chrono::milliseconds(100);
    ise::duration jitter{};
    double loss = 0; ///< of a datagram
    bool up = true;  ///< false: everything vanishes, nobody is told
    bool safe_at_once = true;
    std::size_t cut_up = SIZE_MAX, cut_down = SIZE_MAX; ///< the connection breaks after so many bytes
    std::uint64_t bytes_up = 0, bytes_down = 0;
    std::size_t cuts = 0;

    struct arrival {
        std::uint32_t sequence;
        bool history;
    };
    std::vector<arrival> arrived;
    std::vector<atirma::gprs::outcome> outcomes;
    std::vector<atirma::gprs::order> orders;
    std::vector<std::string> remarks;
    std::vector<std::pair<std::uint64_t, std::uint32_t>> unsafe;

    void put(ise::bytes raw) {
        boat->put(std::move(raw));
        act();
    }
    void put_fixes(std::uint32_t from, std::uint32_t count) {
        for (auto n = from; n < from + count; ++n) put(fix(n));
    }
    /// The boat's program starts again, and remembers nothing.
    void restart_boat(std::uint16_t boot) {
        hang_up();
        boat = std::make_unique<atirma::gprs::uplink>(boot, boat_options);
        dial();
    }
    void restart_shore() {
        std::destroy_at(&shore);
        std::construct_at(&shore);
        if (!boat_options.datagrams) hang_up();
    }
    /// The boat's datagrams come from another port; or its connection breaks.
    void change_address() {
        ++port_;
        if (!boat_options.datagrams) hang_up();
    }
    void run_for(ise::duration time) {
        auto until = now + time;
        for (;;) {
            act();
            auto next = std::min(boat->next_event(), shore.next_event());
            if (!events_.empty()) next = std::min(next, events_.begin()->first);
            if (next > until) break;
            now = std::max(now, next);
            if (!events_.empty() && events_.begin()->first <= now) {
                auto what = std::move(events_.begin()->second);
                events_.erase(events_.begin());
                what();
            }
            boat->on_time(now);
            shore.on_time(now);
        }
        now = until;
        act();
    }
    void run_until(const std::function<bool()>& done, ise::duration within = std::chrono::hours(2)) {
        auto until = now + within;
        while (!done() && now < until) run_for(std::chrono::milliseconds(200));
    }
    bool all_acknowledged() const { return boat->waiting() == 0; }
    bool once_each(std::uint32_t from, std::uint32_t count) const {
        std::map<std::uint32_t, int> seen;
        for (const auto& one : arrived) ++seen[one.sequence];
        for (auto n = from; n < from + count; ++n)
            if (seen[n] != 1) return false;
        return seen.size() == count;
    }
    /// What is no history is always the newest so far.
    bool never_back() const {
        std::int64_t newest = -1;
        for (const auto& one : arrived) {
            if (one.history) continue;
            if (one.sequence <= newest) return false;
            newest = one.sequence;
        }
        return true;
    }
    void keep_all() {
        auto all = std::exchange(unsafe, {});
        for (const auto& [life, number] : all) shore.safe(life, {number});
        act();
    }
    void act() {
        if (acting_) return;
        acting_ = true;
        for (bool more = true; more;) {
            more = false;
            while (auto event = shore.take_event()) {
                handle(*event);
                more = true;
            }
            while (open_) {
                auto text = boat->take_text(now);
                if (text.empty()) break;
                carry(std::move(text), true);
            }
            while (auto result = boat->take_order()) {
                orders.push_back(*result);
                boat->put(ack_of(result->id));
                more = true;
            }
            if (auto why = boat->trouble(now); why && open_) {
                if (boat_options.datagrams) ++port_;
                hang_up();
            }
        }
        acting_ = false;
    }

private:
    void dial() {
        ++door_;
        open_ = true;
        up_left_ = std::exchange(cut_up, SIZE_MAX);
        down_left_ = std::exchange(cut_down, SIZE_MAX);
        last_up_ = last_down_ = now;
        boat->opened(now);
        if (!boat_options.datagrams && up)
            later(now + delay, [this, channel = door_] { shore.connected(now, way_of(channel)); });
    }
    /// The boat's connection ends; the shore learns it, unless the carrier is down.
    void hang_up() {
        if (!open_) return;
        open_ = false;
        boat->closed();
        if (up && !boat_options.datagrams)
            later(std::max(now, last_up_) + delay,
                  [this, channel = door_] { shore.disconnected(now, channel, "over"); });
        later(now + std::chrono::seconds(1), [this] {
            if (!open_) dial();
        });
    }
    atirma::gprs::way way_of(std::uint64_t channel) const {
        atirma::gprs::way made;
        made.channel = boat_options.datagrams ? 1'000'000 : channel;
        made.peer = ise::endpoint{ise::protocol::udp,
                                  "10.0.0.9",
                                  static_cast<std::uint16_t>(40000 + (boat_options.datagrams ? port_ : 0)),
                                  {}};
        made.datagrams = boat_options.datagrams;
        return made;
    }
    void carry(std::string text, bool upward) {
        auto& left = upward ? up_left_ : down_left_;
        bool cut = !boat_options.datagrams && text.size() > left;
        if (cut) text.resize(left);
        if (left != SIZE_MAX) left -= text.size();
        (upward ? bytes_up : bytes_down) += text.size();
        if (up && (!boat_options.datagrams || static_cast<double>(random() >> 11) * 0x1.0p-53 >= loss)) {
            auto arrives =
                now + delay +
                ise::duration(jitter.count() == 0 ? 0
                                                  : static_cast<ise::duration::rep>(
                                                        random() % static_cast<std::uint64_t>(jitter.count())));
            auto& last = upward ? last_up_ : last_down_;
            if (!boat_options.datagrams) arrives = last = std::max(arrives, last);
            later(arrives, [this, upward, text = std::move(text), by = way_of(door_), channel = door_] {
                if (!up) return;
                if (!upward) {
                    if (open_ && (boat_options.datagrams ? by.peer == way_of(0).peer : channel == door_))
                        boat->on_bytes(now, ise::as_bytes(text));
                } else if (boat_options.datagrams) {
                    shore.on_datagram(now, by, ise::as_bytes(text));
                } else {
                    deliver(channel, text);
                }
            });
        }
        if (!cut) return;
        ++cuts;
        hang_up();
    }
    /// In pieces of any size.
    void deliver(std::uint64_t channel, std::string_view text) {
        while (!text.empty()) {
            auto size = std::min<std::size_t>(text.size(), random() % 50 + 1);
            shore.on_bytes(now, channel, ise::as_bytes(text.substr(0, size)));
            text.remove_prefix(size);
        }
    }
    void handle(const atirma::gprs::shore_event& event) {
        using namespace atirma::gprs;
        if (const auto* send = std::get_if<send_text>(&event)) {
            bool to_here = boat_options.datagrams ? send->to.peer == way_of(0).peer : send->to.channel == door_;
            if (to_here && open_) carry(send->text, false);
        } else if (const auto* cut = std::get_if<cut_off>(&event)) {
            if (cut->whom.channel == door_ && open_) hang_up();
        } else if (const auto* came = std::get_if<record_came>(&event)) {
            auto header = atirma::parse_telemetry(came->raw).value().header;
            atirma::telemetry_packet packet;
            packet.measured_at = header.measured_at;
            packet.history = came->history;
            packet.raw = came->raw;
            arrived.push_back({header.sequence, news[came->life].is_history(packet)});
            unsafe.emplace_back(came->life, came->number);
            if (safe_at_once) {
                auto all = std::exchange(unsafe, {});
                for (const auto& [life, number] : all) shore.safe(life, {number});
            }
        } else if (const auto* result = std::get_if<outcome_came>(&event)) {
            outcomes.push_back(result->what);
        } else if (const auto* said = std::get_if<remark>(&event)) {
            remarks.push_back(said->text);
        }
    }
    void later(ise::time_point at, std::function<void()> what) { events_.emplace(at, std::move(what)); }

    std::multimap<ise::time_point, std::function<void()>> events_;
    std::uint64_t door_ = 0;
    unsigned port_ = 0;
    bool open_ = false, acting_ = false;
    std::size_t up_left_ = SIZE_MAX, down_left_ = SIZE_MAX;
    ise::time_point last_up_{}, last_down_{};
};

} // namespace gprs_test
