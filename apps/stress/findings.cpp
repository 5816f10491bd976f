#include "findings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace atirma::stress {
namespace {

using namespace std::chrono_literals;

constexpr ise::duration track_silence = 20s;
constexpr ise::duration slack = 45s; // by which a silence may begin or end beside its cause

std::string cause_of(const std::vector<episode>& all, std::optional<link_id> link, ise::duration from,
                     ise::duration until) {
    std::set<std::string> causes;
    for (const auto& one : all) {
        if (!one.everywhere && (link ? one.link != link : !one.link)) continue;
        auto end = one.until < one.from ? ise::duration::max() : one.until + slack;
        if (one.from <= until && end >= from) causes.insert(one.what);
    }
    std::string text;
    for (const auto& one : causes) text += (text.empty() ? "" : "; ") + one;
    return text;
}

// Where no fault explains a silence of Iridium: what the boat's modem said of its sessions meanwhile.
std::string cause_by_sessions(const account& of, ise::duration from, ise::duration until) {
    std::size_t failed = 0, arrived = 0;
    for (const auto& one : of.sessions)
        if (one.from <= until && one.until >= from) ++(one.arrived ? arrived : failed);
    if (failed > 0) return fmt::format("{} session{} broke off", failed, failed == 1 ? "" : "s");
    // The session that brought the last packet before is not among them.
    if (arrived > 1) return "its packets were still on the way to the shore";
    return "the boat began no session";
}

} // namespace

std::map<std::string, std::uint64_t> findings::causes_of(const account& of, const std::vector<ledger::entry>& lost,
                                                         link_id link) {
    std::map<std::string, std::uint64_t> made;
    for (const auto& one : lost) {
        if (one.link != link) continue;
        auto cause = cause_of(of.episodes, link, one.sent, one.sent);
        if (cause.empty() && one.sent >= of.plan.length - silence_of(link, of.plan)) cause = "sent at the end";
        auto broke_off = [&](const ledger::iridium_session& session) {
            return !session.arrived && session.until >= one.sent;
        };
        if (cause.empty() && link == link_id::iridium && !one.heard() && std::ranges::any_of(of.sessions, broke_off))
            cause = "its session broke off";
        if (cause.empty())
            cause = one.heard() ? "lost on shore, cause unknown" : "never received on shore, cause unknown";
        ++made[cause];
    }
    return made;
}

ise::duration findings::silence_of(link_id link, const voyage_plan& script) {
    if (link == link_id::xbee) return 30s;
    if (link == link_id::gprs) return 60s;
    return std::chrono::milliseconds(static_cast<std::int64_t>(script.iridium_period_s * 2500));
}

findings::findings(const account& of) {
    const auto begin = std::chrono::floor<std::chrono::milliseconds>(of.began);
    std::array<std::vector<ise::duration>, link_count> arrivals;
    for (const auto& packet : of.packets) {
        auto link = static_cast<std::size_t>(packet.link) % link_count;
        auto message = parse_telemetry(packet.raw);
        if (!message) continue;
        ++by_type[link][std::string(name_of(message->body))];
        history[link] += packet.history;
        arrivals[link].push_back(packet.received_at - begin);
        const auto* at = std::get_if<location>(&message->body);
        if (!at || at->quality == fix_quality::none) continue;
        track.push_back({packet.measured_at, at->latitude_deg, at->longitude_deg, packet.link, packet.history});
    }
    const auto end = of.plan.length;
    for (std::size_t i = 0; i < link_count; ++i) {
        auto& times = arrivals[i];
        std::ranges::sort(times);
        const auto link = static_cast<link_id>(i);
        const auto silence = silence_of(link, of.plan);
        auto last = ise::duration(0);
        auto since = times.empty() ? ise::duration(0) : times.front();
        auto look = [&](ise::duration at) {
            if (at - last <= silence) return;
            auto cause = cause_of(of.episodes, link, last, at);
            if (cause.empty() && link == link_id::iridium) cause = cause_by_sessions(of, last, at);
            if (cause.empty() && times.empty()) cause = "nothing ever came over it";
            gaps[i].push_back({last, at, std::move(cause)});
            if (last > since) heard[i].push_back({since, last});
            since = at;
        };
        for (auto at : times) {
            if (at > end) break;
            look(at);
            last = at;
        }
        look(end);
        if (last > since) heard[i].push_back({since, last});
    }
    const fix* before = nullptr;
    for (const auto& one : track) {
        auto at = one.at - begin;
        auto last = before ? ise::duration(before->at - begin) : ise::duration(0);
        if (at - last > track_silence && at <= end)
            track_gaps.push_back({last, at, cause_of(of.episodes, std::nullopt, last, at)});
        before = &one;
    }
}

std::string clock_text(ise::duration since_start) {
    auto s = std::chrono::floor<std::chrono::seconds>(since_start).count();
    return fmt::format("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
}

std::string length_text(ise::duration length) {
    auto ms = std::chrono::floor<std::chrono::milliseconds>(length).count();
    if (ms < 1000) return fmt::format("{} ms", ms);
    if (ms < 60'000) return fmt::format("{}.{} s", ms / 1000, ms / 100 % 10);
    if (ms < 3'600'000) return fmt::format("{}:{:02} min", ms / 60'000, ms / 1000 % 60);
    return fmt::format("{}:{:02}:{:02} h", ms / 3'600'000, ms / 60'000 % 60, ms / 1000 % 60);
}

std::string counted(std::uint64_t count, std::string_view one) {
    return fmt::format("{} {}{}", count, one, count == 1 ? "" : "s");
}

std::string voyage_text(ise::duration length) {
    auto minutes = static_cast<std::uint64_t>(std::chrono::round<std::chrono::minutes>(length).count());
    if (minutes < 60) return counted(minutes, "minute");
    if (minutes % 60 == 0) return counted(minutes / 60, "hour");
    return counted(minutes / 60, "hour") + " " + counted(minutes % 60, "minute");
}

} // namespace atirma::stress
