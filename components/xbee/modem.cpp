#include <components/xbee/modem.hpp>

#include <algorithm>

namespace atirma::xbee {
namespace {
using namespace std::chrono_literals;
constexpr instant ack_timeout = 30ms;
constexpr unsigned max_deferrals = 12;
constexpr double hot_c = 60;
} // namespace

modem::modem(modem_options options)
    : options_(options), temperature_c_(options.temperature_c), line_mode_(options.api_mode),
      decoder_(options.api_mode == 2 ? api_mode::escaped : api_mode::plain), random_(options.seed ^ options.address) {
    for (auto& info : at_commands()) registers_[info.name] = info.initial;
    registers_[at("AP")] = options.api_mode;
    registers_[at("SH")] = options.address >> 32;
    registers_[at("SL")] = options.address & 0xFFFFFFFF;
    put(modem_status{0});
}

bool modem::clear_to_send() const noexcept { return phase_ != phase::waiting_duty && jobs_.size() + 4 <= max_queued; }

instant modem::next_event() const noexcept { return std::min(timer_, next_serial()); }

void modem::advance(instant now) {
    for (;;) {
        instant due = next_event();
        if (due == never || due > now) return;
        if (timer_ == due) on_timer(due);
        else serial_timers(due);
    }
}

std::vector<transmission> modem::take_transmissions() { return std::exchange(transmissions_, {}); }

void modem::enqueue(instant now, job work) {
    work.packet.source = address();
    work.packet.network = network();
    work.packet.sequence = ++sequence_;
    jobs_.push_back(std::move(work));
    if (phase_ == phase::idle) start_next(now);
}

void modem::start_next(instant now) {
    phase_ = phase::idle;
    timer_ = never;
    if (!jobs_.empty()) attempt(now);
}

void modem::attempt(instant now) {
    job& work = jobs_.front();
    if (busy_until_ > now) { // listen before talk
        if (++work.deferred > max_deferrals) return finish(now, delivery::cca_failure);
        phase_ = phase::backing_off;
        timer_ = busy_until_ + instant(1ms + random_.next() % 20'000'000 * 1ns);
        return;
    }
    instant air = airtime(work.packet.payload.size());
    instant free = duty_.available_at(now, air, temperature_c_ > hot_c);
    if (free > now) {
        if (work.purge || free == never) return finish(now, delivery::purged);
        phase_ = phase::waiting_duty;
        timer_ = free;
        return;
    }
    duty_.add(now, air);
    transmissions_.push_back({work.packet, now, now + air, power_dbm(static_cast<std::uint8_t>(number("PL")))});
    phase_ = phase::sending;
    timer_ = now + air;
}

void modem::on_timer(instant now) {
    timer_ = never;
    if (jobs_.empty()) {
        phase_ = phase::idle;
        return;
    }
    job& work = jobs_.front();
    auto again = [&](instant longest) {
        ++work.retries;
        phase_ = phase::backing_off;
        timer_ = now + 5ms +
                 instant(static_cast<std::int64_t>(random_.next() % static_cast<std::uint64_t>(longest.count())));
    };
    switch (phase_) {
        case phase::idle: return;
        case phase::waiting_duty:
        case phase::backing_off: return attempt(now);
        case phase::sending:
            if (work.packet.destination == broadcast_address) {
                if (work.retries < number("MT")) again(20ms);
                else finish(now, delivery::success);
                return;
            }
            phase_ = phase::waiting_ack;
            timer_ = now + ack_timeout;
            return;
        case phase::waiting_ack:
            count("TA");
            if (work.retries < number("RR")) return again(40ms * (1 + std::min(work.retries, 4u)));
            count("TR");
            finish(now, delivery::no_ack);
    }
}

void modem::finish(instant now, delivery outcome) {
    job done = std::move(jobs_.front());
    jobs_.pop_front();
    bool broadcast = done.packet.destination == broadcast_address;
    if (done.frame_id != 0 && done.packet.kind == radio_kind::data) {
        put(transmit_status{done.frame_id, unknown_network, static_cast<std::uint8_t>(broadcast ? 0 : done.retries),
                            outcome, 0});
    } else if (done.frame_id != 0 && done.packet.kind == radio_kind::remote_at && outcome != delivery::success) {
        at_name name{static_cast<char>(done.packet.payload[2]), static_cast<char>(done.packet.payload[3])};
        put(remote_at_response{
            done.frame_id, done.packet.destination, unknown_network, name, at_status::tx_failure, {}});
    }
    start_next(now);
}

void modem::on_carrier(instant until) noexcept { busy_until_ = std::max(busy_until_, until); }

void modem::on_damaged(instant now) {
    advance(now);
    count("ER");
}

void modem::on_air(instant now, const radio_packet& packet, double rssi_dbm) {
    if (packet.network != network()) return;
    bool mine = packet.destination == address();
    if (!mine && (packet.destination != broadcast_address || packet.kind == radio_kind::acknowledgement)) return;
    // Before time passes: an acknowledgement that arrives when its wait ends has arrived.
    if (packet.kind == radio_kind::acknowledgement) {
        if (phase_ == phase::waiting_ack && !jobs_.empty() && jobs_.front().packet.sequence == packet.sequence &&
            jobs_.front().packet.destination == packet.source)
            finish(now, delivery::success);
        return;
    }
    advance(now);
    registers_[at("DB")] = registers_[at("RC")] = static_cast<std::uint64_t>(std::clamp(-rssi_dbm + 0.5, 0.0, 255.0));
    count("GD");
    if (mine) {
        radio_packet ack{address(), packet.source, network(), packet.sequence, radio_kind::acknowledgement, {}};
        duty_.add(now, acknowledgement_airtime); // counted, never held back
        on_carrier(now + acknowledgement_airtime);
        transmissions_.push_back(
            {std::move(ack), now, now + acknowledgement_airtime, power_dbm(static_cast<std::uint8_t>(number("PL")))});
    }
    if (!seen_before(packet)) deliver(now, packet);
    follow_api_mode();
}

bool modem::seen_before(const radio_packet& packet) {
    if (heard_.size() >= 64 && !heard_.contains(packet.source)) heard_.clear(); // bounded; a duplicate may slip through
    auto& recent = heard_[packet.source];
    if (std::find(recent.begin(), recent.end(), packet.sequence) != recent.end()) return true;
    recent.push_back(packet.sequence);
    if (recent.size() > 8) recent.pop_front();
    return false;
}

void modem::deliver(instant now, const radio_packet& packet) {
    auto& raw = packet.payload;
    auto byte = [&](std::size_t i) { return std::to_integer<std::uint8_t>(raw[i]); };
    switch (packet.kind) {
        case radio_kind::data:
            if (line_mode_ == 0) put_text(ise::as_text(raw));
            else
                put(received_packet{packet.source, unknown_network,
                                    static_cast<std::uint8_t>(packet.destination == broadcast_address ? 2 : 1), raw});
            return;
        case radio_kind::remote_at: { // frame id, options, two letters, parameter
            if (raw.size() < 4) return;
            at_name name{static_cast<char>(byte(2)), static_cast<char>(byte(3))};
            answer got = execute(now, name, ise::bytes_view(raw).subspan(4));
            if (byte(0) == 0) return;
            job reply;
            reply.packet.destination = packet.source;
            reply.packet.kind = radio_kind::remote_at_answer;
            reply.packet.payload = {raw[0], raw[2], raw[3], std::byte{static_cast<std::uint8_t>(got.status)}};
            reply.packet.payload.insert(reply.packet.payload.end(), got.value.begin(), got.value.end());
            if (jobs_.size() < max_queued) enqueue(now, std::move(reply));
            return;
        }
        case radio_kind::remote_at_answer: // frame id, two letters, status, value
            if (raw.size() < 4) return;
            put(remote_at_response{byte(0),
                                   packet.source,
                                   unknown_network,
                                   {static_cast<char>(byte(1)), static_cast<char>(byte(2))},
                                   static_cast<at_status>(byte(3)),
                                   {raw.begin() + 4, raw.end()}});
            return;
        case radio_kind::acknowledgement: return;
    }
}

} // namespace atirma::xbee
