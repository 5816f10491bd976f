#include "windows_report.hpp"

#include "findings.hpp"
#include "report_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

namespace atirma::stress {
namespace {

using namespace std::chrono_literals;

constexpr ise::duration long_stall = 1s;

/// A node records before it accepts. The others were refused, or expired without having reached a node.
bool is_unknown(const account& of, const shown_command& one) { return one.accepted && !of.recorded.contains(one.id); }

bool holds(const account& of, const window_view& window) {
    return window.left && window.fix && window.commands.size() >= window.given &&
           std::ranges::all_of(window.commands,
                               [&](const auto& one) { return one.has_ended() && !is_unknown(of, one); });
}

std::string clock_at(const account& of, utc_time at) {
    return clock_text(std::chrono::duration_cast<ise::duration>(at - of.began));
}

} // namespace

bool windows_hold(const account& of) {
    return std::ranges::all_of(of.windows, [&](const auto& one) { return holds(of, one); });
}

std::string windows_text(const account& of) {
    if (of.windows.empty()) return {};
    text out;
    out.line("\n## Consoles with windows");
    out.line(
        "An operator at each worked it by mouse and keyboard. What became of a telecommand is read off the window's "
        "list, a few times per second while the list is in front.\n");
    out.line("| window | mouse | keys | telecommands | done | refused | expired | otherwise | not on record | "
             "points of the track | packets | longest without an event |");
    out.line("|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---|");
    for (const auto& one : of.windows) {
        auto count = [&](auto what) { return std::ranges::count_if(one.commands, what); };
        ise::duration stall = std::chrono::milliseconds(one.longest_stall_ms);
        out.line("| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |", one.name, one.clicks, one.keys,
                 one.commands.size(), count(&shown_command::is_done), count(&shown_command::is_refused),
                 count(&shown_command::is_expired), count([](const auto& each) { return !each.has_ended(); }),
                 count([&](const auto& each) { return is_unknown(of, each); }), one.track, one.packets,
                 stall < long_stall
                     ? length_text(stall)
                     : fmt::format("**{}**, until {}", length_text(stall), clock_at(of, one.stalled_at)));
    }
    for (const auto& one : of.windows) {
        if (!one.left) out.line("\n**{}'s window did not end.**", one.name);
        else out.line("\n{}'s window at the end: {}; {}.", one.name, one.status, one.place);
        if (one.commands.size() < one.given)
            out.line("**{} telecommands were accepted from it, and {} are in its list.**", one.given,
                     one.commands.size());
    }
    out.line("\n| given | at the window of | id | what | until | shown as | words |");
    out.line("|---|---|---:|---|---:|---|---|");
    std::vector<std::pair<const shown_command*, std::string>> all;
    for (const auto& window : of.windows)
        for (const auto& one : window.commands) all.emplace_back(&one, window.name);
    std::ranges::stable_sort(all, {}, [](const auto& one) { return one.first->given; });
    for (const auto& [one, who] : all)
        out.line("| {} | {} | {} | {} | {} | {}{} | {} |", clock_at(of, one->given), who, one->id, in_cell(one->what),
                 one->ended ? length_text(*one->ended - one->given) : "–",
                 one->has_ended() ? one->phase : "**" + one->phase + "**",
                 is_unknown(of, *one) ? ", **not on record**" : "", in_cell(one->words));
    return out.all;
}

} // namespace atirma::stress
