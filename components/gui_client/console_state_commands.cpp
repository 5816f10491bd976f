#include <components/gui_client/console_state.hpp>

#include <components/gui_client/words.hpp>

#include <fmt/format.h>

#include <algorithm>

// What becomes of telecommands, and of the parameters that they set.
namespace atirma::console {

void console_state::on_status(const std::string& path, const telecommand_status& status, utc_time now) {
    auto* link = link_at(path);
    if (!link) return;
    if (!link->link && !link->all_links) link->link = status.link;
    const auto* before = commands_.find(status.id);
    auto attempts = before ? before->attempts : 0;
    const auto& entry = commands_.on_status(path, status, now);
    if (!link->all_links && status.link == link_id::iridium && entry.attempts > attempts)
        link->credits += entry.attempts - attempts; // a telecommand is short
    if (is_over(entry.phase)) settle_parameter(entry.id, entry.phase, entry.value, entry.text, now);
}

void console_state::asked(std::uint32_t id, const std::string& path, const boat_command& command, utc_time now) {
    command_entry entry;
    entry.id = id;
    entry.path = path;
    entry.link = link_of_path(path);
    entry.what = describe(command);
    entry.own = true;
    entry.asked_at = now;
    commands_.asked(std::move(entry));
    const auto* set = command.get_if<commands::set_parameter>();
    const auto* get = command.get_if<commands::get_parameter>();
    if (!set && !get) return;
    auto which = set ? set->parameter : get->parameter;
    parameter_commands_[id] = which;
    for (auto& one : parameters_) {
        if (one.id != which) continue;
        one.problem.clear();
        if (set) one.pending = set->value;
    }
}

void console_state::on_outcome(std::uint32_t id, command_phase phase, std::optional<float> value, std::string text,
                               utc_time now) {
    commands_.on_outcome(id, phase, value, text, now);
    if (!is_over(phase)) return;
    settle_parameter(id, phase, value, text, now);
    if (phase == command_phase::done) return;
    const auto* entry = commands_.find(id);
    auto what = entry ? entry->what : fmt::format("telecommand {}", id);
    alarms_.tell(fmt::format("command:{}", id), severity::warning,
                 fmt::format("“{}” {}: {}", what, name_of(phase), text), now);
}

void console_state::settle_parameter(std::uint32_t id, command_phase phase, std::optional<float> value,
                                     const std::string& text, utc_time now) {
    auto found = parameter_commands_.find(id);
    if (found == parameter_commands_.end()) return;
    auto which = found->second;
    parameter_commands_.erase(found);
    for (auto& one : parameters_) {
        if (one.id != which) continue;
        bool another = std::any_of(parameter_commands_.begin(), parameter_commands_.end(),
                                   [&](const auto& open) { return open.second == which; });
        if (!another) one.pending.reset();
        if (value) {
            one.confirmed = value;
            one.confirmed_at = now;
        }
        if (phase != command_phase::done) one.problem = text.empty() ? std::string(name_of(phase)) : text;
    }
}

} // namespace atirma::console
