#include <components/boat_simulator/simulated_boat.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace atirma::simulator {
namespace {

constexpr double step_s = 0.1;
constexpr std::int64_t step_ns = 100'000'000;
constexpr double capacity_ah = 20;
constexpr double reboot_s = 6;

waypoint start_of(const boat_options& options) {
    if (options.resumed) return options.resumed->home;
    if (options.start) return *options.start;
    if (options.course.empty()) return {28.1558, -15.4527};
    auto& a = options.course.back();
    auto& b = options.course.front();
    return {(a.latitude_deg + b.latitude_deg) / 2, (a.longitude_deg + b.longitude_deg) / 2};
}

} // namespace

simulated_boat::simulated_boat(boat_options options, std::shared_ptr<const wind_source> wind)
    : options_(std::move(options)), wind_(std::move(wind)), chart_(start_of(options_)), pilot_(chart_.origin()),
      guard_(options_.limits), boot_(options_.boot) {
    if (options_.second) second_.emplace(*options_.second);
    if (!wind_) throw ise::error(ise::errc::invalid_argument, "a simulated boat without a wind");
    auto air = to_vector(wind_->at(0));
    state_.heading_rad =
        options_.heading_deg ? from_compass_rad(*options_.heading_deg) : wrap_rad(air.towards_rad + pi / 2);
    for (auto& mark : options_.resumed ? std::vector<waypoint>() : options_.course)
        if (auto put = pilot_.insert(pilot_.list().size(), mark, state_); !put) throw ise::error(put.error());
    for (std::size_t i = 0; i < link_count; ++i) {
        links_[i].link = static_cast<link_id>(i);
        schedule_.set_period(links_[i].link, options_.telemetry_period_s[i], 0);
    }
    pilot_.set_mode(sailing_mode::automatic, state_, air);
    if (options_.resumed) resume(*options_.resumed);
    acknowledged_.assign(options_.executed.begin(), options_.executed.end());
}

void simulated_boat::resume(const remembered_boat& from) {
    boot_ = static_cast<std::uint16_t>(from.boot == 65535 ? 1 : from.boot + 1);
    authority_ = from.authority;
    distance_m_ = from.distance_m;
    beacon_ = from.beacon;
    state_.position_m = chart_.to_metres(from.place);
    state_.heading_rad = from.heading_rad;
    state_.speed_mps = from.speed_mps;
    for (const auto& mark : from.list)
        if (auto put = pilot_.insert(pilot_.list().size(), mark, state_); !put) throw ise::error(put.error());
    // A stored value that was valid is valid now; a parameter that the file does not have keeps its preset.
    for (std::size_t i = 0; i < parameter_count; ++i)
        (void)pilot_.set_parameter(static_cast<parameter_id>(i), from.parameters[i]);
    if (from.active < from.list.size()) (void)pilot_.select(from.active, state_);
    for (std::size_t i = 0; i < link_count; ++i)
        if (from.telemetry_period_s[i]) set_commanded_period(static_cast<link_id>(i), *from.telemetry_period_s[i]);
    pilot_.set_mode(from.mode, state_, to_vector(wind_->at(0)));
}

remembered_boat simulated_boat::remember() const {
    remembered_boat made;
    made.boot = boot_;
    made.authority = authority_;
    made.home = chart_.origin();
    made.place = chart_.to_waypoint(state_.position_m);
    made.heading_rad = state_.heading_rad;
    made.speed_mps = state_.speed_mps;
    made.distance_m = distance_m_;
    made.mode = pilot_.mode();
    made.list = pilot_.list();
    made.active = pilot_.active();
    made.beacon = beacon_;
    for (std::size_t i = 0; i < parameter_count; ++i)
        made.parameters[i] = pilot_.parameter(static_cast<parameter_id>(i));
    made.telemetry_period_s = commanded_period_s_;
    return made;
}

void simulated_boat::set_commanded_period(link_id link, double period_s) {
    commanded_period_s_[static_cast<std::size_t>(link)] = period_s;
    schedule_.set_period(link, period_s, now_s_);
}

void simulated_boat::advance(model_time now) {
    while ((steps_ + 1) * step_ns <= now.count()) {
        ++steps_;
        now_s_ = static_cast<double>(steps_) * step_s;
        sail(step_s);
        if (runs()) emit_due();
    }
}

model_time simulated_boat::next_event() const { return model_time((steps_ + 1) * step_ns); }

