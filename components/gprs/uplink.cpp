#include <components/gprs/uplink.hpp>

#include <components/boat/telecommand.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma::gprs {
namespace {
using namespace std::chrono_literals;
constexpr std::size_t max_outcomes = 64, max_orders = 32, max_bad_lines = 8;
constexpr std::size_t again_at_once = 8; // the oldest of what is late: only these hold up the others' acknowledgement
constexpr ise::duration min_period = 5s; // less would take a slow carrier for a dead one
constexpr ise::duration max_period = 60s;
constexpr ise::duration max_patience = 5min;
constexpr int max_factor = 8;
} // namespace

uplink::uplink(std::uint16_t boot, uplink_options options) : options_(std::move(options)), boot_(boot) {
    if (!is_good_id(options_.id))
        throw ise::error(
            ise::errc::invalid_argument,
            fmt::format("'{}' is not a name for a boat: up to {} letters, digits, '-', '_', '.'", options_.id, max_id));
    if (options_.capacity == 0 || options_.window == 0)
        throw ise::error(ise::errc::invalid_argument, "an uplink that keeps nothing");
    set_period(options_.period);
}

void uplink::set_period(ise::duration period) { options_.period = std::clamp(period, min_period, max_period); }

void uplink::put(ise::bytes raw) {
    if (classify(raw) == packet_class::acknowledgement) {
        auto ack = parse_acknowledgement(raw);
        if (!ack) return;
        if (outcomes_.size() >= max_outcomes) outcomes_.pop_front(); // the shore asks again
        outcomes_.push_back(outcome{ack->id, static_cast<std::uint8_t>(ack->code), std::move(raw)});
        return;
    }
    auto message = parse_telemetry(raw);
    if (!message) return; // the boat makes no such packet
    keep(std::move(raw)).unix_s =
        std::chrono::duration_cast<std::chrono::seconds>(message->header.measured_at.time_since_epoch()).count();
    if (std::holds_alternative<location>(message->body)) fix_ = last_number();
}

void uplink::put_sealed(ise::bytes raw) { keep(std::move(raw)).sealed = true; }

uplink::kept& uplink::keep(ise::bytes raw) {
    if (ring_.size() >= options_.capacity) {
        forget_first();
        ++counters_.dropped;
        gap_untold_ = true;
    }
    auto& made = ring_.emplace_back();
    made.raw = std::move(raw);
    return made;
}

void uplink::opened(ise::time_point now) {
    ++session_;
    ++counters_.sessions;
    open_ = login_due_ = true;
    answered_ = false;
    reader_ = line_reader();
    key_.reset();
    bad_lines_ = 0;
    begin_history();
    old_under_way_ = 0;
    again_.clear();
    asked_at_.reset();
    asked_again_ = false;
    said_at_ = login_at_ = now;
}

/// What is held now is history, but for the newest fix.
void uplink::begin_history() {
    old_ = last_number();
    next_old_ = first_;
    next_new_ = old_ + 1;
}

void uplink::closed() {
    if (open_ && !answered_) factor_ = std::min(2 * factor_, max_factor);
    open_ = false;
}

void uplink::on_bytes(ise::time_point now, ise::bytes_view bytes) {
    if (options_.datagrams) return on_datagram(now, bytes);
    reader_.push(bytes);
    take(now, reader_);
}

/// Only the shore knows the token, and whoever knows the key was told it with the token: anybody can write the shore's
/// address into a datagram.
void uplink::on_datagram(ise::time_point now, ise::bytes_view content) {
    line_reader reader;
    reader.push(content);
    reader.push(ise::as_bytes("\n"));
    auto got = reader.next();
    const auto* first = got && *got ? &**got : nullptr;
    const auto* asked = first ? std::get_if<challenge>(first) : nullptr;
    const auto* shown = first ? std::get_if<shown_key>(first) : nullptr;
    if (asked && asked->token == options_.token) on_challenge(now, *asked);
    else if (shown && key_ == shown->key) take(now, reader);
    else ++counters_.malformed;
}

void uplink::on_challenge(ise::time_point now, const challenge& result) {
    if (key_ == result.key) return;
    if (!key_) begin_history(); // nothing could be sent by this way before
    key_ = result.key;
    login_due_ = true;
    for (auto& packet : ring_) // what was sent under another key was a stranger's
        if (under_way(packet)) packet.sent_at = now - resend_after();
}

void uplink::take(ise::time_point now, line_reader& from) {
    for (;;) {
        auto got = from.next();
        if (!got) return;
        const auto* result = *got ? &**got : nullptr;
        if (result && std::holds_alternative<receipt>(*result)) {
            on_receipt(now, std::get<receipt>(*result));
        } else if (result && std::holds_alternative<order>(*result)) {
            heard_at_ = now;
            bad_lines_ = 0;
            if (orders_.size() < max_orders) orders_.push_back(std::get<order>(*result)); // else it comes again
        } else {
            ++counters_.malformed;
            ++bad_lines_;
        }
    }
}

void uplink::on_receipt(ise::time_point now, const receipt& result) {
    if (result.boot != boot_ || result.number > last_number()) {
        ++counters_.malformed;
        ++bad_lines_;
        return;
    }
    bad_lines_ = 0;
    bool first = !std::exchange(answered_, true);
    factor_ = 1;
    heard_at_ = now;
    while (!ring_.empty() && first_ <= result.number) {
        forget_first();
        ++counters_.acknowledged;
    }
    // What was sent again says nothing about the delay, except that there is one.
    if (asked_at_ && (first || !asked_again_))
        slowest_ = std::max<ise::duration>(now - *asked_at_, slowest_ - slowest_ / 8);
    asked_at_.reset();
    asked_again_ = false;
    if (!ring_.empty() && under_way(ring_.front())) asked_at_ = now;
}

