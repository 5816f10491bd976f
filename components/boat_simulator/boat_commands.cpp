#include <components/boat_simulator/simulated_boat.hpp>

#include <components/boat/raw_payload.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace atirma::simulator {

static constexpr double step_ms = 100;
// A shore clock that is synchronized is closer to UTC, and the shortest default validity is 30 s.
static constexpr std::chrono::seconds max_sent_ahead{10};

ise::result<acknowledgement> simulated_boat::on_packet(link_id link, ise::bytes_view raw) {
    if (starting()) return ise::failure(ise::errc::not_connected, "the boat is starting");
    if (fails()) return ise::failure(ise::errc::not_connected, "the boat's main controller does not run");
    auto command = parse_telecommand(raw);
    if (!command) {
        ++refused_;
        return command.error();
    }
    // Of an older shore. What only asks does no harm.
    if (!command->valid_for && traits_of(command->command.kind()).needs_authority) {
        auto no = late(*command, "it carries no validity");
        queue_answer(link, no);
        return no;
    }
    auto ack = execute(*command, link);
    queue_answer(link, ack);
    return ack;
}

/// Why its validity is over, or cannot be judged; empty: it is valid. The clock may refuse, never admit: a time in UTC
/// counts only where GPS sets the clock, and one by the boat's own clock only in the boot that it was given for.
std::string simulated_boat::lateness(const telecommand& command) const {
    if (!command.valid_for) return {};
    if (command.clock_of == 0 && options_.clock_off) return "its clock is not set by GPS, and UTC was given";
    if (command.clock_of != 0 && command.clock_of != boot_)
        return fmt::format("for the clock of boot {}, this is boot {}", command.clock_of, boot_);
    // The clock shows the last step of the model; the present is in the one that follows.
    auto step = std::chrono::milliseconds(std::llround(std::ceil(step_ms * options_.clock_rate)));
    auto now = clock_now() + step, until = command.sent_at + *command.valid_for;
    // Of a shore whose clock is wrong: the validity would end later than it was given for.
    if (command.clock_of == 0 && command.sent_at > now + max_sent_ahead)
        return fmt::format("was sent at {}, it is {}", utc_text(command.sent_at), utc_text(now));
    if (now <= until) return {};
    return fmt::format("was valid until {}, it is {}", utc_text(until), utc_text(now));
}

/// Not remembered: nothing was executed, and the id may come again in time.
acknowledgement simulated_boat::late(const telecommand& command, std::string why) {
    acknowledgement no;
    no.header = next_header();
    no.id = command.id;
    no.kind = command.command.kind();
    no.code = ack_code::expired;
    no.text = std::move(why);
    ++late_count_;
    return no;
}

acknowledgement simulated_boat::execute(const telecommand& command, link_id from) {
    auto kind = command.command.kind();
    bool needs_authority = traits_of(kind).needs_authority;
    auto known =
        std::find_if(acknowledged_.begin(), acknowledged_.end(), [&](auto& ack) { return ack.id == command.id; });
    if (known != acknowledged_.end()) {
        // May have been lost.
        if (command.command.get_if<commands::waypoint_read_back>()) schedule_.request(packet_type::waypoints, from);
        auto again = *known;
        again.header = next_header(); // a new packet with the same contents, and the time of the execution
        again.header.measured_at = std::min(known->header.measured_at, again.header.measured_at);
        // The answer names the epoch at the time of execution, not the present one.
        if (command.authority != 0 && !needs_authority) again.authority = authority_;
        return again;
    }
    if (auto why = lateness(command); !why.empty()) return late(command, std::move(why));
    bool obeyed = obeys(command.authority);
    if (needs_authority && !obeyed) {
        acknowledgement no; // not remembered: nothing was executed, and the id may come again under the valid epoch
        no.header = next_header();
        no.id = command.id;
        no.kind = kind;
        no.code = ack_code::no_authority;
        no.authority = authority_;
        no.text = fmt::format("authority {} holds, this was sent under {}", authority_, command.authority);
        return no;
    }
    if (obeyed) authority_ = command.authority;
    auto ack = decide(command.command, command.id, from);
    if (command.authority != 0) ack.authority = authority_;
    acknowledged_.push_back(ack);
    ++executed_count_;
    if (acknowledged_.size() > remembered_commands) acknowledged_.pop_front();
    return ack;
}

