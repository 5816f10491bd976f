#include <components/xbee/radio_client.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma::xbee {
namespace {
using namespace std::chrono_literals;
constexpr instant min_pause = 250ms, max_pause = 60s, frame_gap = 500ms;
constexpr std::size_t max_payload = 100;
constexpr std::size_t max_at_outstanding = 8;
constexpr unsigned silent_limit = 3; // requests without an answer before the modem is looked for again

bool turned_away(delivery code) {
    return code == delivery::cca_failure || code == delivery::purged || code == delivery::resource_error;
}

/// Any other outcome, also one without a name, may be of a packet that arrived: perhaps only its ACK was lost.
bool certainly_not_sent(delivery code) {
    switch (code) {
        case delivery::cca_failure:
        case delivery::purged:
        case delivery::invalid_endpoint:
        case delivery::not_joined:
        case delivery::self_addressed:
        case delivery::address_not_found:
        case delivery::route_not_found:
        case delivery::resource_error:
        case delivery::payload_too_large: return true;
        default: return false;
    }
}
} // namespace

ise::result<token> radio_client::accept(frame content, instant deadline) {
    if (waiting_.size() >= options_.max_queued)
        return ise::failure(ise::errc::overloaded,
                            fmt::format("{} requests wait for the modem already", waiting_.size()));
    waiting_.push_back({next_token_, std::move(content), deadline});
    return next_token_++;
}

ise::result<token> radio_client::send(instant now, std::uint64_t destination, ise::bytes payload,
                                      std::uint8_t tx_options, std::optional<instant> timeout) {
    if (payload.size() > max_payload)
        return ise::failure(ise::errc::too_large, fmt::format("a radio packet of {} bytes; the XBee 868 carries {}",
                                                              payload.size(), max_payload));
    auto accepted = accept(transmit_request{0, destination, unknown_network, 0, tx_options, std::move(payload)},
                           now + timeout.value_or(options_.send_timeout));
    pump(now);
    return accepted;
}

ise::result<token> radio_client::local_at(instant now, at_name command, ise::bytes parameter) {
    auto accepted = accept(at_request{0, command, std::move(parameter), false}, now + options_.at_timeout);
    pump(now);
    return accepted;
}

ise::result<token> radio_client::remote_at(instant now, std::uint64_t address, at_name command, ise::bytes parameter) {
    auto accepted = accept(remote_at_request{0, address, unknown_network, 2, command, std::move(parameter)},
                           now + options_.remote_at_timeout);
    pump(now);
    return accepted;
}

void radio_client::pump(instant now) {
    if (phase_ != phase::ready) return;
    auto sends = static_cast<std::size_t>(
        std::count_if(pending_.begin(), pending_.end(), [](auto& p) { return p.second.is_send(); }));
    auto commands = pending_.size() - sends;
    for (auto r = waiting_.begin(); r != waiting_.end();) { // commands overtake transmissions that have to wait
        bool may = r->is_send() ? sends < options_.window && now >= hold_until_ : commands < max_at_outstanding;
        if (!may || r->deadline <= now) {
            ++r;
            continue;
        }
        ++(r->is_send() ? sends : commands);
        request next = std::move(*r);
        r = waiting_.erase(r);
        write_request(now, std::move(next));
    }
}

void radio_client::write_request(instant, request r) {
    // Window and limit are far below 255.
    while (next_frame_id_ == 0 || pending_.contains(next_frame_id_)) ++next_frame_id_;
    std::uint8_t id = next_frame_id_++;
    std::visit(
        [id](auto& f) {
            if constexpr (requires { f.frame_id; }) f.frame_id = id;
        },
        r.content);
    auto wire = encode(r.content, mode_);
    output_.insert(output_.end(), wire.begin(), wire.end());
    pending_.emplace(id, std::move(r));
}