void simulated_boat::sail(double dt_s) {
    auto air = to_vector(wind_->at(now_s_));
    // The receiver of the remote control moves rudder and sheet itself, whatever the computer does.
    if (remote_) set_ = {radians(remote_->rudder_deg), radians(remote_->sail_deg)};
    else if (runs()) set_ = pilot_.update(state_, air, leeway_rad_, dt_s);
    vec before = state_.position_m;
    state_ = step(state_, set_, air, options_.model, dt_s);
    vec moved = state_.position_m - before;
    distance_m_ += length(moved);
    ground_velocity_ = 0.9 * ground_velocity_ + (0.1 / dt_s) * moved;
    if (length(ground_velocity_) > 0.2) {
        double drift = wrap_rad(state_.heading_rad - angle_rad(ground_velocity_));
        leeway_rad_ += 0.02 * (std::clamp(drift, -0.5, 0.5) - leeway_rad_);
    }
    if (runs()) obey_guard(air);
    double from_bow = wrap_rad(air.towards_rad + pi - state_.heading_rad);
    bool stuck = std::abs(state_.speed_mps) < 0.08 && std::abs(from_bow) < pi / 4 && air.speed_mps > 0.5;
    irons_s_ = stuck ? irons_s_ + dt_s : 0;
    double draw_a = main_power_ ? 0.35 + 0.4 * std::abs(set_.rudder_rad) : 0,
           hour = std::fmod(12 + now_s_ / 3600, 24.0);
    double sun_a = std::max(0.0, std::sin((hour - 6) / 12 * pi)) * 0.9;
    charge_ah_ = std::clamp(charge_ah_ + (sun_a - draw_a) * dt_s / 3600, 0.0, capacity_ah);
    if (in_irons() != was_in_irons_) {
        was_in_irons_ = in_irons();
        if (!runs()) return observe_from_second(dt_s);
        schedule_.request(packet_type::navigation);
        say(was_in_irons_ ? "in irons: head to wind without way" : "out of irons");
    }
    observe_from_second(dt_s);
}

void simulated_boat::observe_from_second(double dt_s) {
    if (!second_) return;
    second_controller::observation now;
    now.now_s = now_s_;
    now.main_runs = !fails(); // a start is short, and no failure
    now.main_power = main_power_;
    now.commanded = beacon_ && !fails();
    now.fix = location_now();
    now.clock = clock_now() - options_.clock_off.value_or(std::chrono::milliseconds(0)); // it has a GPS of its own
    second_->update(now, dt_s);
}

void simulated_boat::set_main_power(bool on) { set_failing(main_power_, on, reset_cause::brown_out); }
void simulated_boat::set_main_controller(bool works) { set_failing(main_works_, works, reset_cause::watchdog); }

void simulated_boat::set_failing(bool& what, bool works, reset_cause why) {
    bool failed = fails();
    what = works;
    if (fails() && !failed) {
        for (auto& waiting : queues_) waiting = {};
    }
    if (failed && !fails()) start_again(why);
}

/// The list, the parameters and the acknowledgements are in memory that survives.
void simulated_boat::start_again(reset_cause why) {
    up_again_s_ = now_s_ + reboot_s;
    booted_s_ = up_again_s_;
    last_reset_ = why;
    boot_ = static_cast<std::uint16_t>(boot_ == 65535 ? 1 : boot_ + 1); // never that of the second controller
    sequence_ = 0;
    pilot_.forget_staged();
    for (std::size_t i = 0; i < packet_type_count; ++i) schedule_.request(static_cast<packet_type>(i));
}

void simulated_boat::obey_guard(wind_vector air) {
    guarded_state now;
    now.now_s = now_s_;
    now.at = chart_.to_waypoint(state_.position_m);
    now.east_mps = ground_velocity_.x;
    now.north_mps = ground_velocity_.y;
    now.mode = pilot_.mode();
    now.remote_control = remote_.has_value();
    now.fence_on = pilot_.parameter(parameter_id::fence) != 0;
    now.heading_time_limit_s = static_cast<double>(pilot_.parameter(parameter_id::heading_time_limit));
    auto order = guard_.update(now);
    if (!order) return;
    pilot_.keep_station(order->station, state_, air);
    schedule_.request(packet_type::navigation);
    say(order->why);
}

void simulated_boat::set_remote_control(std::optional<remote_helm> helm) {
    bool had = remote_.has_value();
    remote_ = helm;
    if (had == remote_.has_value()) return;
    if (had) pilot_.leave(set_);
    if (!runs()) return;
    schedule_.request(packet_type::navigation);
    say(had ? fmt::format("the remote control released the helm: mode {}", name_of(pilot_.mode()))
            : "the remote control has the helm");
}

