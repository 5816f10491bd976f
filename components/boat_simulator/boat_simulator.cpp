#include <components/boat_simulator/boat_simulator.hpp>

#include <components/boat/telecommand_service.hpp>
#include <components/xbee/at_command.hpp>

#include <ise/component/traced_work.hpp>
#include <ise/service/service_host.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>

namespace atirma {
namespace {
using namespace std::chrono_literals;
// Only a few at the modem at a time, so that packets do not age there.
constexpr std::size_t in_hand_at_most = 3;
constexpr std::size_t max_wind_file_bytes = 64u << 20;
constexpr ise::duration send_time = 30s;
constexpr ise::duration duty_period = 10s;

double in_range(const char* what, double value, double low, double high) {
    if (value >= low && value <= high) return value; // fails for NaN
    throw ise::error(ise::errc::refused, fmt::format("{} is {:g} to {:g}, not {:g}", what, low, high, value));
}
} // namespace

std::shared_ptr<const simulator::wind_source> boat_simulator::make_wind() {
    if (!options_.wind_file.empty()) {
        auto text = env().read_file(options_.wind_file, max_wind_file_bytes).value();
        return simulator::parse_wind_csv(text, options_.wind_file).value();
    }
    simulator::wind_sample mean;
    mean.speed_mps = in_range("the wind's speed in m/s", options_.wind_speed_mps, 0, 40);
    mean.from_deg = in_range("the wind's direction in degrees", options_.wind_from_deg, 0, 360);
    if (options_.gusts) return simulator::gusting_wind(mean, options_.seed);
    return simulator::constant_wind(mean);
}

void boat_simulator::change(const boat_simulator_options& now) {
    if (now.wind_speed_mps == options_.wind_speed_mps && now.wind_from_deg == options_.wind_from_deg) return;
    if (!options_.wind_file.empty())
        throw ise::error(ise::errc::refused,
                         fmt::format("the wind is the recorded one of {}: it cannot be changed", options_.wind_file));
    auto before = std::pair(options_.wind_speed_mps, options_.wind_from_deg);
    options_.wind_speed_mps = now.wind_speed_mps;
    options_.wind_from_deg = now.wind_from_deg;
    if (!boat_) return;
    try {
        boat_->advance(model_now());
        wind_->replace_original(std::chrono::duration<double>(model_now()).count(), make_wind());
    } catch (...) {
        std::tie(options_.wind_speed_mps, options_.wind_from_deg) = before;
        throw;
    }
}

/// A boat with a memory counts its boots. One without draws a random number, never 0 nor the previous one: the clock's
/// second could be the same after an immediate restart.
std::uint16_t boat_simulator::drawn_boot() {
    for (;;) {
        auto number = static_cast<std::uint16_t>(env().random());
        if (number != 0 && !(boat_ && boat_->boot() == number)) return number;
    }
}

std::shared_ptr<const sea_limits> boat_simulator::read_limits() {
    if (options_.fence_file.empty() && !options_.keeps_off_coast) return nullptr;
    geofence fence;
    if (!options_.fence_file.empty()) {
        auto text = env().read_file(options_.fence_file, geofence::max_bytes + 1).value();
        fence = geofence::parse(text, options_.fence_file).value();
    }
    return std::make_shared<const sea_limits>(std::move(fence), options_.keeps_off_coast);
}

void boat_simulator::make_boat() {
    in_range("the speedup", options_.speedup, 0.1, 1000);
    simulator::boat_options made;
    if (options_.course != "none") {
        auto course = simulator::find_course(options_.course);
        if (!course)
            throw ise::error(ise::errc::invalid_argument,
                             fmt::format("there is no course '{}': T1, T2, none", options_.course));
        made.course = course->marks;
    }
    auto utc = std::chrono::floor<std::chrono::milliseconds>(wall());
    made.epoch = utc;
    made.clock_rate = 1 / options_.speedup;
    if (in_range("the error of the clock in seconds", options_.clock_off_s, -86400, 86400) != 0)
        made.clock_off =
            std::chrono::round<std::chrono::milliseconds>(std::chrono::duration<double>(options_.clock_off_s));
    made.seed = options_.seed;
    auto set_period = [&made](link_id link, const char* what, double period_s) {
        if (period_s != 0) in_range(what, period_s, 0.5, 86400);
        made.telemetry_period_s[static_cast<std::size_t>(link)] = period_s;
    };
    if (!options_.gprs.empty())
        set_period(link_id::gprs, "the period of telemetry over GPRS in seconds", options_.gprs_period_s);
    if (!options_.iridium.port.device.empty())
        set_period(link_id::iridium, "the period of telemetry over Iridium in seconds", options_.iridium.period_s);
    made.limits = read_limits();
    made.raw_telecommands = options_.raw_telecommands;
    made.second.reset();
    if (!options_.beacon.device.empty()) {
        made.second.emplace();
        made.second->period_s = in_range("the period of the beacon in seconds", options_.beacon_period_s, 30, 86400);
    }
    made.boot = options_.boot != 0 ? options_.boot : drawn_boot();
    wind_ = std::make_shared<simulator::scene_wind>(make_wind());
    if (!options_.memory_file.empty()) open_memory(made);
    boat_ = std::make_unique<simulator::simulated_boat>(std::move(made), wind_);
    executed_told_ = 0;
}

ise::task<> boat_simulator::run() {
    open_seal();
    make_boat();
    started_ = now();
    heard_at_ = started_;
    sent_ = failed_ = heard_ = 0;
    asked_rssi_.reset();
    rssi_dbm_ = 0;
    if (!options_.port.device.empty()) {
        port_ = std::make_unique<xbee::modem_port>(on(), log(), options_.port);
        backlog_.emplace(now());
        for (auto& raw : std::exchange(not_receipted_, {})) backlog_->put_held(std::move(raw));
        asked_duty_.reset();
        ask_duty_at_ = now();
        port_->on_event = [this](const xbee::client_event& event) { on_radio_event(event); };
        spawn("modem", port_->run());
    }
    if (!options_.iridium.port.device.empty()) {
        iridium_ =
            std::make_unique<iridium_uplink>(on(), log(), options_.iridium, [this] { boat_->advance(model_now()); });
        if (seal_) {
            iridium_->seal = [this](ise::bytes raw) { return sealed(link_id::iridium, std::move(raw)); };
            iridium_->open = [this](ise::bytes_view raw) { return opened(link_id::iridium, raw); };
        }
        spawn("Iridium", iridium_->run(*boat_));
    }
    if (!options_.beacon.device.empty()) {
        beacon_ = std::make_unique<beacon_uplink>(on(), log(), options_.beacon);
        spawn("beacon", beacon_->run());
    }
    if (!options_.gprs.empty()) {
        gprs::port_options call;
        call.shore = ise::endpoint::parse(options_.gprs).value();
        call.security = services().peers().credentials();
        call.link = options_.uplink;
        if (seal_) call.link.seal = [this](ise::bytes raw) { return sealed(link_id::gprs, std::move(raw)); };
        uplink_ = std::make_unique<gprs::uplink_port>(on(), log(), std::move(call), boat_->boot());
        uplink_->on_order = [this](const gprs::order& result) {
            if (auto plain = opened(link_id::gprs, result.raw)) heard(link_id::gprs, *plain);
        };
        for (auto& raw : std::exchange(not_acknowledged_, {})) uplink_->put(std::move(raw));
        spawn("uplink", uplink_->run());
    }
    provide(services::scene_control, [this](const scene_request& request) { return set_scene(request); });
    publish_every(services::truth, options_.truth_period, [this] {
        sail();
        return truth();
    });
    // A step of the model, at most a hundred times a second; beyond that several steps at once.
    auto pace = std::max<ise::duration>(
        10ms, std::chrono::duration_cast<ise::duration>(std::chrono::duration<double>(0.1 / options_.speedup)));
    log().info("the boat sails", {{"course", options_.course},
                                  {"boot", std::to_string(boat_->boot())},
                                  {"speedup", fmt::format("{:g}", options_.speedup)}});
    for (;;) {
        sail();
        co_await sleep(pace);
    }
}

void boat_simulator::sail() {
    boat_->set_link_status(radio_status());
    if (uplink_) boat_->set_link_status(uplink_status());
    if (iridium_) boat_->set_link_status(iridium_->status());
    // Taken before the model's time: a pause between the two must not set the boat's clock forward.
    auto utc = std::chrono::floor<std::chrono::milliseconds>(wall());
    auto time = model_now();
    boat_->follow_clock(time, utc);
    boat_->advance(time);
    if (beacon_) beacon_->carry(*boat_->second());
    if (uplink_) uplink_->set_power(!boat_->fails());
    if (boat_->fails()) return; // its modems have no power, or nobody uses them
    if (memory_) remember();
    send_notices();
    send();
    send_uplink();
    if (iridium_) iridium_->carry();
    tell_executed();
}

void boat_simulator::tell_executed() {
    const auto& all = boat_->executed();
    auto fresh = std::min<std::uint64_t>(boat_->executed_count() - executed_told_, all.size());
    executed_told_ = boat_->executed_count();
    for (auto at = all.end() - static_cast<std::ptrdiff_t>(fresh); at != all.end(); ++at) {
        if (options_.on_executed) options_.on_executed(*at);
        // The shore's span of the way over the link is linked to this one.
        const auto trace = trace_of_telecommand(at->id);
        const auto name = fmt::format("executes {}", name_of(at->kind));
        ise::traced_work done;
        done.name = name;
        done.outcome = at->code == ack_code::done ? ise::errc{} : ise::errc::refused;
        done.began = now();
        done.in.trace = trace.trace;
        done.in.high = trace.high;
        ise::record_work(*this, done, trace.parent);
    }
}

void boat_simulator::send_uplink() {
    if (!uplink_) {
        boat_->take_packets(link_id::gprs); // a period may be set for a link that it does not have
        return;
    }
    // The model's time may pass faster than the link's.
    uplink_->set_period(std::chrono::duration_cast<ise::duration>(
        std::chrono::duration<double>(boat_->telemetry_period_s(link_id::gprs) / options_.speedup)));
    for (;;) {
        auto raw = boat_->take_packet(link_id::gprs);
        if (raw.empty()) return;
        auto last = uplink_->link().last_number();
        uplink_->put(raw);
        auto number = uplink_->link().last_number();
        if (memory_ && number != last) kept(memory_->put(number, raw));
    }
}

void boat_simulator::send() {
    if (!port_) return;
    if (!radio_on_) {
        boat_->take_packets(link_id::xbee);
        return;
    }
    ask_duty_cycle();
    auto gone = backlog_->take_given_up();
    if (memory_ && !gone.empty()) kept(memory_->forget(gone));
    if (!port_->modem_ready()) return hold_telemetry();
    while (port_->modem_ready() && port_->in_hand() < in_hand_at_most) {
        auto raw = boat_->take_packet(link_id::xbee);
        bool telemetry = raw.empty() || classify(raw) == packet_class::telemetry;
        if (raw.empty()) {
            if (port_->in_hand() > 0) return; // new packets go first
            raw = backlog_->next(now());
            if (raw.empty()) return;
        } else if (telemetry) {
            bool goes = backlog_->put(now(), raw);
            keep_until_receipt(raw);
            if (!goes) continue;
        }
        auto taken = port_->send(options_.shore_address, sealed(link_id::xbee, raw), send_time);
        if (taken) continue;
        ++failed_;
        if (telemetry) backlog_->not_taken(raw);
        return;
    }
}

/// The boat's own queue is short, and loses its oldest packets.
void boat_simulator::hold_telemetry() {
    for (auto& raw : boat_->take_telemetry(link_id::xbee)) {
        keep_until_receipt(raw);
        backlog_->put_held(std::move(raw));
    }
}

void boat_simulator::keep_until_receipt(const ise::bytes& raw) {
    if (!memory_) return;
    if (auto message = parse_telemetry(raw)) kept(memory_->put({message->header.boot, message->header.sequence}, raw));
}

void boat_simulator::ask_duty_cycle() {
    if (!port_->modem_ready() || now() < ask_duty_at_) return;
    ask_duty_at_ = now() + duty_period;
    if (auto asked = port_->local_at(xbee::at("DC"))) asked_duty_ = *asked;
}

void boat_simulator::on_receipt(ise::bytes_view raw) {
    auto parsed = parse_receipt(raw);
    if (!parsed) {
        log().warning("a receipt was refused", {{"cause", parsed.error().message()}});
        return;
    }
    auto safe = backlog_->on_receipt(now(), *parsed);
    if (memory_ && !safe.empty()) kept(memory_->forget(safe));
}

void boat_simulator::on_radio_event(const xbee::client_event& event) {
    if (const auto* outcome = std::get_if<xbee::send_outcome>(&event)) {
        ++(outcome->delivered ? sent_ : failed_);
        if (outcome->delivered) backlog_->on_radio_acknowledgement(now());
    } else if (const auto* packet = std::get_if<xbee::packet_received>(&event)) {
        if (!radio_on_ || boat_->fails() || packet->source != options_.shore_address) return;
        auto plain = opened(link_id::xbee, packet->payload);
        if (!plain) return;
        heard_at_ = now();
        if (auto asked = port_->local_at(xbee::at("DB"))) asked_rssi_ = *asked;
        if (classify(*plain) == packet_class::receipt) on_receipt(*plain);
        else heard(link_id::xbee, *plain);
    } else if (const auto* answer = std::get_if<xbee::at_outcome>(&event); answer && answer->id == asked_rssi_) {
        asked_rssi_.reset();
        auto level = answer->status == xbee::at_status::ok ? xbee::at_number(answer->value) : std::nullopt;
        if (level) rssi_dbm_ = static_cast<std::int16_t>(-static_cast<int>(*level));
    } else if (const auto* used = std::get_if<xbee::at_outcome>(&event); used && used->id == asked_duty_) {
        asked_duty_.reset();
        auto percent = used->status == xbee::at_status::ok ? xbee::at_number(used->value) : std::nullopt;
        if (percent) backlog_->on_duty(static_cast<unsigned>(*percent));
    }
    // The next packets are sent with the boat's next step: sending from within an event could recurse without end.
}

void boat_simulator::heard(link_id link, ise::bytes_view raw) {
    boat_->advance(model_now());
    auto done = boat_->on_packet(link, raw);
    if (done) {
        ++heard_;
        log().info("telecommand", {{"id", std::to_string(done->id)},
                                   {"kind", std::string(name_of(done->kind))},
                                   {"result", std::string(name_of(done->code))},
                                   {"link", std::string(name_of(link))}});
    } else {
        log().warning("a packet was refused",
                      {{"cause", done.error().message()}, {"link", std::string(name_of(link))}});
    }
}

scene boat_simulator::set_scene(const scene_request& request) {
    boat_->advance(model_now());
    auto helm = helm_of(request);
    if (request.beacon_power && !boat_->second())
        throw ise::error(ise::errc::refused, "the boat has no second controller (--beacon-serial)");
    auto air = boat_->true_wind();
    if (request.wind_speed_mps) air.speed_mps = in_range("wind_speed_mps", *request.wind_speed_mps, 0, 40);
    if (request.wind_from_deg)
        air.from_deg = std::fmod(in_range("wind_from_deg", *request.wind_from_deg, 0, 360), 360.0);
    double at_s = std::chrono::duration<double>(model_now()).count();
    if (request.original_wind) wind_->change(at_s, std::nullopt);
    else if (request.wind_speed_mps || request.wind_from_deg) wind_->change(at_s, air);
    if (request.radio_on) radio_on_ = *request.radio_on;
    boat_->set_remote_control(helm);
    if (request.main_power) boat_->set_main_power(*request.main_power);
    if (request.main_controller) boat_->set_main_controller(*request.main_controller);
    if (request.beacon_power) boat_->second()->set_power(*request.beacon_power);
    auto holds = wind_->at(at_s);
    scene result;
    result.wind_speed_mps = holds.speed_mps;
    result.wind_from_deg = holds.from_deg;
    result.original_wind = wind_->original();
    result.radio_on = radio_on_;
    auto sails = boat_->navigation_now();
    result.main_power = boat_->main_power();
    result.main_controller = boat_->main_controller();
    result.beacon_power = boat_->second() && boat_->second()->has_power();
    result.remote_control = helm.has_value();
    result.rudder_deg = helm ? helm->rudder_deg : sails.rudder_commanded_deg;
    result.sail_deg = helm ? helm->sail_deg : sails.sail_commanded_deg;
    return result;
}

/// The state of the remote control after that request.
std::optional<simulator::remote_helm> boat_simulator::helm_of(const scene_request& request) const {
    auto helm = boat_->remote_control();
    if (request.remote_control == false) helm.reset();
    if (request.remote_control == true && !helm) {
        auto now = boat_->navigation_now();
        helm = {now.rudder_commanded_deg, now.sail_commanded_deg};
    }
    if (!helm && (request.rudder_deg || request.sail_deg))
        throw ise::error(ise::errc::refused,
                         "rudder_deg and sail_deg are of the remote control: give remote_control true with them");
    if (request.rudder_deg) helm->rudder_deg = in_range("rudder_deg", *request.rudder_deg, -45, 45);
    if (request.sail_deg) helm->sail_deg = in_range("sail_deg", *request.sail_deg, 0, 90);
    return helm;
}

simulator::model_time boat_simulator::model_now() const {
    auto passed_s = std::chrono::duration<double>(now() - started_).count() * options_.speedup;
    return std::chrono::duration_cast<simulator::model_time>(std::chrono::duration<double>(passed_s));
}

} // namespace atirma
