#include "findings.hpp"

#include "activity.hpp"
#include "text.hpp"

#include <ise/component/discover.hpp>
#include <ise/core/time_text.hpp>
#include <ise/packet/compatibility.hpp>
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
        for (const auto& report : one.health->cautions)
            add(severity_level::warning, "caution", report.message, report.advice);
        clock(one);
        traffic(*one.health, one.about->packets_dropped);
    }

    /// It was there at the first look, and is not at the second.
    void missed(const surveyed& then) {
        path_ = then.name.path;
        if (then.about)
            add(severity_level::note, "left", "it left during the inspection",
                "nothing, if it was stopped on purpose; ise ps shows it if a host had started it");
        else
            add(severity_level::error, "lost",
                fmt::format("it did not answer, and then its lease expired: {}", then.trouble),
                fmt::format("is {} stopped, swapped out or dead, or cut off from the name server? ise ps shows it if a "
                            "host had started it",
                            holder_of(then.name)));
    }

    std::vector<finding> take() { return std::move(found_); }

private:
    void add(severity_level severity, const char* kind, std::string message, std::string advice) {
        found_.push_back({severity, kind, path_, std::move(message), std::move(advice)});
    }

    void lease(const surveyed& one) {
        // It is renewed several times within its length.
        if (one.lease <= duration{} || one.name.lease_age <= one.lease / 3 * 2) return;
        add(severity_level::warning, "stale_lease",
            fmt::format("its lease of {} was not renewed for {}: it loses its name when the lease ends",
                        show_duration(one.lease), show_duration(one.name.lease_age)),
            fmt::format(
                "is {} alive, and does it reach the name server? A stopped or swapped-out process renews nothing",
                holder_of(one.name)));
    }

    void stalled(std::string message) {
        if (!stalled_.insert(path_).second) return;
        add(severity_level::error, "stalled", std::move(message),
            "run long computations and blocking calls by co_await offload(...); its log shows when it began; ise "
            "restart ends it if a host started it");
    }

    void silent(const surveyed& one) {
        if (one.why == errc::timed_out) {
            add(severity_level::error, "no_answer",
                fmt::format("it is registered, but did not answer: {}", one.trouble),
                fmt::format("is {} stopped, or its machine overloaded? --timeout waits for longer",
                            holder_of(one.name)));
            return;
        }
        if (has_unusable_policy(one.trouble)) {
            add(severity_level::error, "policy_unusable", one.trouble, policy_advice);
            return;
        }
        if (one.why == errc::access_denied) {
            add(severity_level::error, "access_denied", one.trouble,
                "the message has the command that names the rule; ise access list shows the policy of every component");
            return;
        }
        bool away = one.name.host_name != here_ && std::ranges::all_of(one.name.endpoints, is_near);
        add(severity_level::error, "unreachable", one.trouble,
            away ? fmt::format("it listens on addresses of {} only: start it with an endpoint that others reach "
                               "(--listen tcp://ADDRESS:PORT)",
                               one.name.host_name)
                 : fmt::format("is {} alive? If it has just ended, its name expires with its lease; otherwise check "
                               "routes and firewalls",
                               holder_of(one.name)));
    }

    void state(const component_info& about) {
        if (about.state != "ready")
            add(severity_level::warning, "not_ready", fmt::format("it is {}", about.state),
                "its log says what it waits for, or why it failed");
        if (about.epoch != 0 && !about.confirmed)
            add(severity_level::warning, "unconfirmed",
                "its lease could not be renewed: another component may be granted its name",
                "does its host reach the name server?");
    }

    void subscriptions(const component_info& about) {
        for (const auto& one : about.ended_subscriptions)
            add(severity_level::warning, "subscription_ended",
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
            add(severity_level::warning, "waits", wait_line(one), std::move(advice));
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
        add(severity_level::warning, "clock_skew",
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
            add(severity_level::warning, "drops_packets",
                fmt::format("it dropped {} packet{} within {} for subscribers that do not take them in time{}{}", more,
                            more == 1 ? "" : "s", show_duration(apart_), reasons(then, now, true), slow_readers(now)),
                "subscribe with a rate limit (--every), with --latest, or with a greater depth; ise describe shows its "
                "sessions");
        } else if (dropped > 0) {
            add(severity_level::note, "dropped_packets",
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
            add(severity_level::warning, busy ? "overloaded" : "refuses_calls",
                fmt::format("it refused {} call{} within {}: {}{}{}", more, more == 1 ? "" : "s", show_duration(apart_),
                            why, reasons(then, now, false), running(now)),
                busy ? "call less often or with longer deadlines, raise serve_options of the service, or offload what "
                       "computes; ise top shows its times"
                     : "its callers' errors tell which; ise describe shows what it provides, ise type diff what does "
                       "not fit");
        } else if (now.calls_refused > 0) {
            add(severity_level::note, "refused_calls",
                fmt::format("it has refused {} call{} since it began, and none now", now.calls_refused,
                            now.calls_refused == 1 ? "" : "s"),
                "nothing, unless the number grows: ise top");
        }
        for (const auto& one : now.sessions)
            if (one.unsent_bytes >= many_unsent_bytes)
                add(severity_level::warning, "slow_peer",
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
            for (const auto& [reason, count] : service.losses)
                if (service.publishes == publications && count.now > 0)
                    text +=
                        fmt::format("{}{} of '{}' ({})", text.empty() ? ": " : ", ", count.now, service.name, reason);
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

const service_info* provided_by(const surveyed& one, const service_info& wanted) {
    if (!one.about) return nullptr;
    for (const auto& service : one.about->services)
        if (service.provided && service.name == wanted.name && service.kind == wanted.kind) return &service;
    return nullptr;
}

bool talk(const surveyed& a, const surveyed& b) {
    auto sees = [](const surveyed& one, const surveyed& other) {
        return one.about && std::ranges::any_of(one.about->sessions, [&](const auto& session) {
                   return peer_of(session.peer).path == other.name.path;
               });
    };
    return sees(a, b) || sees(b, a);
}

// Who reads a packet: requests are read by the provider, everything else by who requires the service.
bool read_by_provider(service_kind kind, std::size_t place) {
    return kind == service_kind::request_response
               ? place == role::request
               : place == role::subscribe_request || place == role::unsubscribe_request;
}

void examine_one(const surveyed& needs, const service_info& wanted, const std::vector<surveyed>& all,
                 std::vector<finding>& found) {
    struct candidate {
        const surveyed* who;
        std::string why;
    };
    std::vector<candidate> misfits;
    std::vector<std::string> there;
    bool fits = false, unknown = false;
    for (const auto& one : all) {
        if (!one.about) unknown = true;
        if (&one == &needs) continue;
        const auto* provided = provided_by(one, wanted);
        if (!provided) continue;
        there.push_back(one.name.path);
        auto why = misfit(wanted, *provided);
        if (why.empty()) fits = true;
        else misfits.push_back({&one, std::move(why)});
    }
    const auto& path = needs.name.path;
    for (auto& one : misfits) {
        bool connected = talk(needs, *one.who);
        // Others may use the same name for something else: it matters between connected components, or if there is no
        // other provider.
        if (!connected && (fits || misfits.size() > 1)) continue;
        found.push_back({connected ? severity_level::error : severity_level::warning, "schema_mismatch", path,
                         fmt::format("'{}' as it needs it does not fit '{}' of {}:\n{}", wanted.name, wanted.name,
                                     one.who->name.path, one.why),
                         fmt::format("build both from the same header; what may change is in LAYOUT.md (fields are "
                                     "only appended). Compare: ise type diff {} {} {}",
                                     path, wanted.name, one.who->name.path)});
    }
    if (wanted.declared && there.empty() && !unknown) // undeclared ones are reported as waits
        found.push_back(
            {severity_level::warning, "no_provider", path,
             fmt::format("no component provides '{}', which it requires", wanted.name),
             "start the component that provides it (ise start --types), or does another name server know it?"});
}

} // namespace

std::string wait_line(const wait_info& of) {
    auto whom = of.service.empty() ? of.target : fmt::format("'{}' of {}", of.service, of.target);
    std::string what = fmt::format("it waits for {}", whom);
    if (of.stage == "unreached") what = fmt::format("its last call of {} reached no provider, and none has", whom);
    else if (!of.service.empty())
        what += of.stage == "provider" ? ", with which there is no session," : ", which is not found,";
    return fmt::format("{} since {} ({}){}{}", what, iso_8601(of.since), show_duration(of.waited),
                       of.cause.empty() ? "" : ": ", of.cause);
}

std::string_view name_of(severity_level of) noexcept {
    return of == severity_level::error ? "error" : of == severity_level::warning ? "warning" : "note";
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
    std::ranges::stable_sort(found, {}, [](const finding& one) { return std::tie(one.severity, one.component); });
    return found;
}

std::string misfit(const service_info& required, const service_info& provided) {
    auto mine = contract_of(required), theirs = contract_of(provided);
    if (!mine) return fmt::format("  it is not described readably: {}\n", mine.error().message());
    if (!theirs) return fmt::format("  it is not described readably: {}\n", theirs.error().message());
    std::string text;
    for (std::size_t place = 0; place < required.packets.size() && place < provided.packets.size(); ++place) {
        const auto& here = mine->packet(place);
        const auto& there = theirs->packet(place);
        auto why = read_by_provider(mine->kind(), place) ? incompatibility(there, here) : incompatibility(here, there);
        if (!why) continue;
        auto from = std::size_t{0};
        text += fmt::format("  {}\n", role::name(mine->kind(), place));
        while (from < why->size()) {
            auto to = std::min(why->find('\n', from), why->size());
            text += fmt::format("    {}\n", why->substr(from, to - from));
            from = to + 1;
        }
    }
    return text;
}

std::vector<finding> examine_services(const std::vector<surveyed>& now) {
    std::vector<finding> found;
    for (const auto& one : now) {
        if (!one.about) continue;
        for (const auto& service : one.about->services)
            if (!service.provided && !is_own_service(service.name)) examine_one(one, service, now, found);
    }
    return found;
}

} // namespace ise::cli
