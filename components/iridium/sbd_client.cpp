#include <components/iridium/sbd_client.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace atirma::iridium {
namespace {
constexpr std::array<std::string_view, 6> start_commands{"AT", "ATE0", "AT&D0", "AT&K0", "AT+SBDMTA=1", "AT+CGSN"};
constexpr std::size_t max_line = 256;
constexpr unsigned max_fetches = 3; // of one message out of the modem
} // namespace

void sbd_client::start(ise::time_point now) {
    step_ = step::starting;
    start_at_ = 0;
    told_silent_ = pausing_ = false;
    line_.clear();
    binary_.clear();
    output_.clear();
    start_step(now);
}

void sbd_client::stop() {
    step_ = step::off;
    answer_by_ = ise::time_point::max();
    output_.clear();
}

ise::result<void> sbd_client::send(ise::time_point now, ise::bytes message) {
    if (message.empty()) return ise::failure(ise::errc::invalid_argument, "an empty message");
    if (message.size() > max_mo_bytes)
        return ise::failure(ise::errc::too_large,
                            fmt::format("{} bytes; an SBD message takes {} at most", message.size(), max_mo_bytes));
    if (message_) return ise::failure(ise::errc::overloaded, "a message is in hand already");
    if (!wanted()) next_try_ = now;
    message_ = std::move(message);
    first_try_ = now;
    go_on(now);
    return {};
}

void sbd_client::check(ise::time_point now) {
    if (!wanted()) {
        first_try_ = now;
        next_try_ = now;
    }
    check_ = true;
    go_on(now);
}

void sbd_client::command(ise::time_point now, std::string_view text, ise::duration within) {
    auto raw = ise::as_bytes(text);
    output_.insert(output_.end(), raw.begin(), raw.end());
    output_.push_back(std::byte{'\r'});
    answer_by_ = ise::saturating_add(now, within);
}

void sbd_client::start_step(ise::time_point now) { command(now, start_commands[start_at_], options_.answer_time); }

void sbd_client::on_bytes(ise::time_point now, ise::bytes_view in) {
    for (auto b : in) {
        if (step_ == step::off) return;
        if (step_ == step::fetching) {
            binary_.push_back(b);
            binary(now);
            continue;
        }
        auto c = std::to_integer<char>(b);
        if (c != '\r' && c != '\n') {
            if (line_.size() < max_line) line_ += c;
            continue;
        }
        if (line_.empty()) continue;
        auto whole = std::exchange(line_, {});
        on_line(now, whole);
    }
}

/// The answer to AT+SBDRB: u16 length, data, u16 sum; only then text again.
void sbd_client::binary(ise::time_point now) {
    if (std::to_integer<unsigned>(binary_[0]) > max_mt_bytes / 256) { // what is left of the line before, or a ring
        auto c = std::to_integer<char>(binary_[0]);
        binary_.clear();
        if (c != '\r' && c != '\n') {
            if (line_.size() < max_line) line_ += c;
        } else if (std::exchange(line_, {}) == "SBDRING") {
            rang_ = true;
            check(now);
        }
        return;
    }
    line_.clear();
    if (binary_.size() < 2) return;
    auto size = std::to_integer<std::size_t>(binary_[0]) * 256 + std::to_integer<std::size_t>(binary_[1]);
    if (size > max_mt_bytes) return lost_modem(now, "the modem sent no message where one was asked for");
    if (binary_.size() < size + 4) return;
    auto content = ise::bytes_view(binary_).subspan(2, size);
    auto sum = std::to_integer<unsigned>(binary_[size + 2]) * 256 + std::to_integer<unsigned>(binary_[size + 3]);
    bool good = sum == line_sum(content);
    if (good && size > 0) {
        sbd_received got;
        got.data.assign(content.begin(), content.end());
        got.mtmsn = static_cast<std::uint16_t>(told_ ? told_->mtmsn : 0);
        events_.push_back(std::move(got));
    }
    binary_.clear();
    step_ = step::fetched;
    if (good) fetch_ = false;
    else fetch_failed("a message came garbled out of the modem");
}

/// It is in the modem still.
void sbd_client::fetch_failed(std::string reason) {
    if (++fetch_failures_ < max_fetches) return;
    fetch_ = false;
    events_.push_back(sbd_gave_up{std::move(reason), false});
}

void sbd_client::on_line(ise::time_point now, std::string_view line) {
    if (line == "SBDRING") {
        rang_ = true;
        return check(now);
    }
    if (line == "OK") return on_done(now, true);
    if (line == "ERROR") return on_done(now, false);
    if (step_ == step::starting && start_commands[start_at_] == "AT+CGSN" && check_imei(line)) imei_ = line;
    if (step_ == step::offering && line == "READY" && message_) {
        output_.insert(output_.end(), message_->begin(), message_->end());
        auto sum = line_sum(*message_);
        output_.push_back(static_cast<std::byte>(sum >> 8));
        output_.push_back(static_cast<std::byte>(sum & 0xFF));
        answer_by_ = ise::saturating_add(now, options_.answer_time);
        write_result_ = -1;
        step_ = step::writing;
    } else if (step_ == step::writing && line.size() == 1 && line[0] >= '0' && line[0] <= '3') {
        write_result_ = line[0] - '0';
    } else if (step_ == step::in_session && line.starts_with("+SBDIX")) {
        if (auto read = parse_sbdix(line)) told_ = *read;
    }
}

