#include "findings.hpp"

#include "service_activity.hpp"
#include "text.hpp"
#include "waits.hpp"

#include <ise/service/use_book.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <set>

namespace ise::cli {
namespace {

using namespace std::chrono_literals;

constexpr duration tolerated_skew = 100ms;
constexpr std::uint64_t many_unsent_bytes = 1 << 20;

std::string holder_of(const naming::listed_name& name) {
    return fmt::format("process {} on {}", name.process_id, name.host_name);
}

// Only from its own host.
bool is_near(const std::string& endpoint) {
    return endpoint.starts_with("inproc:") || endpoint.starts_with("local:") ||
           endpoint.find("://127.") != endpoint.npos || endpoint.find("://[::1]") != endpoint.npos;
}

class examination {
    using before_life = std::map<std::uint64_t, const health_report*>::const_iterator;

public:
    examination(const std::vector<surveyed>& before, duration apart, const std::string& here)
        : apart_(apart), here_(here) {
        for (const auto& one : before)
            if (one.health) before_[one.health->incarnation] = &*one.health;
    }

    void look_at(const surveyed& one) {
        path_ = one.name.path;
        lease(one);
        if (one.name.state == "stalled")
            stalled(fmt::format("it is stalled: its thread does not come back to its loop ({})", holder_of(one.name)));
        else if (!one.about) silent(one);
        if (!one.about) return;
        state(*one.about);
        sessions(*one.about);
        subscriptions(*one.about);
        waits(*one.about);
        if (!one.health) return;
        clock(one);
        traffic(*one.health, one.about->packets_dropped);
    }

    /// It was there at the first look, and is not at the second.
    void missed(const surveyed& then) {
        path_ = then.name.path;
        if (then.about)
            add(severity::note, "left", "it left during the inspection",
                "nothing, if it was stopped on purpose; ise ps shows it if a host had started it");
        else
            add(severity::error, "lost", fmt::format("it did not answer, and then its lease expired: {}", then.trouble),
                fmt::format("is {} stopped, swapped out or dead, or cut off from the name server? ise ps shows it if a "
                            "host had started it",
                            holder_of(then.name)));
    }

    std::vector<finding> take() { return std::move(found_); }

private:
    void add(severity weight, const char* kind, std::string message, std::string advice) {
        found_.push_back({weight, kind, path_, std::move(message), std::move(advice)});
    }

    void lease(const surveyed& one) {
        // It is renewed several times within its length.
        if (one.lease <= duration{} || one.name.lease_age <= one.lease / 3 * 2) return;
        add(severity::warning, "stale_lease",
            fmt::format("its lease of {} was not renewed for {}: it loses its name when the lease ends",
                        show_duration(one.lease), show_duration(one.name.lease_age)),
            fmt::format(
                "is {} alive, and does it reach the name server? A stopped or swapped-out process renews nothing",
                holder_of(one.name)));
    }

    void stalled(std::string message) {
        if (!stalled_.insert(path_).second) return;
        add(severity::error, "stalled", std::move(message),
            "run long computations and blocking calls by co_await offload(...); its log shows when it began; ise "
            "restart ends it if a host started it");
    }

    void silent(const surveyed& one) {
        if (one.why == errc::timed_out) {
            add(severity::error, "no_answer", fmt::format("it is registered, but did not answer: {}", one.trouble),
                fmt::format("is {} stopped, or its machine overloaded? --timeout waits for longer",
                            holder_of(one.name)));
            return;
        }
        bool away = one.name.host_name != here_ && std::ranges::all_of(one.name.endpoints, is_near);
        add(severity::error, "unreachable", one.trouble,
            away ? fmt::format("it listens on addresses of {} only: start it with an endpoint that others reach "
                               "(--listen tcp://ADDRESS:PORT)",
                               one.name.host_name)
                 : fmt::format("is {} alive? If it has just ended, its name expires with its lease; otherwise check "
                               "routes and firewalls",
                               holder_of(one.name)));
    }

    void state(const component_info& about) {
        if (about.state != "ready")
            add(severity::warning, "not_ready", fmt::format("it is {}", about.state),
                "its log says what it waits for, or why it failed");
        if (about.epoch != 0 && !about.confirmed)
            add(severity::warning, "unconfirmed",
                "its lease could not be renewed: another component may be granted its name",
                "does its host reach the name server?");
    }

    void subscriptions(const component_info& about) {
        for (const auto& one : about.ended_subscriptions)
            add(severity::warning, "subscription_ended",
                fmt::format("its subscription to '{}' of {} has ended, and was not made again: {}", one.service,
                            one.provider, one.cause),
                "subscribe with a greater depth, take packets sooner, or accept losses (last, latest); subscribing "
                "again continues");
    }

    // Others may wait for a moment while it begins.
    void waits(const component_info& about) {
        for (const auto& one : about.waits) {
            if (one.waited < use_book::patience) continue;
            auto advice = one.stage == "name"
                              ? fmt::format("start the component that holds or serves '{}' (ise start --types); if "
                                            "that name is wrong, correct it: ise list shows the others",
                                            one.target)
                          : one.stage == "provider"
                              ? fmt::format("is it alive, and reached from {}? ise ping {} tries it from here",
                                            about.host_name, one.target)
                              : std::string("its log shows how it continued; ise list shows all components");
            add(severity::warning, "waits", wait_line(one), std::move(advice));
        }
    }

    void sessions(const component_info& about) {
        for (const auto& one : about.sessions) {
            auto peer = peer_of(one.peer);
            if (!one.peer_stalled || peer.path.empty()) continue;
            auto mine = std::exchange(path_, peer.path);
            stalled(fmt::format("it is stalled, as {} reports: its node answers in its place", about.path));
            path_ = mine;
        }
    }

