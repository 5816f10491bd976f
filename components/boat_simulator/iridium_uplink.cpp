#include <components/boat_simulator/iridium_uplink.hpp>

#include <components/iridium/bundle.hpp>

#include <algorithm>

namespace atirma {

iridium_uplink::iridium_uplink(ise::loop& on, ise::logger log, iridium_uplink_options options,
                               std::function<void()> sail)
    : loop_(on), log_(log), options_(std::move(options)), sail_(std::move(sail)), port_(on, log, options_.port),
      last_session_(on.now()) {
    port_.on_event = [this](const iridium::sbd_event& event) { on_event(event); };
}

ise::task<> iridium_uplink::run(simulator::simulated_boat& boat) {
    boat_ = &boat;
    auto serving = port_.run();
    co_await std::move(serving);
}

void iridium_uplink::carry() {
    if (!boat_) return;
    for (auto& raw : boat_->take_packets(link_id::iridium)) {
        bool answer = classify(raw) == packet_class::acknowledgement;
        auto& into = answer ? acknowledgements_ : telemetry_;
        into.push_back(seal ? seal(std::move(raw)) : std::move(raw));
        if (answer && into.size() > max_acknowledgements && acknowledgements_in_hand_ == 0) into.pop_front();
        if (!answer && into.size() > max_telemetry) into.pop_front();
    }
    send();
}

void iridium_uplink::put_sealed(ise::bytes raw) { acknowledgements_.push_back(std::move(raw)); }

void iridium_uplink::send() {
    if (!port_.ready() || port_.has_message()) return;
    std::vector<ise::bytes> packets(acknowledgements_.begin(), acknowledgements_.end());
    packets.insert(packets.end(), telemetry_.rbegin(), telemetry_.rend());
    if (packets.empty()) {
        if (loop_.now() - last_session_ < options_.check_period) return;
        last_session_ = loop_.now();
        port_.check();
        return;
    }
    std::size_t taken = 0;
    auto message = iridium::bundle(packets, iridium::max_mo_bytes, taken);
    acknowledgements_in_hand_ = std::min(taken, acknowledgements_.size());
    // The newest are sent, the others are too old for a session of their own.
    if (taken > acknowledgements_in_hand_) telemetry_.clear();
    auto given = port_.send(std::move(message));
    if (!given) log_.warning("a message was not taken", {{"cause", given.error().message()}});
}

void iridium_uplink::on_event(const iridium::sbd_event& event) {
    if (std::holds_alternative<iridium::sbd_sent>(event)) {
        ++sent_;
        acknowledgements_.erase(acknowledgements_.begin(),
                                acknowledgements_.begin() +
                                    static_cast<std::ptrdiff_t>(std::exchange(acknowledgements_in_hand_, 0)));
    } else if (const auto* lost = std::get_if<iridium::sbd_gave_up>(&event)) {
        if (lost->message) ++failed_;
        acknowledgements_in_hand_ = 0; // they are sent with the next message
    } else if (const auto* attempt = std::get_if<iridium::sbd_attempt>(&event)) {
        if (attempt->status.mo_arrived()) last_session_ = loop_.now();
    } else if (const auto* received = std::get_if<iridium::sbd_received>(&event)) {
        auto packets = iridium::unbundle(received->data);
        if (!packets) {
            log_.warning("a message was refused", {{"cause", packets.error().message()}});
            return;
        }
        sail_();
        for (auto& raw : *packets) {
            if (open) {
                auto plain = open(raw);
                if (!plain) continue; // it has logged why, or the packet was about the seal
                raw = std::move(*plain);
            }
            auto done = boat_->on_packet(link_id::iridium, raw);
            if (!done) {
                log_.warning("a packet was refused", {{"cause", done.error().message()}});
                continue;
            }
            ++heard_;
            log_.info("telecommand", {{"id", std::to_string(done->id)},
                                      {"kind", std::string(name_of(done->kind))},
                                      {"result", std::string(name_of(done->code))}});
        }
    }
    // The next message is sent with the boat's next step: sending from within an event could recurse without end.
}

link_status iridium_uplink::status() const {
    link_status result;
    result.link = link_id::iridium;
    result.up = port_.ready();
    result.queued = static_cast<std::uint16_t>(acknowledgements_.size() + telemetry_.size());
    result.sent = static_cast<std::uint32_t>(sent_);
    result.failed = static_cast<std::uint32_t>(failed_);
    result.last_heard_age_s = std::chrono::duration<float>(loop_.now() - last_session_).count();
    return result;
}

} // namespace atirma