/// A command is answered.
void sbd_client::on_done(ise::time_point now, bool ok) {
    if (pausing_) return; // nothing was asked
    answer_by_ = ise::time_point::max();
    switch (step_) {
        case step::off:
        case step::idle: return;
        case step::starting:
            if (!ok && start_at_ == 0) return lost_modem(now, "the modem answers ERROR to AT", true);
            if (++start_at_ < start_commands.size()) return start_step(now);
            step_ = step::idle;
            told_silent_ = false;
            events_.push_back(sbd_ready{imei_});
            return go_on(now);
        case step::clearing: // an empty MO buffer: the session only looks for mail
            step_ = step::in_session;
            told_.reset();
            return command(now, std::exchange(rang_, false) ? "AT+SBDIXA" : "AT+SBDIX", options_.session_time);
        case step::offering:
        case step::writing:
            if (!ok || write_result_ != 0)
                return failed(now, fmt::format("the modem did not take the message ({})", write_result_),
                              options_.min_pause);
            step_ = step::in_session;
            told_.reset();
            return command(now, std::exchange(rang_, false) ? "AT+SBDIXA" : "AT+SBDIX", options_.session_time);
        case step::in_session: return end_session(now);
        case step::fetching: return;
        case step::fetched: step_ = step::idle; return go_on(now);
    }
}

void sbd_client::end_session(ise::time_point now) {
    if (!told_) return failed(now, "the modem told no result of a session", options_.min_pause);
    auto result = *told_;
    events_.push_back(sbd_attempt{result});
    if (!result.mo_arrived()) {
        auto pause = std::chrono::duration_cast<ise::duration>(
            std::chrono::duration<double>(dice_.between(std::chrono::duration<double>(options_.min_pause).count(),
                                                        std::chrono::duration<double>(options_.max_pause).count())));
        if (result.mo_status == 36) pause = options_.late_pause;
        return failed(now, fmt::format("{} (status {})", explain_mo_status(result.mo_status), result.mo_status), pause);
    }
    if (carrying_) {
        message_.reset();
        events_.push_back(sbd_sent{static_cast<std::uint16_t>(result.momsn)});
    }
    // A message was fetched or could not be looked for: the next session asks again.
    check_ = result.mt_queued > 0 || result.mt_status == 2 || rang_;
    first_try_ = now;
    next_try_ = result.mt_status == 2 ? ise::saturating_add(now, options_.min_pause) : now;
    fetch_ = result.mt_status == 1;
    fetch_failures_ = 0;
    step_ = step::idle;
    go_on(now);
}

void sbd_client::failed(ise::time_point now, std::string reason, ise::duration pause) {
    step_ = step::idle;
    last_reason_ = std::move(reason);
    next_try_ = ise::saturating_add(now, pause);
    go_on(now);
}

void sbd_client::lost_modem(ise::time_point now, std::string reason, bool pause) {
    if (step_ == step::fetching) fetch_failed(reason);
    last_reason_ = reason;
    if (!told_silent_) events_.push_back(sbd_silent{std::move(reason)});
    told_silent_ = true;
    step_ = step::starting;
    start_at_ = 0;
    line_.clear();
    binary_.clear();
    output_.clear();
    pausing_ = pause;
    if (pause) answer_by_ = ise::saturating_add(now, options_.answer_time);
    else start_step(now);
}

void sbd_client::go_on(ise::time_point now) {
    if (wanted() && step_ <= step::idle && now >= ise::saturating_add(first_try_, options_.give_up)) {
        bool message = message_.has_value();
        message_.reset();
        check_ = rang_ = false;
        events_.push_back(sbd_gave_up{last_reason_, message});
    }
    if (step_ != step::idle) return;
    if (fetch_) {
        step_ = step::fetching;
        binary_.clear();
        return command(now, "AT+SBDRB", options_.answer_time);
    }
    if (wanted() && now >= next_try_) begin(now);
}

void sbd_client::begin(ise::time_point now) {
    write_result_ = -1;
    carrying_ = message_.has_value();
    if (!message_) {
        step_ = step::clearing;
        return command(now, "AT+SBDD0", options_.answer_time);
    }
    step_ = step::offering;
    command(now, fmt::format("AT+SBDWB={}", message_->size()), options_.answer_time);
}

void sbd_client::on_time(ise::time_point now) {
    if (now >= answer_by_) {
        answer_by_ = ise::time_point::max();
        if (std::exchange(pausing_, false)) start_step(now);
        else lost_modem(now, step_ == step::starting ? "it does not answer" : "it did not answer a command");
    }
    go_on(now);
}

ise::time_point sbd_client::next_event() const {
    auto next = step_ == step::off ? ise::time_point::max() : answer_by_;
    if (!wanted()) return next;
    if (step_ <= step::idle) next = std::min(next, ise::saturating_add(first_try_, options_.give_up));
    if (step_ == step::idle) next = std::min(next, next_try_);
    return next;
}

std::optional<sbd_event> sbd_client::take_event() {
    if (events_.empty()) return std::nullopt;
    auto event = std::move(events_.front());
    events_.pop_front();
    return event;
}

} // namespace atirma::iridium
