#include <components/iridium_modem/modem_9602.hpp>

#include <components/iridium/text.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {
constexpr std::size_t max_line = 400; // AT+SBDWT with its text
constexpr ise::duration data_time = std::chrono::seconds(60);
} // namespace

void modem_9602::on_serial(ise::time_point now, ise::bytes_view in) {
    for (auto b : in) {
        if (in_session_) continue; // it is busy: what comes is lost
        if (data_wanted_ > 0) {
            on_data(b);
            continue;
        }
        auto c = std::to_integer<char>(b);
        if (echo_) out_.push_back(b);
        if (c == '\n') continue;
        if (c != '\r') {
            if (line_.size() < max_line) line_ += c;
            continue;
        }
        auto command = std::exchange(line_, {});
        if (!command.empty()) on_command(now, command);
    }
}

void modem_9602::say(std::string_view line) {
    auto raw = ise::as_bytes(line);
    for (char c : {'\r', '\n'}) out_.push_back(static_cast<std::byte>(c));
    out_.insert(out_.end(), raw.begin(), raw.end());
    for (char c : {'\r', '\n'}) out_.push_back(static_cast<std::byte>(c));
}

void modem_9602::on_command(ise::time_point now, std::string_view command) {
    std::string upper;
    for (char c : command) upper += c >= 'a' && c <= 'z' ? static_cast<char>(c - 32) : c;
    auto is = [&](std::string_view name) { return upper == name; };
    if (is("AT") || is("AT&D0") || is("AT&K0") || is("AT&K3") || is("AT&W0") || is("AT&F0") || is("AT*F") ||
        is("AT*R1"))
        return ok();
    if (is("ATE0") || is("ATE1")) {
        echo_ = is("ATE1");
        return ok();
    }
    if (is("AT+CGSN") || is("AT+GSN")) return say(imei_), ok();
    if (is("AT+CGMI") || is("AT+GMI")) return say("Iridium"), ok();
    if (is("AT+CGMM") || is("AT+GMM")) return say("IRIDIUM 9600 Family SBD Transceiver"), ok();
    if (is("AT+CSQ") || is("AT+CSQF")) return say(fmt::format("+CSQ:{}", signal_bars)), ok();
    if (is("AT-MSSTM")) return say("-MSSTM: no network service"), ok();
    if (is("AT+SBDMTA?")) return say(fmt::format("+SBDMTA:{}", rings_ ? 1 : 0)), ok();
    if (is("AT+SBDMTA=0") || is("AT+SBDMTA=1")) {
        rings_ = is("AT+SBDMTA=1");
        return ok();
    }
    if (upper.starts_with("AT+SBDWB=")) {
        auto size = iridium::parse_integer("a length", std::string_view(upper).substr(9), 1, iridium::max_mo_bytes);
        if (!size) return say("3"), ok();
        say("READY");
        data_.clear();
        data_wanted_ = static_cast<std::size_t>(*size) + 2;
        data_by_ = ise::saturating_add(now, data_time);
        return;
    }
    if (upper.starts_with("AT+SBDWT=")) {
        auto text = command.substr(9);
        if (text.size() > 120) return error();
        auto raw = ise::as_bytes(text);
        mo_.assign(raw.begin(), raw.end());
        return ok();
    }
    if (is("AT+SBDRB")) return say_message();
    if (is("AT+SBDRT")) return say("+SBDRT:"), say(ise::as_text(mt_)), ok();
    if (is("AT+SBDD0") || is("AT+SBDD1") || is("AT+SBDD2")) {
        if (!is("AT+SBDD1")) mo_.clear();
        if (!is("AT+SBDD0")) mt_.clear();
        return say("0"), ok();
    }
    if (is("AT+SBDS") || is("AT+SBDSX")) {
        auto text = fmt::format("{}: {}, {}, {}, {}", upper.substr(2), mo_.empty() ? 0 : 1, momsn_, mt_.empty() ? 0 : 1,
                                mt_.empty() ? -1 : int{mtmsn_});
        if (is("AT+SBDSX")) text += fmt::format(", {}, 0", ring_pending_ ? 1 : 0);
        return say(text), ok();
    }
    if (is("AT+SBDIX") || is("AT+SBDIXA")) return begin_session();
    error();
}

void modem_9602::on_data(std::byte b) {
    data_.push_back(b);
    if (data_.size() < data_wanted_) return;
    auto content = ise::bytes_view(data_).first(data_wanted_ - 2);
    auto sum =
        std::to_integer<unsigned>(data_[data_wanted_ - 2]) * 256 + std::to_integer<unsigned>(data_[data_wanted_ - 1]);
    bool good = sum == iridium::line_sum(content);
    if (good) mo_.assign(content.begin(), content.end());
    data_wanted_ = 0;
    data_by_ = ise::time_point::max();
    say(good ? "0" : "2");
    ok();
}

/// u16 length, message, u16 sum, then text again.
void modem_9602::say_message() {
    auto push = [this](unsigned value) {
        out_.push_back(static_cast<std::byte>(value >> 8 & 0xFF));
        out_.push_back(static_cast<std::byte>(value & 0xFF));
    };
    push(static_cast<unsigned>(mt_.size()));
    out_.insert(out_.end(), mt_.begin(), mt_.end());
    push(iridium::line_sum(mt_));
    ok();
}

void modem_9602::begin_session() {
    session made;
    made.momsn = momsn_;
    made.message = mo_;
    made.received_mtmsn = mtmsn_;
    wanted_ = std::move(made);
    in_session_ = true;
    ring_pending_ = false;
}

std::optional<modem_9602::session> modem_9602::take_session() { return std::exchange(wanted_, std::nullopt); }

void modem_9602::end_session(iridium::sbdix result, ise::bytes message) {
    if (!in_session_) return;
    in_session_ = false;
    result.momsn = momsn_;
    if (result.mo_arrived()) {
        ++momsn_;
        mtmsn_ = 0; // the gateway knows by now that it arrived
    }
    if (result.mt_status == 1) {
        mt_ = std::move(message);
        mtmsn_ = static_cast<std::uint16_t>(result.mtmsn);
        result.mt_length = static_cast<int>(mt_.size());
    }
    say(iridium::encode_sbdix(result));
    ok();
    if (ring_pending_) ring();
}

void modem_9602::ring() {
    ring_pending_ = true;
    if (!rings_ || in_session_ || data_wanted_ > 0) return;
    say("SBDRING");
}

void modem_9602::on_time(ise::time_point now) {
    if (now < data_by_) return;
    data_wanted_ = 0;
    data_by_ = ise::time_point::max();
    say("1"); // the message did not come in time
    ok();
}

} // namespace atirma
