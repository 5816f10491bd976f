#include "report.hpp"

#include "report_text.hpp"
#include "windows_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <ratio>
#include <stdexcept>

namespace atirma::stress {
namespace {

using namespace std::chrono_literals;

constexpr std::array<std::string_view, link_count> link_names{"XBee", "GPRS", "Iridium"};

/// Of everything that was sent, also of what nobody promised to keep.
void say_links(text& out, const account& of, const ledger::verdict& proof) {
    out.line("\n| link | sent | received on shore | stored | still at the boat | lost | causes of the loss |");
    out.line("|---|---:|---:|---:|---:|---:|---|");
    for (std::size_t i = 0; i < link_count; ++i) {
        const auto& one = proof.links[i];
        std::uint64_t lost = 0;
        std::string causes;
        for (const auto& [cause, count] : findings::causes_of(of, proof.lost, static_cast<link_id>(i))) {
            lost += count;
            causes += fmt::format("{}{} {}", causes.empty() ? "" : "; ", count, cause);
        }
        out.line("| {} | {} | {} | {} | {} | {} | {} |", link_names[i], one.sent, one.heard, one.kept, one.waiting,
                 lost, causes);
    }
    out.line("\nSent: passed to the link's modem at least once. Received on shore: read by the XBee proxy, "
             "acknowledged over GPRS, "
             "accepted by Iridium's gateway. Stored: on the disk of a communication node.");
}

void say_proof(text& out, const account& of, const ledger::verdict& proof) {
    out.line("\n## The proof");
    out.line("Recorded on the boat's own wires, not reported by the components: XBee and GPRS by the shore's receipts, "
             "Iridium "
             "by the sessions that the gateway accepted.");
    out.line("*Owed* are the packets that the shore had acknowledged by the end; all of them must be {}.\n",
             of.database ? "in the database of the communication nodes" : "on the disks of both communication nodes");
    out.line("| link | sent by the boat | acknowledged by the modem or the shore | owed | missing |");
    out.line("|---|---:|---:|---:|---:|");
    for (std::size_t i = 0; i < link_count; ++i) {
        const auto& one = proof.links[i];
        auto missing = std::ranges::count_if(
            proof.missing, [&](const auto& missed) { return missed.what.link == static_cast<link_id>(i); });
        out.line("| {} | {} | {} | {} | {} |", link_names[i], one.sent, one.acknowledged, one.owed, missing);
    }
    if (of.database) out.line("\nIn the database and not seen on a wire: {}.", proof.unheard);
    else out.line("\nOn one disk only: {}. On the disks and not seen on a wire: {}.", proof.only_on_one, proof.unheard);
    out.line("After the end it took {} of calm until no packet was owed.", length_text(of.calm));
    std::size_t count = 0;
    for (const auto& missing : proof.missing) {
        if (++count > 50) {
            out.line("- … and {} more", proof.missing.size() - 50);
            break;
        }
        const auto& e = missing.what;
        out.line("- {}: boot {} packet {}, sent {}, owed since {}: **missing**",
                 link_names[static_cast<std::size_t>(e.link)], missing.which >> 32, missing.which & 0xFFFFFFFF,
                 clock_text(e.sent), clock_text(e.owed_since()));
    }
    out.line("\n| subscriber of the role | shown | twice | never | not on disk |");
    out.line("|---|---:|---:|---:|---:|");
    for (const auto& [who, one] : proof.subscribers)
        out.line("| {} | {} | {} | {} | {} |", who, one.shown, one.twice, one.missed, one.unknown);
    out.line("| page | {} | {} | | |", of.page.received, of.page.duplicates);
    for (const auto& one : of.consoles)
        out.line("\nAt the end {}'s console knew {}, {} links, {} points of the track, {} telecommands, {} components.",
                 one.name, one.fix ? "the boat's position" : "**no position of the boat**", one.links, one.track,
                 one.commands, one.present);
}

void say_packets(text& out, const findings& found) {
    out.line("\n## Packets by type and link");
    out.line("| type | XBee | GPRS | Iridium |");
    out.line("|---|---:|---:|---:|");
    std::map<std::string, std::array<std::uint64_t, link_count>> rows;
    for (std::size_t i = 0; i < link_count; ++i)
        for (const auto& [type, count] : found.by_type[i]) rows[type][i] = count;
    std::array<std::uint64_t, link_count> sum{};
    for (const auto& [type, counts] : rows) {
        out.line("| {} | {} | {} | {} |", type, counts[0], counts[1], counts[2]);
        for (std::size_t i = 0; i < link_count; ++i) sum[i] += counts[i];
    }
    out.line("| **all** | {} | {} | {} |", sum[0], sum[1], sum[2]);
    out.line("| of these history | {} | {} | {} |", found.history[0], found.history[1], found.history[2]);
    out.line("\nHistory: packets older on arrival than the newest one of their type; nearly all of Iridium's, while "
             "another link works.");
}

void say_gaps(text& out, const account& of, const findings& found) {
    out.line("\n## Gaps and their causes");
    for (std::size_t i = 0; i < link_count; ++i) {
        const auto& all = found.gaps[i];
        ise::duration sum{};
        for (const auto& one : all) sum += one.until - one.from;
        out.line("\n{}: {} of more than {}, {} in all.\n", link_names[i], counted(all.size(), "silence"),
                 length_text(findings::silence_of(static_cast<link_id>(i), of.plan)), length_text(sum));
        if (all.empty()) continue;
        out.line("| from | until | length | cause |");
        out.line("|---|---|---:|---|");
        for (const auto& one : all)
            out.line("| {} | {} | {} | {} |", clock_text(one.from), clock_text(one.until),
                     length_text(one.until - one.from), one.cause.empty() ? "**unknown**" : one.cause);
    }
    out.line("\nThe track after the last packet had arrived: {} of more than 20 s.",
             counted(found.track_gaps.size(), "gap"));
    for (const auto& one : found.track_gaps)
        out.line("- {} to {}, {}: {}", clock_text(one.from), clock_text(one.until), length_text(one.until - one.from),
                 one.cause.empty() ? "**unknown**" : one.cause);
}

std::string part(std::vector<ise::duration>& times, std::size_t percent) {
    if (times.empty()) return "–";
    return length_text(times[(times.size() - 1) * percent / 100]);
}

std::string outcome_of(const given_command& one) {
    if (one.decided.count() < 0) return "**not decided**";
    if (one.state == telecommand_stage::acknowledged)
        return one.result ? std::string(name_of(*one.result)) : "acknowledged";
    return one.state == telecommand_stage::expired ? "expired" : "refused";
}

void say_commands(text& out, const account& of) {
    out.line("\n## Telecommands");
    out.line("| requested link | sent | acknowledged | done | median | 90 % | longest | otherwise |");
    out.line("|---|---:|---:|---:|---:|---:|---:|---|");
    for (int way = -1; way < static_cast<int>(link_count); ++way) {
        std::vector<ise::duration> times;
        std::size_t given = 0, done = 0;
        std::map<std::string, int> others;
        for (const auto& who : of.people)
            for (const auto& one : who.commands) {
                if ((one.request.via ? static_cast<int>(*one.request.via) : -1) != way) continue;
                ++given;
                if (one.state == telecommand_stage::acknowledged) times.push_back(one.decided - one.asked);
                if (one.result == ack_code::done) ++done;
                else ++others[outcome_of(one)];
            }
        std::ranges::sort(times);
        std::string otherwise;
        for (const auto& [what, count] : others)
            otherwise += fmt::format("{}{} {}", otherwise.empty() ? "" : ", ", count, what);
        out.line("| {} | {} | {} | {} | {} | {} | {} | {} |",
                 way < 0 ? "the best link" : link_names[static_cast<std::size_t>(way)], given, times.size(), done,
                 part(times, 50), part(times, 90), part(times, 100), otherwise);
    }
    out.line("\nA console's telecommands are checked once a second, so the times are whole seconds. The nodes' "
             "record contains {} telecommands: these, and the nodes' own, which set the boat's authority.",
             of.recorded.size());
    auto late = late_executions(of);
    if (of.virtual_clock)
        out.line("\nThe boat executed {} telecommands, **{} of them after their validity**.", of.executed.size(),
                 late.size());
    for (const auto& one : late)
        out.line("- {}: {} {}: **executed too late**", clock_text(one.at), name_of(one.kind), one.id);
    out.line("\n| asked | by | id | what | over | until | outcome | words |");
    out.line("|---|---|---:|---|---|---:|---|---|");
    std::vector<std::pair<const given_command*, std::string>> all;
    for (const auto& who : of.people)
        for (const auto& one : who.commands) all.emplace_back(&one, who.name);
    std::ranges::stable_sort(all, {}, [](const auto& one) { return one.first->asked; });
    for (const auto& [one, who] : all) {
        out.line("| {} | {} | {} | {} | {} | {} | {} | {} |", clock_text(one->asked), who, one->request.id,
                 name_of(one->request.command.kind()),
                 one->request.via ? link_names[static_cast<std::size_t>(*one->request.via)] : "best",
                 one->decided.count() < 0 ? "–" : length_text(one->decided - one->asked), outcome_of(*one),
                 in_cell(one->text));
    }
}

void say_troubles(text& out, const account& of) {
    out.line("\n## Injected faults");
    out.line("| at | for | what |");
    out.line("|---|---:|---|");
    for (const auto& one : of.episodes)
        out.line("| {} | {} | {} |", clock_text(one.from),
                 one.until < one.from    ? "the rest"
                 : one.until == one.from ? ""
                                         : length_text(one.until - one.from),
                 one.what);
    if (of.virtual_clock)
        out.line("\nA node returned {} times with a backup of its disk; if the other node did not have "
                 "all of its packets yet, it kept its disk.",
                 of.set_back);
}

std::string change(const std::vector<sample>& all, std::size_t sample::*what) {
    std::vector<std::pair<ise::duration, std::size_t>> values;
    for (const auto& one : all)
        if (one.settled()) values.emplace_back(one.at, one.*what);
    return say(trend_of(values));
}

/// Of the processes of a real deployment.
void say_processes(text& out, const account& of) {
    out.line("All processes of the deployment together; a process that is down is missing in its line.\n");
    out.line("- resident KiB: {}", change(of.samples, &sample::resident_kib));
    out.line("- descriptors: {}", change(of.samples, &sample::descriptors));
    out.line("\n{}", meaning_of_flat());
    out.line("\n| at | processes | resident KiB | descriptors |\n|---|---:|---:|---:|");
    for (const auto& s : of.samples)
        out.line("| {} | {} | {} | {} |", clock_text(s.at), s.processes, s.resident_kib, s.descriptors);
}

void say_samples(text& out, const account& of) {
    out.line("\n## Over time");
    if (!of.virtual_clock) return say_processes(out, of);
    out.line("Waiting: coroutines and timers of the world that wait for a time or an operation, without the "
             "script's own. Sessions: of all components.");
    out.line("Unacknowledged, queued, no receipt: at the boat. The nodes: packets on disk; what is not shown yet; "
             "telecommands "
             "that are open.\n");
    const auto& all = of.samples;
    out.line("- waiting: {}", change(all, &sample::waiting));
    out.line("- sessions: {}", change(all, &sample::sessions));
    out.line(
        "\n{} Samples taken while a component was down, or while 256 packets or more had no receipt, do not count.",
        meaning_of_flat());
    out.line("\n| at | waiting | sessions | GPRS unacknowledged | XBee queued | no receipt | node 1: packets | not "
             "shown | open | "
             "node 2: packets | not shown | open |");
    out.line("|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
    for (const auto& s : all)
        out.line("| {}{} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |", clock_text(s.at),
                 s.whole ? "" : " (a component is down)", s.waiting, s.sessions, s.gprs_waiting, s.xbee_queued,
                 s.xbee_waiting, s.packets[0], s.unseen[0], s.open[0], s.packets[1], s.unseen[1], s.open[1]);
}

void say_complaints(text& out, const account& of) {
    out.line("\n## Warnings and errors of the components");
    std::vector<std::pair<std::string, std::uint64_t>> all(of.complaints.begin(), of.complaints.end());
    std::ranges::stable_sort(all, std::greater<>(), &std::pair<std::string, std::uint64_t>::second);
    for (std::size_t i = 0; i < all.size() && i < 40; ++i) out.line("- {} × {}", all[i].second, all[i].first);
}

} // namespace

trend trend_of(const std::vector<std::pair<ise::duration, std::size_t>>& all) {
    trend made;
    if (all.empty()) return made;
    auto hours = [](ise::duration at) { return std::chrono::duration<double, std::ratio<3600>>(at).count(); };
    std::vector<std::pair<double, double>> late;
    for (const auto& [at, value] : all)
        if (at >= all.back().first / 2) late.emplace_back(hours(at), static_cast<double>(value));
    double mean_at = 0, count = static_cast<double>(late.size());
    for (const auto& [at, value] : late) {
        mean_at += at / count;
        made.mean += value / count;
    }
    double together = 0, spread = 0;
    for (const auto& [at, value] : late) {
        together += (at - mean_at) * (value - made.mean);
        spread += (at - mean_at) * (at - mean_at);
    }
    if (spread <= 0 || made.mean <= 0) return made;
    made.per_hour = together / spread;
    made.rise = made.per_hour * (late.back().first - late.front().first) / made.mean;
    return made;
}

std::string say(const trend& found) {
    return fmt::format("{:.1f} on average in the second half, {:+.2f} per hour: {}", found.mean, found.per_hour,
                       found.flat() ? "flat" : "**growing**");
}

std::string meaning_of_flat() {
    return fmt::format("Per hour: the slope of the least-squares line through the second half. Flat: within that "
                       "half the line rises by at most "
                       "{:.0f} % of the average.",
                       trend::max_rise * 100);
}

bool holds(const account& of, const ledger::verdict& proof) {
    // A page on the real clock counts from its last start on; on the virtual one it has no archive and asks for all.
    bool page_whole = of.virtual_clock ? of.page.received == of.packets.size() : of.page.received > 0;
    // In a minute or two Iridium may honestly have brought nothing.
    bool all_links =
        of.plan.length < 10min || std::ranges::all_of(proof.links, [](const auto& one) { return one.owed > 0; });
    return proof.holds && late_executions(of).empty() && all_links && page_whole && of.page.duplicates == 0 &&
           of.page.malformed == 0 && std::ranges::all_of(of.consoles, &console_view::fix) && windows_hold(of);
}

std::string make_report(const account& of, const findings& found, const ledger::verdict& proof) {
    text out;
    out.line("# {} at sea, seed {}", voyage_text(of.plan.length), of.seed);
    out.line("\nFrom the bay of El Confital on the {} clock: the boat sailed T1 and then T2, {:.1f} km.",
             of.virtual_clock ? "virtual" : "real", of.sailed_m / 1000);
    out.line("The wind: {}.", of.wind);
    out.line("\n**{}**", holds(of, proof)
                             ? "The proof holds: no acknowledged packet is missing, and none was shown twice."
                             : "THE PROOF DOES NOT HOLD; see below.");
    say_links(out, of, proof);
    say_proof(out, of, proof);
    say_packets(out, found);
    say_gaps(out, of, found);
    say_commands(out, of);
    out.all += windows_text(of);
    say_troubles(out, of);
    say_samples(out, of);
    say_complaints(out, of);
    return std::move(out.all);
}

void write_file(const std::filesystem::path& file, std::string_view content) {
    std::ofstream out(file, std::ios::binary | std::ios::trunc);
    out << content;
    out.close();
    if (!out)
        throw std::runtime_error(
            fmt::format("cannot write {}: is the disk full, or the folder read-only?", file.string()));
}

} // namespace atirma::stress