void radio_client::fail(const request& r, bool written, std::string reason) {
    if (r.is_send()) {
        send_outcome out;
        out.id = r.id;
        out.executed = written ? ise::execution::unknown : ise::execution::not_executed;
        out.reason = std::move(reason);
        return tell(std::move(out));
    }
    at_outcome out;
    out.id = r.id;
    if (auto* remote = std::get_if<remote_at_request>(&r.content)) {
        out.command = remote->command;
        out.address = remote->destination;
    } else {
        out.command = std::get<at_request>(r.content).command;
    }
    out.reason = std::move(reason);
    tell(std::move(out));
}

void radio_client::fail_written(std::string reason) {
    for (auto& [id, r] : std::exchange(pending_, {})) fail(r, true, reason);
}

void radio_client::on_bytes(instant now, ise::bytes_view bytes) {
    if (phase_ == phase::stopped || bytes.empty()) return;
    on_time(now);
    gap_due_ = now + frame_gap;
    if (phase_ == phase::plus || phase_ == phase::setting || phase_ == phase::leaving) { // the module speaks text now
        for (std::byte b : bytes)
            if (command_reply_.size() < 256) command_reply_ += static_cast<char>(b);
        if (command_reply_.find("OK\r") != std::string::npos) {
            command_reply_.clear();
            if (phase_ == phase::plus) {
                phase_ = phase::setting;
                write_text("ATAP1\r");
                phase_due_ = now + 2s;
            } else if (phase_ == phase::setting) {
                phase_ = phase::leaving;
                write_text("ATCN\r");
                phase_due_ = now + 2s;
            } else {
                asked_ = 0;
                ask(now);
            }
        }
        return;
    }
    decoder_.push(bytes);
    drain(now);
    pump(now);
}

void radio_client::drain(instant now) {
    auto before = decoder_.skipped_bytes();
    while (auto got = decoder_.next()) {
        if (auto* f = std::get_if<frame>(&*got)) {
            ++counters_.frames;
            on_frame(now, *f);
        } else {
            ++counters_.refused_frames;
        }
    }
    counters_.skipped_bytes += decoder_.skipped_bytes() - before;
    if (!decoder_.in_frame()) gap_due_ = never;
}

void radio_client::on_time(instant now) {
    if (gap_due_ <= now) { // silence in the middle of a frame
        gap_due_ = never;
        decoder_.give_up();
        drain(now);
    }
    for (auto r = waiting_.begin(); r != waiting_.end();) {
        if (r->deadline > now) {
            ++r;
            continue;
        }
        request late = std::move(*r);
        r = waiting_.erase(r);
        fail(late, false,
             phase_ == phase::ready ? "not sent in time: the modem holds it back"
                                    : "not sent in time: no modem answers");
    }
    for (auto p = pending_.begin(); p != pending_.end();) {
        if (p->second.deadline > now) {
            ++p;
            continue;
        }
        request late = std::move(p->second);
        p = pending_.erase(p);
        // A far modem may be out of reach.
        if (!std::holds_alternative<remote_at_request>(late.content)) ++silent_requests_;
        fail(late, true, "the modem gave no answer in time");
    }
    if (phase_ == phase::ready && silent_requests_ >= silent_limit)
        find_again(now, "the modem answers no request any more");
    if (phase_due_ <= now) on_phase_time(now);
    pump(now);
}

instant radio_client::next_event() const {
    instant next = std::min(gap_due_, phase_due_);
    bool held = false;
    std::size_t sends = 0;
    for (auto& r : waiting_) {
        next = std::min(next, r.deadline);
        held |= r.is_send();
    }
    for (auto& p : pending_) {
        next = std::min(next, p.second.deadline);
        sends += p.second.is_send() ? 1 : 0;
    }
    if (phase_ == phase::ready && held && sends < options_.window) next = std::min(next, hold_until_);
    return next;
}

ise::bytes radio_client::take_output() { return std::exchange(output_, {}); }

std::optional<client_event> radio_client::take_event() {
    if (events_.empty()) return std::nullopt;
    client_event event = std::move(events_.front());
    events_.pop_front();
    return event;
}