void uplink::forget_first() {
    if (open_ && under_way(ring_.front()) && first_ <= old_) --old_under_way_;
    ring_.pop_front();
    ++first_;
}

void uplink::on_time(ise::time_point now) {
    if (!open_) return;
    if (now >= ise::saturating_add(said_at_, options_.keepalive)) login_due_ = true;
    if (asks_for_key() && now >= ise::saturating_add(login_at_, options_.period)) login_due_ = true;
    if (!again_.empty()) return;
    auto late = [&](const kept& packet) {
        return under_way(packet) && now >= ise::saturating_add(packet.sent_at, resend_after());
    };
    auto most = std::min(again_at_once, ring_.size());
    for (std::size_t i = 0; i < most; ++i)
        if (late(ring_[i])) again_.push_back(first_ + static_cast<std::uint32_t>(i));
    // Where the boat is comes first.
    if (!again_.empty() && holds(fix_) && late(at(fix_)) && fix_ > again_.back()) again_.push_front(fix_);
    if (!again_.empty()) login_due_ = true; // the address may be another one by now
}

ise::time_point uplink::next_event() const {
    if (!open_) return ise::time_point::max();
    auto next = ise::saturating_add(said_at_, options_.keepalive);
    if (asks_for_key()) next = std::min(next, ise::saturating_add(login_at_, options_.period));
    if (asked_at_) next = std::min(next, ise::saturating_add(*asked_at_, patience()));
    auto most = std::min(again_at_once, ring_.size());
    for (std::size_t i = 0; i < most && again_.empty(); ++i)
        if (under_way(ring_[i])) next = std::min(next, ise::saturating_add(ring_[i].sent_at, resend_after()));
    return next;
}

std::string uplink::take_text(ise::time_point now) {
    std::string text;
    if (!open_) return text;
    if (gap_untold_ && now >= ise::saturating_add(login_at_, options_.period)) login_due_ = true;
    if (asks_for_key()) return login_due_ ? login_text(now) : text; // all else would be a stranger's
    if (login_due_) {
        text = login_text(now);
        if (!options_.datagrams) return text;
    }
    bool answer = !outcomes_.empty();
    auto number = answer ? std::nullopt : choose();
    // A datagram that overtakes the login would be a stranger's.
    if (options_.datagrams && !answered_ && text.empty() && (answer || number)) text = login_text(now);
    if (answer) {
        outcomes_.front().raw = sealed(std::move(outcomes_.front().raw));
        text += encode(outcomes_.front());
        outcomes_.pop_front();
        said_at_ = now;
    } else if (number) {
        text += record_text(now, *number);
    }
    return key_ && !text.empty() ? encode(shown_key{*key_}) + text : text;
}

std::string uplink::login_text(ise::time_point now) {
    login_due_ = gap_untold_ = false;
    login_at_ = said_at_ = now;
    if (!asked_at_) asked_at_ = now;
    return encode(login{options_.id, boot_, first_, last_number(), options_.token});
}

/// The number that goes next.
std::optional<std::uint32_t> uplink::choose() {
    while (!again_.empty()) {
        auto number = again_.front();
        again_.pop_front();
        if (holds(number)) return number;
    }
    if (holds(fix_) && fix_ <= old_ && !under_way(at(fix_))) return fix_;
    next_new_ = std::max(next_new_, first_);
    if (holds(next_new_)) return next_new_++;
    next_old_ = std::max(next_old_, first_);
    while (next_old_ <= old_ && holds(next_old_) && under_way(at(next_old_))) ++next_old_;
    if (next_old_ <= old_ && holds(next_old_) && old_under_way_ < options_.window) return next_old_++;
    return std::nullopt;
}

std::string uplink::record_text(ise::time_point now, std::uint32_t number) {
    auto& packet = at(number);
    bool again = under_way(packet);
    record result;
    result.boot = boot_;
    result.number = number;
    result.unix_s = packet.unix_s;
    result.history = number != fix_ && (again || number <= old_);
    result.raw = packet.sealed ? packet.raw : sealed(packet.raw);
    if (!again && number <= old_) ++old_under_way_;
    asked_again_ = asked_again_ || again;
    ++(packet.sent_in != 0 ? counters_.resent : counters_.sent);
    packet.sent_in = session_;
    packet.sent_at = said_at_ = now;
    if (!asked_at_) asked_at_ = now;
    return encode(result);
}

std::optional<order> uplink::take_order() {
    if (orders_.empty()) return std::nullopt;
    auto first = std::move(orders_.front());
    orders_.pop_front();
    return first;
}

std::optional<std::string> uplink::trouble(ise::time_point now) {
    if (!open_) return std::nullopt;
    if (bad_lines_ >= max_bad_lines) return "the shore sends invalid lines";
    if (!asked_at_ || now < ise::saturating_add(*asked_at_, patience())) return std::nullopt;
    ++counters_.half_open;
    return fmt::format("nothing was acknowledged for {} s: the link is half open",
                       std::chrono::duration_cast<std::chrono::seconds>(now - *asked_at_).count());
}

ise::duration uplink::patience() const {
    return std::min<ise::duration>(factor_ * std::max<ise::duration>(3 * options_.period, 3 * slowest_), max_patience);
}

ise::duration uplink::resend_after() const {
    return options_.datagrams ? std::max<ise::duration>(options_.period, 2 * slowest_) : patience();
}

} // namespace atirma::gprs
