#include <ise/deployment/planning.hpp>

#include <ise/deployment/ordering.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <map>

namespace ise::deployment {
namespace {

using instantiation::instance_state;
using instantiation::instance_text;

bool is_over(const instance_text& one) { return one.state == instance_state::stopped || one.state == instance_state::failed; }

struct running {
    const host_state* on = nullptr;
    const instance_text* what = nullptr;
};

class planner {
public:
    planner(const deployment& wanted, const std::vector<host_state>& hosts) : wanted_(wanted) {
        for (const auto& host : hosts)
            for (const auto& one : host.instances) there_[one.path].push_back({&host, &one});
        std::vector<const type_text*> types;
        for (const auto& one : wanted.components) {
            const auto* state = state_of(wanted, one.host.text, hosts);
            states_.push_back(state);
            types.push_back(state ? state->type(one.type.text) : nullptr);
        }
        types_ = types;
        auto sorted = order_of(wanted, types);
        order_ = std::move(sorted.order);
        made_.problems = std::move(sorted.problems);
    }

    step_plan up() {
        for (const auto& [path, all] : there_)
            if (!is_wanted(path))
                for (const auto& one : all)
                    if (is_ours(*one.what)) stop(one, is_over(*one.what) ? "it is over, and not in the file any more" : "it is not in the file any more");
        for (auto which : order_) bring_up(wanted_.components[which], *states_[which], *types_[which]);
        if (!made_.problems.empty()) made_.steps.clear();
        return std::move(made_);
    }

    step_plan down() {
        for (const auto& [path, all] : there_)
            if (!is_wanted(path)) stop_all(all);
        // Whatever order they were started in: circles and unknown types are no reason to leave something running.
        for (std::size_t which = 0; which < wanted_.components.size(); ++which)
            if (std::ranges::find(order_, which) == order_.end()) order_.push_back(which);
        for (auto which = order_.rbegin(); which != order_.rend(); ++which)
            if (auto found = there_.find(wanted_.components[*which].request.path); found != there_.end()) stop_all(found->second);
        made_.problems.clear();
        return std::move(made_);
    }

private:
    bool is_ours(const instance_text& one) const { return one.deployment == wanted_.name.text; }
    bool is_wanted(const std::string& path) const {
        return std::ranges::any_of(wanted_.components, [&](const auto& one) { return one.request.path == path; });
    }

    void stop_all(const std::vector<running>& all) {
        for (const auto& one : all)
            if (is_ours(*one.what)) stop(one, is_over(*one.what) ? "it is over" : "");
    }

    void stop(const running& one, std::string reason) {
        step made;
        made.what = action::stop;
        made.path = one.what->path;
        made.server = one.on->server;
        made.reason = std::move(reason);
        made.alive = !is_over(*one.what);
        made_.steps.push_back(std::move(made));
    }

    void bring_up(const wanted_component& one, const host_state& on, const type_text& type) {
        const auto& path = one.request.path;
        const instance_text* here = nullptr;
        std::string from;
        for (const auto& other : there_[path]) {
            if (!is_ours(*other.what)) {
                if (is_over(*other.what)) continue; // its place is taken
                made_.problems.push_back({one.name.at, fmt::format("'{}' runs on {} already, {}: stop it first (ise stop {})", path, other.on->server,
                                                                   other.what->deployment.empty() ? "and was started by hand" : fmt::format("as a part of '{}'", other.what->deployment), path)});
                return;
            }
            if (other.on == &on) {
                here = other.what;
                continue;
            }
            if (!is_over(*other.what)) from = other.on->server;
            stop(other, is_over(*other.what) ? "it is over there" : fmt::format("it moves to {}", on.server));
        }
        if (here && !is_over(*here)) return adapt(one, on, type, *here);
        step made;
        made.what = action::start;
        made.path = path;
        made.server = on.server;
        made.request = one.request;
        if (!from.empty()) made.reason = fmt::format("it moves from {}", from);
        else if (here && here->state == instance_state::failed) made.reason = fmt::format("it has failed: {}", here->reason);
        else if (here) made.reason = "it was stopped";
        made_.steps.push_back(std::move(made));
    }

    void adapt(const wanted_component& one, const host_state& on, const type_text& type, const instance_text& here) {
        auto found = instantiation::differences(here, one.request, type);
        bool waits = here.state == instance_state::waiting; // whoever brings it up wants to know what is wrong with it
        if (found.empty() && !waits) {
            made_.kept.push_back(here.path);
            return;
        }
        step made;
        bool in_place = std::ranges::all_of(found, &instantiation::difference::in_place) && here.state == instance_state::ready;
        made.what = in_place ? action::change : action::restart;
        made.path = here.path;
        made.server = on.server;
        made.request = one.request;
        made.differences = std::move(found);
        if (waits) made.reason = fmt::format("it waits to be started again: {}", here.reason);
        made_.steps.push_back(std::move(made));
    }

    const deployment& wanted_;
    std::map<std::string, std::vector<running>> there_; // by path
    std::vector<const host_state*> states_;
    std::vector<const type_text*> types_;
    std::vector<std::size_t> order_;
    step_plan made_;
};

} // namespace

std::string_view name_of(action what) noexcept {
    switch (what) {
        case action::start: return "start";
        case action::change: return "change";
        case action::restart: return "restart";
        case action::stop: return "stop";
    }
    return "?";
}

step_plan plan_up(const deployment& wanted, const std::vector<host_state>& hosts) { return planner(wanted, hosts).up(); }

step_plan plan_down(const deployment& wanted, const std::vector<host_state>& hosts) { return planner(wanted, hosts).down(); }

std::string as_text(const step& of, bool whole) {
    auto text = fmt::format("{} {} on {}", name_of(of.what), of.path, of.server);
    if (!of.reason.empty()) text += fmt::format(" ({})", of.reason);
    if (!whole) return text;
    for (const auto& one : of.differences) {
        text += fmt::format("\n    {}", one.what);
        if (!one.is.empty() || !one.wanted.empty()) text += fmt::format(": {} -> {}", one.is.empty() ? "(none)" : one.is, one.wanted.empty() ? "(none)" : one.wanted);
        if (of.what == action::restart && !one.in_place) text += "  (takes a restart)";
    }
    return text;
}

} // namespace ise::deployment
