#include <components/xbee/modem.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

namespace atirma::xbee {
namespace {
using namespace std::chrono_literals;
constexpr instant restart_time = 200ms;
constexpr instant transparent_silence = 5ms;
} // namespace

std::uint64_t modem::number(std::string_view name) const { return registers_.at(at(name)); }

void modem::count(std::string_view name) {
    auto& counter = registers_[at(name)];
    counter = std::min<std::uint64_t>(counter + 1, 0xFFFF);
}

ise::bytes modem::take_serial() { return std::exchange(serial_out_, {}); }

/// After what may have changed register AP, and its answer.
void modem::follow_api_mode() {
    if (line_mode_ == number("AP")) return;
    line_mode_ = number("AP");
    decoder_.reset(line_mode_ == 2 ? api_mode::escaped : api_mode::plain);
}

void modem::put(const frame& f) {
    if (line_mode_ == 0 || command_mode_) return; // nobody on the line understands frames now
    auto wire = encode(f, line_mode_ == 2 ? api_mode::escaped : api_mode::plain);
    if (serial_out_.size() + wire.size() > max_serial_out) return;
    serial_out_.insert(serial_out_.end(), wire.begin(), wire.end());
}

void modem::put_text(std::string_view text) {
    auto raw = ise::as_bytes(text);
    if (serial_out_.size() + raw.size() <= max_serial_out)
        serial_out_.insert(serial_out_.end(), raw.begin(), raw.end());
}

void modem::on_serial(instant now, ise::bytes_view bytes) {
    advance(now);
    if (bytes.empty() || restart_at_ != never) return; // a module that starts is deaf
    instant guard = number("GT") * 1ms;
    bool silent_before = now - last_serial_ >= guard;
    last_serial_ = now;
    for (std::byte b : bytes) {
        if (command_mode_) {
            command_ends_ = now + number("CT") * 100ms;
            if (b == std::byte{'\r'} || b == std::byte{'\n'}) {
                on_command_line(now);
                follow_api_mode();
            } else if (command_line_.size() < 64) command_line_ += static_cast<char>(b);
            continue;
        }
        if (b == std::byte{'+'} && plus_ < 3 && (plus_ > 0 || silent_before)) ++plus_;
        else plus_ = 0;
        silent_before = false;
        on_plain_byte(now, b);
    }
    guard_ends_ = plus_ == 3 ? now + guard : never;
    while (auto got = decoder_.next()) {
        if (auto* f = std::get_if<frame>(&*got)) {
            on_frame(now, *f);
            follow_api_mode();
        } else {
            ++refused_;
        }
    }
}

void modem::on_plain_byte(instant now, std::byte b) {
    if (line_mode_ != 0) return decoder_.push({&b, 1});
    transparent_.push_back(b);
    transparent_due_ = now + (plus_ > 0 ? number("GT") * 1ms : transparent_silence);
    if (transparent_.size() >= max_payload) flush_transparent(now);
}

void modem::flush_transparent(instant now) {
    transparent_due_ = never;
    job work;
    work.packet.destination = (number("DH") << 32) | number("DL");
    work.packet.payload = std::exchange(transparent_, {});
    if (!work.packet.payload.empty() && jobs_.size() < max_queued) enqueue(now, std::move(work));
}

instant modem::next_serial() const noexcept {
    return std::min({guard_ends_, command_ends_, transparent_due_, restart_at_});
}

void modem::serial_timers(instant now) {
    if (guard_ends_ <= now) { // +++ stood alone
        guard_ends_ = never;
        plus_ = 0;
        transparent_.clear();
        transparent_due_ = never;
        decoder_.reset(decoder_.mode());
        command_line_.clear();
        command_mode_ = true;
        command_ends_ = now + number("CT") * 100ms;
        put_text("OK\r");
    }
    if (command_ends_ <= now) {
        command_ends_ = never;
        command_mode_ = false;
    }
    if (transparent_due_ <= now) flush_transparent(now);
    if (restart_at_ <= now) {
        restart_at_ = never;
        put(modem_status{static_cast<std::uint8_t>(number("R#"))});
    }
}

void modem::on_command_line(instant now) {
    std::string line = std::exchange(command_line_, {});
    line.erase(std::remove(line.begin(), line.end(), ' '), line.end());
    if (line.empty()) return;
    auto upper = [](char c) { return static_cast<char>(std::toupper(static_cast<unsigned char>(c))); };
    if (line.size() < 4 || upper(line[0]) != 'A' || upper(line[1]) != 'T') return put_text("ERROR\r");
    at_name name{upper(line[2]), upper(line[3])};
    std::string_view argument = std::string_view(line).substr(4);
    if (name == at("CN")) {
        put_text("OK\r");
        command_mode_ = false;
        command_ends_ = never;
        return;
    }
    auto* info = find_at(name);
    if (!info) return put_text("ERROR\r");
    ise::bytes parameter;
    if (name == at("NI")) {
        parameter.assign(ise::as_bytes(argument).begin(), ise::as_bytes(argument).end());
    } else if (!argument.empty()) {
        if (argument.size() > 16 ||
            !std::all_of(argument.begin(), argument.end(), [](unsigned char c) { return std::isxdigit(c); }))
            return put_text("ERROR\r");
        parameter = at_value(std::stoull(std::string(argument), nullptr, 16), 8);
    }
    answer got = execute(now, name, parameter);
    if (got.status != at_status::ok) return put_text("ERROR\r");
    if (!parameter.empty() || info->access == at_access::action) put_text("OK\r");
    else if (name == at("NI")) put_text(node_identifier_ + "\r");
    else put_text(fmt::format("{:X}\r", at_number(got.value).value_or(0)));
}

void modem::on_frame(instant now, const frame& f) {
    if (auto* request = std::get_if<at_request>(&f)) {
        answer got;
        if (request->queued && !request->parameter.empty()) { // waits for AC or the next 08
            if (!find_at(request->command)) got.status = at_status::bad_command;
            else if (queued_at_.size() < 32) queued_at_.emplace_back(request->command, request->parameter);
            else got.status = at_status::error;
        } else {
            if (!request->queued)
                for (auto& [name, value] : std::exchange(queued_at_, {})) execute(now, name, value);
            got = execute(now, request->command, request->parameter);
        }
        if (request->frame_id) put(at_response{request->frame_id, request->command, got.status, got.value});
        return;
    }
    if (auto* request = std::get_if<transmit_request>(&f)) {
        auto refuse = [&](delivery why) {
            if (request->frame_id) put(transmit_status{request->frame_id, unknown_network, 0, why, 0});
        };
        if (request->payload.size() > max_payload) return refuse(delivery::payload_too_large);
        if (request->destination == address()) return refuse(delivery::self_addressed);
        if (jobs_.size() >= max_queued) return refuse(delivery::resource_error);
        job work;
        work.packet.destination = request->destination;
        work.packet.payload = request->payload;
        work.frame_id = request->frame_id;
        work.purge = (request->options & option_purge_if_delayed) != 0;
        return enqueue(now, std::move(work));
    }
    if (auto* request = std::get_if<remote_at_request>(&f)) {
        if (jobs_.size() >= max_queued || request->parameter.size() > max_payload) {
            if (request->frame_id)
                put(remote_at_response{request->frame_id,
                                       request->destination,
                                       unknown_network,
                                       request->command,
                                       at_status::tx_failure,
                                       {}});
            return;
        }
        job work;
        work.packet.destination = request->destination;
        work.packet.kind = radio_kind::remote_at;
        work.packet.payload = {std::byte{request->frame_id}, std::byte{request->options},
                               static_cast<std::byte>(request->command[0]),
                               static_cast<std::byte>(request->command[1])};
        work.packet.payload.insert(work.packet.payload.end(), request->parameter.begin(), request->parameter.end());
        work.frame_id = request->frame_id;
        return enqueue(now, std::move(work));
    }
    // Anything else is an answer, not a request: a module ignores it.
}

modem::answer modem::execute(instant now, at_name name, ise::bytes_view parameter) {
    auto* info = find_at(name);
    if (!info) return {at_status::bad_command, {}};
    if (info->access == at_access::action) {
        if (info->name == at("FR")) restart(now, 1);
        if (info->name == at("AC"))
            for (auto& [queued, value] : std::exchange(queued_at_, {})) execute(now, queued, value);
        if (info->name == at("RE"))
            for (auto& each : at_commands())
                if (each.access == at_access::read_write && each.name != at("AP")) registers_[each.name] = each.initial;
        return {};
    }
    if (parameter.empty()) return read(now, *info);
    if (info->access == at_access::read_only) return {at_status::bad_parameter, {}};
    if (info->name == at("NI")) {
        if (parameter.size() > info->maximum) return {at_status::bad_parameter, {}};
        node_identifier_ = std::string(ise::as_text(parameter));
        return {};
    }
    auto value = at_number(parameter);
    if (!value || *value < info->minimum || *value > info->maximum) return {at_status::bad_parameter, {}};
    registers_[info->name] = *value;
    return {};
}

modem::answer modem::read(instant now, const at_info& info) {
    if (info.name == at("NI"))
        return {at_status::ok, {ise::as_bytes(node_identifier_).begin(), ise::as_bytes(node_identifier_).end()}};
    std::uint64_t value = registers_[info.name];
    if (info.name == at("TP"))
        value = static_cast<std::uint16_t>(
            static_cast<std::int16_t>(std::lround(std::clamp(temperature_c_, -100.0, 200.0))));
    if (info.name == at("DC"))
        value = std::min<std::uint64_t>(100, static_cast<std::uint64_t>(std::lround(duty_percent(now))));
    if (info.name == at("%V")) value = 3300;
    return {at_status::ok, at_value(value, info.size)};
}

void modem::restart(instant now, std::uint8_t cause) {
    jobs_.clear();
    queued_at_.clear();
    heard_.clear();
    phase_ = phase::idle;
    timer_ = never;
    registers_[at("R#")] = cause;
    restart_at_ = now + restart_time;
}

} // namespace atirma::xbee
