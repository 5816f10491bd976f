#include <components/boat_simulator/simulated_boat.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace atirma::simulator {

static constexpr double reboot_s = 6;

ise::result<acknowledgement> simulated_boat::on_packet(link_id link, ise::bytes_view raw) {
    if (starting()) return ise::failure(ise::errc::not_connected, "the boat is starting");
    auto command = parse_telecommand(raw);
    if (!command) {
        ++refused_;
        return command.error();
    }
    auto ack = execute(*command, link);
    queue_answer(link, ack);
    return ack;
}

acknowledgement simulated_boat::execute(const telecommand& command, link_id from) {
    auto known = std::find_if(acknowledged_.begin(), acknowledged_.end(), [&](auto& ack) { return ack.id == command.id; });
    if (known != acknowledged_.end()) {
        if (command.kind == command_kind::waypoint_read_back) schedule_.request(packet_type::waypoints, from); // may have been lost
        auto again = *known;
        again.header = next_header(); // another packet that says the same
        // What was done names the epoch under which it was done, whatever has been heard since.
        if (command.authority != 0 && !needs_authority(command.kind)) again.authority = authority_;
        return again;
    }
    bool obeyed = obeys(command.authority);
    if (needs_authority(command.kind) && !obeyed) {
        acknowledgement no; // not remembered: nothing was done, and the id may come again under the epoch that holds
        no.header = next_header();
        no.id = command.id;
        no.kind = command.kind;
        no.code = ack_code::no_authority;
        no.authority = authority_;
        no.text = fmt::format("authority {} holds, this was sent under {}", authority_, command.authority);
        return no;
    }
    if (obeyed) authority_ = command.authority;
    auto ack = decide(command, from);
    if (command.authority != 0) ack.authority = authority_;
    acknowledged_.push_back(ack);
    ++executed_count_;
    if (acknowledged_.size() > remembered_commands) acknowledged_.pop_front();
    return ack;
}

/// An epoch counts up to `max_epoch_step` above the boat's, so that a forged one never takes all that are left from the
/// operators. After the last one come 1, 2, 3….
bool simulated_boat::obeys(std::uint32_t epoch) const {
    if (epoch == 0) return authority_ == 0;
    return epoch - authority_ <= max_epoch_step;
}

acknowledgement simulated_boat::decide(const telecommand& command, link_id from) {
    acknowledgement ack;
    ack.header = next_header();
    ack.id = command.id;
    ack.kind = command.kind;
    auto settle = [&](const ise::result<void>& outcome) {
        if (outcome) return true;
        ack.code = outcome.error().code() == ise::errc::invalid_argument ? ack_code::bad_argument : ack_code::refused;
        ack.text = outcome.error().message();
        return false;
    };
    auto list_changed = [&] {
        schedule_.request(packet_type::waypoints);
        schedule_.request(packet_type::navigation);
    };
    switch (command.kind) {
        case command_kind::ping: ack.text = fmt::format("boot {}, up {:.0f} s", boot_, now_s_ - booted_s_); break;
        case command_kind::set_mode:
            if (!is_known(command.mode)) {
                settle(ise::failure(ise::errc::invalid_argument, fmt::format("no mode has number {}", static_cast<int>(command.mode))));
                break;
            }
            pilot_.set_mode(command.mode, state_, to_vector(true_wind()));
            ack.text = name_of(command.mode);
            schedule_.request(packet_type::navigation);
            break;
        case command_kind::waypoint_add:
        case command_kind::waypoint_insert: {
            std::size_t place = command.kind == command_kind::waypoint_add ? pilot_.list().size() : command.index;
            if (settle(pilot_.insert(place, command.point, state_))) list_changed();
            break;
        }
        case command_kind::waypoint_delete:
            if (settle(pilot_.erase(command.index, state_))) list_changed();
            break;
        case command_kind::waypoint_select:
            if (settle(pilot_.select(command.index, state_))) list_changed();
            break;
        case command_kind::waypoint_clear:
            pilot_.clear();
            list_changed();
            break;
        case command_kind::waypoint_read_back: schedule_.request(packet_type::waypoints, from); break;
        case command_kind::set_parameter:
            if (settle(pilot_.set_parameter(command.parameter, command.value))) {
                if (command.parameter == parameter_id::telemetry_period) schedule_.set_period(link_id::xbee, command.value, now_s_);
                schedule_.request(packet_type::configuration);
            }
            ack.value = pilot_.parameter(command.parameter);
            break;
        case command_kind::get_parameter:
            if (!is_known(command.parameter))
                settle(ise::failure(ise::errc::invalid_argument, fmt::format("no parameter has number {}", static_cast<int>(command.parameter))));
            ack.value = pilot_.parameter(command.parameter);
            break;
        case command_kind::tack_now: settle(pilot_.tack_now()); break;
        case command_kind::gybe_now: settle(pilot_.gybe_now()); break;
        case command_kind::set_telemetry_period:
            if (!is_known(command.link)) {
                settle(ise::failure(ise::errc::invalid_argument, fmt::format("no link has number {}", static_cast<int>(command.link))));
            } else if (!(command.period_s == 0 || (command.period_s >= 0.5f && command.period_s <= 86400))) {
                settle(ise::failure(ise::errc::invalid_argument, fmt::format("a period is 0 (off) or 0.5 to 86400 s, not {:g}", command.period_s)));
            } else {
                schedule_.set_period(command.link, command.period_s, now_s_);
                if (command.link == link_id::xbee && command.period_s > 0 && check_parameter(parameter_id::telemetry_period, command.period_s))
                    settle(pilot_.set_parameter(parameter_id::telemetry_period, command.period_s)); // the same thing by its other name
                schedule_.request(packet_type::configuration);
            }
            if (is_known(command.link)) ack.value = static_cast<float>(schedule_.period_s(command.link));
            break;
        case command_kind::request_status: schedule_.request_all(from); break;
        case command_kind::reboot:
            // The list, the parameters and what was acknowledged are kept in memory that survives.
            up_again_s_ = now_s_ + reboot_s;
            booted_s_ = up_again_s_;
            last_reset_ = reset_cause::commanded;
            ++boot_;
            sequence_ = 0;
            for (std::size_t i = 0; i < packet_type_count; ++i) schedule_.request(static_cast<packet_type>(i));
            ack.text = fmt::format("starting, boot {}", boot_);
            break;
        case command_kind::emergency_beacon:
            beacon_ = command.on;
            ack.text = beacon_ ? "beacon on" : "beacon off";
            schedule_.request(packet_type::location);
            schedule_.request(packet_type::navigation);
            break;
        default:
            ack.code = ack_code::unknown_command;
            ack.text = fmt::format("no command has number {}", static_cast<int>(command.kind));
    }
    using enum command_kind;
    for (auto kind : {waypoint_add, waypoint_insert, waypoint_delete, waypoint_clear, waypoint_select, waypoint_read_back})
        if (command.kind == kind) ack.value = static_cast<float>(pilot_.list().size());
    return ack;
}

} // namespace atirma::simulator