void radio_client::tell(client_event event) {
    if (events_.size() >= options_.max_events) { // outcomes are never lost: requests are bounded themselves
        auto packet = std::find_if(events_.begin(), events_.end(),
                                   [](auto& e) { return std::holds_alternative<packet_received>(e); });
        if (packet != events_.end()) {
            events_.erase(packet);
            ++counters_.dropped_events;
        }
    }
    events_.push_back(std::move(event));
}

void radio_client::on_frame(instant now, const frame& f) {
    silent_requests_ = 0;
    if (phase_ == phase::asking) {
        auto* answer = std::get_if<at_response>(&f);
        if (answer && answer->command == at("AP") && answer->status == at_status::ok && !answer->value.empty())
            become_ready(now, answer->value.back() == std::byte{2} ? api_mode::escaped : api_mode::plain);
        else if (auto* got = std::get_if<received_packet>(&f))
            tell(packet_received{got->source, (got->options & 2) != 0, got->payload});
        return;
    }
    if (auto* got = std::get_if<received_packet>(&f))
        return tell(packet_received{got->source, (got->options & 2) != 0, got->payload});
    if (auto* status = std::get_if<transmit_status>(&f)) return settle(now, status->frame_id, f);
    if (auto* answer = std::get_if<at_response>(&f)) return settle(now, answer->frame_id, f);
    if (auto* answer = std::get_if<remote_at_response>(&f)) return settle(now, answer->frame_id, f);
    if (auto* status = std::get_if<modem_status>(&f); status && status->status <= 1) { // hardware or watchdog reset
        tell(modem_restarted{status->status});
        find_again(now, "the modem restarted");
    }
}

void radio_client::settle(instant now, std::uint8_t frame_id, const frame& answer) {
    auto found = pending_.find(frame_id);
    auto* status = std::get_if<transmit_status>(&answer);
    auto* local = std::get_if<at_response>(&answer);
    auto* remote = std::get_if<remote_at_response>(&answer);
    bool fits =
        found != pending_.end() && ((status && found->second.is_send()) ||
                                    (local && std::holds_alternative<at_request>(found->second.content) &&
                                     std::get<at_request>(found->second.content).command == local->command) ||
                                    (remote && std::holds_alternative<remote_at_request>(found->second.content) &&
                                     std::get<remote_at_request>(found->second.content).command == remote->command));
    if (!fits) return; // an answer that came after its time was up
    request r = std::move(found->second);
    pending_.erase(found);
    if (local) return tell(at_outcome{r.id, local->command, 0, local->status, local->value, {}});
    if (remote)
        return tell(at_outcome{r.id,
                               remote->command,
                               std::get<remote_at_request>(r.content).destination,
                               remote->status,
                               remote->value,
                               {}});

    if (turned_away(status->outcome)) {
        ++counters_.delayed;
        // Once for a whole window.
        if (now >= hold_until_) pause_ = std::min(max_pause, std::max(min_pause, 2 * pause_));
        hold_until_ = now + pause_;
        if (hold_until_ < r.deadline && waiting_.size() < options_.max_queued + options_.window) {
            // Order of asking.
            auto place = std::find_if(waiting_.begin(), waiting_.end(), [&](auto& w) { return w.id > r.id; });
            waiting_.insert(place, std::move(r));
            return;
        }
    } else {
        pause_ = 0ns;
        hold_until_ = now;
    }
    send_outcome out;
    out.id = r.id;
    out.delivered = status->outcome == delivery::success;
    out.code = status->outcome;
    out.retries = status->retries;
    out.executed = certainly_not_sent(status->outcome) ? ise::execution::not_executed : ise::execution::unknown;
    if (!out.delivered)
        out.reason = fmt::format("the modem reports {} ({:02X}) after {} retries", name_of(status->outcome),
                                 static_cast<unsigned>(status->outcome), status->retries);
    tell(std::move(out));
}

} // namespace atirma::xbee