    // All components of a host have its clock.
    void clock(const surveyed& one) {
        auto off = one.clock_ahead < duration{} ? -one.clock_ahead : one.clock_ahead;
        if (off <= tolerated_skew + one.clock_doubt || !skewed_.insert(one.name.host_name).second) return;
        add(severity::warning, "clock_skew",
            fmt::format("the clock of its host {} is {} {} this machine's (within {})", one.name.host_name,
                        show_duration(off), one.clock_ahead > duration{} ? "ahead of" : "behind",
                        show_duration(one.clock_doubt)),
            "let both machines set their clocks by NTP (timedatectl set-ntp true): times in packets cannot be "
            "compared");
    }

    void traffic(const health_report& now, std::uint64_t dropped) {
        before_life then = before_.find(now.incarnation);
        auto grown = [&](std::uint64_t health_report::*count) {
            return then == before_.end() ? 0 : now.*count - std::min(now.*count, then->second->*count);
        };
        if (auto more = grown(&health_report::packets_dropped); more > 0) {
            add(severity::warning, "drops_packets",
                fmt::format("it dropped {} packet{} within {} for subscribers that do not take them in time{}{}", more,
                            more == 1 ? "" : "s", show_duration(apart_), reasons(then, now, true), slow_readers(now)),
                "subscribe with a rate limit (--every), with --latest, or with a greater depth; ise describe shows its "
                "sessions");
        } else if (dropped > 0) {
            add(severity::note, "dropped_packets",
                fmt::format("it has dropped {} packet{} since it began, and none now", dropped,
                            dropped == 1 ? "" : "s"),
                "nothing, unless the number grows: ise top");
        }
        if (auto more = grown(&health_report::calls_refused); more > 0) {
            auto beyond = grown(&health_report::calls_overloaded), late = grown(&health_report::calls_expired);
            std::string why;
            auto tell = [&](std::uint64_t count, const char* what) {
                if (count > 0) why += fmt::format("{}{} {}", why.empty() ? "" : ", ", count, what);
            };
            tell(beyond, "beyond its limits");
            tell(late, "too late to begin");
            tell(more - std::min(more, beyond + late), "unknown, of packets that do not fit, or not kept any more");
            bool busy = beyond + late > 0;
            add(severity::warning, busy ? "overloaded" : "refuses_calls",
                fmt::format("it refused {} call{} within {}: {}{}{}", more, more == 1 ? "" : "s", show_duration(apart_),
                            why, reasons(then, now, false), running(now)),
                busy ? "call less often or with longer deadlines, raise serve_options of the service, or offload what "
                       "computes; ise top shows its times"
                     : "its callers' errors tell which; ise describe shows what it provides, ise type diff what does "
                       "not fit");
        } else if (now.calls_refused > 0) {
            add(severity::note, "refused_calls",
                fmt::format("it has refused {} call{} since it began, and none now", now.calls_refused,
                            now.calls_refused == 1 ? "" : "s"),
                "nothing, unless the number grows: ise top");
        }
        for (const auto& one : now.sessions)
            if (one.unsent_bytes >= many_unsent_bytes)
                add(severity::warning, "slow_peer",
                    fmt::format("{} wait to be sent to {}", show_bytes(one.unsent_bytes), one.peer),
                    "the link is slow, or the peer does not read: is it busy?");
    }

    static std::string running(const health_report& now) {
        std::string text;
        for (const auto& one : now.services)
            if (one.running > 0 && !is_own_service(one.name))
                text += fmt::format("{}{} of '{}' ({} waiting)", text.empty() ? "; now running: " : ", ", one.running,
                                    one.name, one.waiting);
        return text;
    }

    // ": 12 of 'samples' (replaced)"
    std::string reasons(before_life then, const health_report& now, bool publications) const {
        std::string text;
        if (then == before_.end()) return text;
        for (const auto& service : service_activities(*then->second, now, 1))
            for (const auto& loss : service.losses)
                if (service.publishes == publications && loss.meanwhile > 0)
                    text += fmt::format("{}{} of '{}' ({})", text.empty() ? ": " : ", ", loss.meanwhile, service.name,
                                        loss.reason);
        return text;
    }

    static std::string slow_readers(const health_report& now) {
        std::string text;
        for (const auto& one : now.sessions)
            if (one.unsent_bytes > 0) text += fmt::format("{} {}", text.empty() ? ": bytes wait for" : ",", one.peer);
        return text;
    }

    duration apart_;
    const std::string& here_;
    std::string path_;
    std::map<std::uint64_t, const health_report*> before_; // by life
    std::set<std::string> skewed_, stalled_;
    std::vector<finding> found_;
};

} // namespace

std::string_view name_of(severity of) noexcept {
    return of == severity::error ? "error" : of == severity::warning ? "warning" : "note";
}

std::vector<finding> examine(const std::vector<surveyed>& before, const std::vector<surveyed>& now, duration apart,
                             const std::string& here) {
    examination looks(before, apart, here);
    for (const auto& one : now) looks.look_at(one);
    for (const auto& one : before)
        if (std::ranges::none_of(now, [&](const surveyed& other) { return other.name.path == one.name.path; }))
            looks.missed(one);
    auto found = looks.take();
    auto services = examine_services(now);
    found.insert(found.end(), std::make_move_iterator(services.begin()), std::make_move_iterator(services.end()));
    std::ranges::stable_sort(found, {}, [](const finding& one) { return std::tie(one.weight, one.component); });
    return found;
}

} // namespace ise::cli