power simulated_boat::power_now() const {
    power p;
    double part = charge_ah_ / capacity_ah;
    p.battery_v = static_cast<float>(11.4 + 1.8 * part);
    p.battery_a = static_cast<float>(0.35 + 0.4 * std::abs(set_.rudder_rad));
    p.battery_percent = static_cast<std::uint8_t>(std::lround(100 * part));
    p.temperature_c = 31;
    p.uptime_s = static_cast<std::uint32_t>(std::max(0.0, now_s_ - booted_s_));
    p.last_reset = last_reset_;
    return p;
}

void simulated_boat::emit_due() {
    if (now_s_ < schedule_.next_s()) return;
    for (std::size_t i = 0; i < link_count; ++i)
        for (auto type : schedule_.take_due(static_cast<link_id>(i), now_s_)) emit(static_cast<link_id>(i), type);
}

void simulated_boat::emit(link_id link, packet_type type) {
    switch (type) {
        case packet_type::location: return emit(link, location_now());
        case packet_type::navigation: return emit(link, navigation_now());
        case packet_type::wind: return emit(link, wind_now());
        case packet_type::power: return emit(link, power_now());
        case packet_type::waypoints: return emit_waypoints(link);
        case packet_type::configuration: return emit(link, configuration_now());
        case packet_type::link_status:
            for (auto status : links_) {
                status.queued = std::max(status.queued, static_cast<std::uint16_t>(queued(status.link)));
                if (status.up || status.link == link) emit(link, status);
            }
            return;
    }
}

void simulated_boat::emit(link_id link, const telemetry_body& body) {
    queue(link, encode_telemetry(next_header(), body));
}

void simulated_boat::emit_waypoints(link_id link) {
    auto& all = pilot_.list();
    std::size_t at = 0;
    do {
        waypoints part;
        part.revision = pilot_.revision();
        part.count = static_cast<std::uint8_t>(all.size());
        part.active = pilot_.active();
        part.first = static_cast<std::uint8_t>(at);
        for (; at < all.size() && part.entries.size() < waypoints::max_entries; ++at) part.entries.push_back(all[at]);
        emit(link, part);
    } while (at < all.size());
}

void simulated_boat::say(std::string text) {
    for (std::size_t i = 0; i < link_count; ++i)
        if (schedule_.period_s(static_cast<link_id>(i)) > 0) emit(static_cast<link_id>(i), notice{text});
}

void simulated_boat::queue(link_id link, ise::bytes raw) {
    put(link, queues_[static_cast<std::size_t>(link)].telemetry, max_queued, std::move(raw));
}

void simulated_boat::queue_answer(link_id link, const acknowledgement& answer) {
    put(link, queues_[static_cast<std::size_t>(link)].answers, max_answers, encode_acknowledgement(answer));
}

void simulated_boat::put(link_id link, std::deque<ise::bytes>& to, std::size_t most, ise::bytes raw) {
    if (to.size() >= most) {
        to.pop_front();
        ++links_[static_cast<std::size_t>(link)].dropped;
    }
    to.push_back(std::move(raw));
}

utc_time simulated_boat::clock_now() const {
    auto passed_ms = static_cast<double>(steps_) * 100 * options_.clock_rate;
    return options_.epoch + options_.clock_off.value_or(std::chrono::milliseconds(0)) +
           std::chrono::milliseconds(std::llround(passed_ms));
}

void simulated_boat::follow_clock(model_time now, utc_time utc) {
    constexpr std::chrono::seconds tolerance{1};
    if (options_.clock_off) return;
    auto passed_ms = std::chrono::duration<double, std::milli>(now).count() * options_.clock_rate;
    auto ahead = utc - (options_.epoch + std::chrono::milliseconds(std::llround(passed_ms)));
    if (ahead > tolerance) options_.epoch += ahead;
}

packet_header simulated_boat::next_header() { return {boot_, sequence_++, clock_now()}; }

std::vector<ise::bytes> simulated_boat::take_packets(link_id link) {
    std::vector<ise::bytes> out;
    for (out.reserve(queued(link)); queued(link) > 0;) out.push_back(take_packet(link));
    return out;
}

ise::bytes simulated_boat::take_packet(link_id link) {
    auto& waiting = queues_[static_cast<std::size_t>(link)];
    auto& packets = waiting.answers.empty() ? waiting.telemetry : waiting.answers;
    if (packets.empty()) return {};
    ise::bytes raw = std::move(packets.front());
    packets.pop_front();
    return raw;
}

std::deque<ise::bytes> simulated_boat::take_telemetry(link_id link) {
    return std::exchange(queues_[static_cast<std::size_t>(link)].telemetry, {});
}

void simulated_boat::set_link_status(const link_status& status) {
    if (!is_known(status.link)) return;
    auto& mine = links_[static_cast<std::size_t>(status.link)];
    auto dropped = mine.dropped; // counted here
    mine = status;
    mine.dropped = dropped;
}

} // namespace atirma::simulator