/// An epoch is accepted up to `max_epoch_step` above the boat's, so that a forged one cannot use up all epochs. They
/// wrap around to 1, 2, 3….
bool simulated_boat::obeys(std::uint32_t epoch) const {
    if (epoch == 0) return authority_ == 0;
    return epoch - authority_ <= max_epoch_step;
}

/// Executes each telecommand: returns the text of the answer, or an error (invalid_argument: the argument is wrong).
/// The arguments are in their ranges.
struct simulated_boat::command_handlers {
    simulated_boat& boat;
    link_id from;

    using outcome = ise::result<std::string>;
    static outcome nothing_to_say(const ise::result<void>& done) {
        if (!done) return done.error();
        return std::string();
    }
    outcome list_changed(const ise::result<void>& done) {
        if (!done) return done.error();
        boat.schedule_.request(packet_type::waypoints);
        boat.schedule_.request(packet_type::navigation);
        return std::string();
    }

    ise::result<void> fence_allows(std::size_t before, const waypoint& point) const {
        if (boat.pilot_.parameter(parameter_id::fence) == 0) return {};
        const auto& list = boat.pilot_.list();
        return boat.guard_.allows(point, before > 0 && before <= list.size() ? &list[before - 1] : nullptr,
                                  before < list.size() ? &list[before] : nullptr);
    }

