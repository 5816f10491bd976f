#include "call_cycles.hpp"

#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <tuple>
#include <utility>

namespace ise::cli {
namespace {

constexpr duration brief = std::chrono::milliseconds(200); // calls that wait for less may just be slow to be shown

/// The handler of one call at one component.
struct handler_key {
    const surveyed* at = nullptr;
    std::string service, caller;
    std::uint64_t id = 0;
    auto operator<=>(const handler_key&) const = default;
};

struct wait_of_handler {
    const awaited_call_info* call = nullptr;
    const surveyed* provider = nullptr; // null: none that is known, so it may go on
    std::vector<handler_key> needs;     // the handler that runs the call; where it waits for one, all that run
    bool queued = false;
};

class call_graph {
public:
    explicit call_graph(const std::vector<surveyed>& all) {
        for (const auto& one : all)
            if (one.about)
                for (const auto& call : one.about->awaited)
                    if (call.waited >= brief)
                        waits_[{&one, call.handler, call.caller, call.caller_id}].push_back(wait_for(one, call, all));
    }

    std::vector<finding> cycles() {
        drop_those_that_go_on();
        std::vector<finding> found;
        std::set<handler_key> result;
        for (const auto& [handler, calls] : waits_) {
            std::vector<handler_key> way;
            auto at = handler;
            while (!result.contains(at) && std::ranges::find(way, at) == way.end()) {
                way.push_back(at);
                at = next_of(at)->needs.front();
            }
            const bool known = result.contains(at);
            result.insert(way.begin(), way.end());
            if (known) continue;
            way.erase(way.begin(), std::ranges::find(way, at)); // what only leads there
            found.push_back(told_as_finding(way));
        }
        return found;
    }

private:
    static wait_of_handler wait_for(const surveyed& from, const awaited_call_info& call,
                                    const std::vector<surveyed>& all) {
        wait_of_handler made;
        made.call = &call;
        const served_call_info* request = nullptr;
        for (const auto& one : all) {
            if (!one.about) continue;
            for (const auto& served : one.about->served) {
                if (served.id != call.id || served.service != call.service ||
                    peer_of(served.caller).path != from.name.path)
                    continue;
                const bool named = one.name.path == call.provider;
                if (request && !named) continue; // of a role or an address: the first that fits
                request = &served;
                made.provider = &one;
            }
        }
        if (!request) return made;
        made.queued = !request->running;
        if (request->running) made.needs.push_back({made.provider, request->service, request->caller, request->id});
        else
            for (const auto& other : made.provider->about->served)
                if (other.running && other.service == request->service)
                    made.needs.push_back({made.provider, other.service, other.caller, other.id});
        return made;
    }

    // A handler is stuck while one of its calls is: one whose handler is stuck, or that waits for a handler where all
    // are. What remains when no more goes on holds itself up.
    bool stuck(const wait_of_handler& wait) const {
        return !wait.needs.empty() &&
               std::ranges::all_of(wait.needs, [&](const handler_key& one) { return waits_.contains(one); });
    }
    const wait_of_handler* next_of(const handler_key& of) const {
        const auto& calls = waits_.at(of);
        auto found = std::ranges::find_if(calls, [&](const auto& one) { return stuck(one); });
        return found == calls.end() ? nullptr : &*found;
    }
    void drop_those_that_go_on() {
        for (bool changed = true; changed;)
            changed = std::erase_if(waits_, [&](const auto& one) { return !next_of(one.first); }) > 0;
    }

    finding told_as_finding(const std::vector<handler_key>& way) const {
        finding made;
        made.kind = "call_cycle";
        made.component =
            std::ranges::min(way, {}, [](const handler_key& one) { return one.at->name.path; }).at->name.path;
        made.message = "calls wait for one another in a cycle, and none of them can go on:\n";
        for (const auto& one : way) {
            const auto& wait = *next_of(one);
            made.message +=
                fmt::format("  the handler of '{}' at {}{} waits for '{}' of {} ({}){}\n", one.service,
                            one.at->name.path, wait.call->where.empty() ? "" : fmt::format(", {},", wait.call->where),
                            wait.call->service, wait.provider->name.path, show_duration(wait.call->waited),
                            wait.queued ? ", where all handlers are busy" : "");
        }
        made.advice =
            "end the cycle: let one of these handlers answer before it calls the other, or provide its service by "
            "`provide`, which runs several at once, in place of `provide_exclusive`; until then the calls end "
            "by their deadlines";
        return made;
    }

    std::map<handler_key, std::vector<wait_of_handler>> waits_;
};

} // namespace

std::vector<finding> examine_calls(const std::vector<surveyed>& now) { return call_graph(now).cycles(); }

} // namespace ise::cli
