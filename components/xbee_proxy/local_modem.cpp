#include <components/xbee_proxy/local_modem.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace atirma {
namespace {

using xbee::at;
using xbee::at_name;

struct named_parameter {
    std::string_view name;
    at_name command;
};
// The names of xbee_local.
constexpr std::array<named_parameter, 7> names{{
    {"rssi_dbm", at("DB")},
    {"temperature_c", at("TP")},
    {"duty_cycle_percent", at("DC")},
    {"failed_deliveries", at("TR")},
    {"failed_acknowledgements", at("TA")},
    {"power_level", at("PL")},
    {"supply_mv", at("%V")},
}};

const xbee::at_info& parameter_named(const std::string& name) {
    auto found = std::find_if(names.begin(), names.end(), [&](auto& n) { return n.name == name; });
    const xbee::at_info* info = nullptr;
    if (found != names.end()) info = xbee::find_at(found->command);
    else if (name.size() == 2) info = xbee::find_at(at(name));
    if (info) return *info;
    std::string known;
    for (const auto& n : names) known += fmt::format("{}{}", known.empty() ? "" : ", ", n.name);
    auto wrong =
        name.empty() ? std::string("no parameter is named") : fmt::format("the modem has no parameter '{}'", name);
    throw ise::error(ise::errc::refused,
                     fmt::format("{}; there are {}, and the AT commands by their two letters: {{\"name\":\"{}\"}}",
                                 wrong, known, names.front().name));
}

std::int64_t shown(at_name command, ise::bytes_view value) {
    if (command == at("TP")) return xbee::temperature_c(value).value_or(0);
    auto number = static_cast<std::int64_t>(xbee::at_number(value).value_or(0));
    return command == at("DB") ? -number : number;
}

} // namespace

void local_modem::refresh() {
    auto want = [this](at_name name) {
        auto id = port_.local_at(name);
        if (!id) return;
        asked_[*id].done = [this, name](const xbee::at_outcome& answer) {
            auto number = answer.status == xbee::at_status::ok ? xbee::at_number(answer.value) : std::nullopt;
            if (number) values_[name] = *number;
            else values_.erase(name);
        };
    };
    if (!port_.modem_ready()) {
        values_.clear();
        return;
    }
    for (const auto& n : names) want(n.command);
    if (!values_.contains(at("SH")) || !values_.contains(at("SL"))) {
        want(at("SH"));
        want(at("SL"));
    }
}

bool local_modem::on_event(const xbee::client_event& event) {
    const auto* answer = std::get_if<xbee::at_outcome>(&event);
    if (!answer) return false;
    auto found = asked_.find(answer->id);
    if (found == asked_.end()) return false;
    auto done = std::move(found->second.done);
    asked_.erase(found);
    done(*answer);
    return true;
}

void local_modem::fill(xbee_local& into) const {
    auto value = [&](std::string_view name) -> std::optional<std::uint64_t> {
        auto found = values_.find(at(name));
        if (found == values_.end()) return std::nullopt;
        return found->second;
    };
    if (auto v = value("DB")) into.rssi_dbm = static_cast<std::int16_t>(-static_cast<int>(*v));
    if (auto v = value("TP")) into.temperature_c = static_cast<std::int16_t>(static_cast<std::uint16_t>(*v));
    if (auto v = value("DC")) into.duty_cycle_percent = static_cast<std::uint8_t>(*v);
    if (auto v = value("TR")) into.failed_deliveries = static_cast<std::uint16_t>(*v);
    if (auto v = value("TA")) into.failed_acknowledgements = static_cast<std::uint16_t>(*v);
    if (auto v = value("%V")) into.supply_mv = static_cast<std::uint16_t>(*v);
    if (auto v = value("PL")) {
        into.power_level = static_cast<std::uint8_t>(*v);
        for (const auto& level : xbee::power_levels())
            if (level.level == *v) into.power_mw = level.milliwatts;
    }
    auto high = value("SH"), low = value("SL");
    if (high && low) into.address = *high << 32 | *low;
}

ise::task<xbee_param> local_modem::parameter(xbee_param_request request) {
    const auto& info = parameter_named(request.name);
    ise::bytes argument;
    if (request.value) {
        if (info.access != xbee::at_access::read_write || info.size == 0)
            throw ise::error(ise::errc::refused,
                             fmt::format("{} ({}) cannot be set", xbee::text(info.name), info.meaning));
        if (info.name == at("AP") || info.name == at("BD"))
            throw ise::error(ise::errc::refused, fmt::format("{} ({}) would cut off the proxy itself",
                                                             xbee::text(info.name), info.meaning));
        if (*request.value < info.minimum || *request.value > info.maximum)
            throw ise::error(ise::errc::refused, fmt::format("{} ({}) is {} to {}, not {}", xbee::text(info.name),
                                                             info.meaning, info.minimum, info.maximum, *request.value));
        argument = xbee::at_value(*request.value, info.size);
    } else if (info.access == xbee::at_access::action) {
        throw ise::error(ise::errc::refused,
                         fmt::format("{} ({}) is not a parameter", xbee::text(info.name), info.meaning));
    }
    auto check = [&](const xbee::at_outcome& answer) {
        if (!answer.status) throw ise::error(ise::errc::handler_failed, answer.reason, ise::execution::unknown);
        if (*answer.status != xbee::at_status::ok)
            throw ise::error(ise::errc::refused, fmt::format("the modem answers {} with {}", xbee::text(info.name),
                                                             xbee::name_of(*answer.status)));
    };
    if (!argument.empty()) {
        auto set = co_await ask(info.name, argument);
        check(set);
    }
    auto read = co_await ask(info.name, ise::bytes());
    check(read);
    xbee_param made;
    made.name = xbee::text(info.name);
    made.meaning = info.meaning;
    if (info.size == 0) made.text = ise::as_text(read.value);
    else made.value = shown(info.name, read.value);
    co_return made;
}

ise::task<xbee::at_outcome> local_modem::ask(xbee::at_name name, ise::bytes parameter) {
    struct waiting {
        explicit waiting(ise::loop& on) : wake(on) {}
        ise::waiter<std::error_code> wake;
        std::optional<xbee::at_outcome> answer;
    };
    if (!port_.is_open()) throw ise::error(ise::errc::refused, port_.trouble());
    waiting here(loop_);
    auto id = port_.local_at(name, std::move(parameter));
    if (!id) throw ise::error(id.error());
    asked_[*id].done = [&here](const xbee::at_outcome& outcome) {
        here.answer = outcome;
        here.wake.resume({});
    };
    // The answer may come after the one who asked has gone.
    struct forget {
        local_modem* self;
        xbee::token id;
        ~forget() { self->asked_.erase(id); }
    } guard{this, *id};
    if (!here.answer) co_await here.wake.wait(); // throws what it was resumed with
    co_return std::move(*here.answer);
}

} // namespace atirma