    outcome operator()(const commands::ping&) {
        return fmt::format("boot {}, up {:.0f} s", boat.boot_, boat.now_s_ - boat.booted_s_);
    }
    outcome operator()(const commands::set_mode& to) {
        boat.pilot_.set_mode(to.mode, boat.state_, to_vector(boat.true_wind()));
        boat.guard_.on_mode(boat.now_s_);
        boat.schedule_.request(packet_type::navigation);
        return std::string(name_of(to.mode));
    }
    outcome operator()(const commands::waypoint_insert& at) {
        if (auto good = fence_allows(at.index, at.point); !good) return good.error();
        return list_changed(boat.pilot_.insert(at.index, at.point, boat.state_));
    }
    outcome operator()(const commands::waypoint_add& at) {
        if (auto good = fence_allows(boat.pilot_.list().size(), at.point); !good) return good.error();
        return list_changed(boat.pilot_.insert(boat.pilot_.list().size(), at.point, boat.state_));
    }
    outcome operator()(const commands::waypoint_delete& at) {
        return list_changed(boat.pilot_.erase(at.index, boat.state_));
    }
    outcome operator()(const commands::waypoint_clear&) {
        boat.pilot_.clear();
        return list_changed({});
    }
    outcome operator()(const commands::waypoint_read_back&) {
        boat.schedule_.request(packet_type::waypoints, from);
        return std::string();
    }
    outcome operator()(const commands::waypoint_select& at) {
        return list_changed(boat.pilot_.select(at.index, boat.state_));
    }
    outcome operator()(const commands::set_parameter& to) {
        auto done = boat.pilot_.set_parameter(to.parameter, to.value);
        if (!done) return done.error();
        if (to.parameter == parameter_id::fence)
            boat.say(to.value == 0 ? "fence off: it may leave its fence and run aground" : "fence on");
        if (to.parameter == parameter_id::telemetry_period) boat.set_commanded_period(link_id::xbee, to.value);
        boat.schedule_.request(packet_type::configuration);
        return std::string();
    }
    outcome operator()(const commands::get_parameter&) { return std::string(); }
    outcome operator()(const commands::tack_now&) { return nothing_to_say(boat.pilot_.tack_now()); }
    outcome operator()(const commands::gybe_now&) { return nothing_to_say(boat.pilot_.gybe_now()); }
    outcome operator()(const commands::set_telemetry_period& to) {
        boat.set_commanded_period(to.link, to.period_s);
        boat.schedule_.request(packet_type::configuration);
        bool also_parameter = to.link == link_id::xbee && check_parameter(parameter_id::telemetry_period, to.period_s);
        if (!also_parameter) return std::string();
        // The parameter is the same setting.
        return nothing_to_say(boat.pilot_.set_parameter(parameter_id::telemetry_period, to.period_s));
    }
    outcome operator()(const commands::request_status&) {
        boat.schedule_.request_all(from);
        return std::string();
    }
    outcome operator()(const commands::reboot&) {
        boat.start_again(reset_cause::commanded);
        return fmt::format("starting, boot {}", boat.boot_);
    }
    outcome operator()(const commands::emergency_beacon& to) {
        if (to.on && !boat.second_)
            return ise::failure(ise::errc::refused, "it has no second controller: nothing would transmit");
        boat.beacon_ = to.on;
        boat.schedule_.request(packet_type::location);
        boat.schedule_.request(packet_type::navigation);
        return std::string(to.on ? "beacon on" : "beacon off");
    }
    outcome operator()(const commands::mission_stage& at) {
        return nothing_to_say(boat.pilot_.stage(at.index, at.point));
    }
    outcome operator()(const commands::mission_switch& to) {
        auto list = boat.pilot_.staged(to.count, to.checksum);
        if (!list) return list.error();
        if (boat.pilot_.parameter(parameter_id::fence) != 0)
            if (auto good = boat.guard_.allows(*list); !good) return good.error();
        boat.pilot_.replace(std::move(*list), boat.state_);
        return list_changed({});
    }
    outcome operator()(const commands::raw& given) {
        if (!boat.options_.raw_telecommands)
            return ise::failure(ise::errc::refused, "raw telecommands are off aboard (--raw-telecommands)");
        boat.last_raw_ = payload_bytes(given.payload).value(); // it was checked
        auto bytes = fmt::format("{} byte{}", boat.last_raw_.size(), boat.last_raw_.size() == 1 ? "" : "s");
        boat.say(fmt::format("raw telecommand: {} to the controller", bytes));
        return "the controller has " + bytes; // the simulated one does nothing with them
    }
    outcome operator()(const commands::unknown&) { return std::string(); } // answered earlier
};

/// The present value, for telecommands that return one, also if they were refused.
struct simulated_boat::command_values {
    const simulated_boat& boat;

    float operator()(const commands::set_parameter& of) { return boat.pilot_.parameter(of.parameter); }
    float operator()(const commands::get_parameter& of) { return boat.pilot_.parameter(of.parameter); }
    float operator()(const commands::set_telemetry_period& of) {
        return is_known(of.link) ? static_cast<float>(boat.schedule_.period_s(of.link)) : 0;
    }
    float operator()(const auto&) { return static_cast<float>(boat.pilot_.list().size()); } // waypoints
};

acknowledgement simulated_boat::decide(const boat_command& command, std::uint32_t id, link_id from) {
    acknowledgement ack;
    ack.header = next_header();
    ack.id = id;
    ack.kind = command.kind();
    auto good = check(command);
    if (good && remote_ && traits_of(ack.kind).steers)
        good = ise::failure(ise::errc::refused, "the remote control has the helm until it is released");
    auto done = good ? command.visit(command_handlers{*this, from}) : command_handlers::outcome(good.error());
    if (done) {
        ack.text = *done;
    } else {
        bool wrong = done.error().code() == ise::errc::invalid_argument;
        ack.code = command.get_if<commands::unknown>() ? ack_code::unknown_command
                   : wrong                             ? ack_code::bad_argument
                                                       : ack_code::refused;
        ack.text = done.error().message();
    }
    if (traits_of(ack.kind).returns_value) ack.value = command.visit(command_values{*this});
    return ack;
}

} // namespace atirma::simulator
