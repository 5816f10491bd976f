#include <ise/deployment/planning.hpp>

#include <ise/component/nearest.hpp>
#include <ise/deployment/ordering.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>

namespace ise::deployment {
namespace {

using instantiation::instance_info;
using instantiation::instance_state;

bool is_over(const instance_info& one) {
    return one.state == instance_state::stopped || one.state == instance_state::failed;
}

struct running {
    const host_state* on = nullptr;
    const instance_info* what = nullptr;
};

using steps = std::vector<std::size_t>; // by number

class planner {
public:
    planner(const deployment& wanted, const std::vector<host_state>& hosts, const std::vector<std::string>& only)
        : wanted_(wanted), last_(wanted.components.size()), chosen_(wanted.components.size(), only.empty()),
          all_(only.empty()) {
        for (const auto& host : hosts)
            for (const auto& one : host.instances) there_[one.path].push_back({&host, &one});
        std::vector<const type_info*> types;
        for (const auto& one : wanted.components) {
            const auto* state = state_of(wanted, one.host.text, hosts);
            states_.push_back(state);
            types.push_back(state ? state->type(one.type.text) : nullptr);
        }
        types_ = types;
        auto sorted = order_of(wanted, types);
        order_ = std::move(sorted.order);
        before_ = std::move(sorted.before);
        made_.problems = std::move(sorted.problems);
        for (const auto& name : only) choose(name);
    }

    step_plan up() {
        if (all_)
            for (const auto& [path, all] : there_)
                if (!is_wanted(path))
                    for (const auto& one : all)
                        if (is_ours(*one.what))
                            stop(one, is_over(*one.what) ? "it is over, and not in the file any more"
                                                         : "it is not in the file any more");
        first_ = made_.steps.size();
        for (auto which = order_.rbegin(); which != order_.rend(); ++which) // those that they come after, too
            if (chosen_[*which])
                for (auto earlier : before_[*which]) chosen_[earlier] = true;
        for (auto which : order_) {
            after_ = those_before(before_[which]);
            auto count = made_.steps.size();
            if (chosen_[which]) bring_up(wanted_.components[which], *states_[which], *types_[which]);
            last_[which] = made_.steps.size() > count ? steps{made_.steps.size() - 1} : after_;
        }
        for (const auto& one : made_.steps) object_to(one);
        if (!made_.problems.empty()) made_.steps.clear();
        return std::move(made_);
    }

    step_plan down() {
        if (all_)
            for (const auto& [path, all] : there_)
                if (!is_wanted(path)) stop_all(all);
        first_ = made_.steps.size();
        // Whatever order they were started in: circles and unknown types are no reason to leave something running.
        for (std::size_t which = 0; which < wanted_.components.size(); ++which)
            if (std::ranges::find(order_, which) == order_.end()) order_.push_back(which);
        for (auto which = order_.rbegin(); which != order_.rend(); ++which) {
            steps later; // those that come after it end before it
            for (std::size_t other = 0; other < before_.size(); ++other)
                if (std::ranges::find(before_[other], *which) != before_[other].end()) later.push_back(other);
            after_ = those_before(later);
            auto count = made_.steps.size();
            auto found = there_.find(wanted_.components[*which].request.path);
            if (chosen_[*which] && found != there_.end()) stop_all(found->second);
            last_[*which] = after_;
            if (made_.steps.size() > count) last_[*which].clear();
            for (; count < made_.steps.size(); ++count) last_[*which].push_back(count);
        }
        std::erase_if(made_.problems, [&](const problem& one) { return !is_unknown(one); });
        return std::move(made_);
    }

private:
    void choose(const std::string& name) {
        for (std::size_t which = 0; which < wanted_.components.size(); ++which) {
            const auto& one = wanted_.components[which];
            if (one.name.text != name && one.request.path != name) continue;
            chosen_[which] = true;
            return;
        }
        std::vector<std::string> names;
        for (const auto& one : wanted_.components) names.push_back(one.name.text);
        auto near = nearest(name, names);
        unknown_.push_back(fmt::format("there is no component '{}' in it; {}", name.substr(0, 200),
                                       near.empty() ? fmt::format("there are {}", fmt::join(names, ", "))
                                                    : fmt::format("did you mean '{}'?", near.front())));
        made_.problems.push_back({wanted_.name.at, unknown_.back()});
    }
    /// What the host has against a step.
    void object_to(const step& of) {
        auto which = std::ranges::find(wanted_.components, of.path, [](const auto& one) { return one.request.path; });
        if (of.what == action::stop || which == wanted_.components.end()) return;
        const auto* state = states_[static_cast<std::size_t>(which - wanted_.components.begin())];
        auto found = state->checked.find(of.path);
        if (found == state->checked.end() || found->second.outcome == instantiation::start_outcome::ready) return;
        // Its name is held by what is stopped before.
        bool stops = std::ranges::any_of(made_.steps, [&](const step& other) {
            return other.what == action::stop && other.path == of.path && other.alive;
        });
        if (stops && found->second.outcome == instantiation::start_outcome::name_taken) return;
        made_.problems.push_back({which->name.at, found->second.why});
    }
    bool is_unknown(const problem& one) const { return std::ranges::find(unknown_, one.what) != unknown_.end(); }

    /// The steps that have to be done before one of a component which comes after these.
    steps those_before(const steps& components) const {
        steps all;
        for (std::size_t number = 0; number < first_; ++number) all.push_back(number);
        for (auto one : components) all.insert(all.end(), last_[one].begin(), last_[one].end());
        std::ranges::sort(all);
        all.erase(std::unique(all.begin(), all.end()), all.end());
        return all;
    }

    bool is_ours(const instance_info& one) const { return one.deployment == wanted_.name.text; }
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
        made.after = after_;
        made_.steps.push_back(std::move(made));
    }

    void bring_up(const wanted_component& one, const host_state& on, const type_info& type) {
        auto count = made_.steps.size();
        const auto& path = one.request.path;
        const instance_info* here = nullptr;
        std::string from;
        for (const auto& other : there_[path]) {
            if (!is_ours(*other.what)) {
                if (is_over(*other.what)) continue; // its place is taken
                made_.problems.push_back(
                    {one.name.at,
                     fmt::format("'{}' runs on {} already, {}: stop it first (ise stop {})", path, other.on->server,
                                 other.what->deployment.empty()
                                     ? "and was started by hand"
                                     : fmt::format("as a part of '{}'", other.what->deployment),
                                 path)});
                return;
            }
            if (other.on == &on) {
                here = other.what;
                continue;
            }
            if (!is_over(*other.what)) from = other.on->server;
            stop(other, is_over(*other.what) ? "it is over there" : fmt::format("it moves to {}", on.server));
        }
        for (; count < made_.steps.size(); ++count) after_.push_back(count); // where it ran
        if (here && !is_over(*here)) return adapt(one, on, type, *here);
        step made;
        made.what = action::start;
        made.path = path;
        made.server = on.server;
        made.request = one.request;
        made.after = after_;
        if (!from.empty()) made.reason = fmt::format("it moves from {}", from);
        else if (here && here->state == instance_state::failed)
            made.reason = fmt::format("it has failed: {}", here->reason);
        else if (here) made.reason = "it was stopped";
        made_.steps.push_back(std::move(made));
    }

    void adapt(const wanted_component& one, const host_state& on, const type_info& type, const instance_info& here) {
        auto checked = on.checked.find(here.path);
        auto found = instantiation::differences(here, one.request, type,
                                                checked != on.checked.end() && checked->second.other_environment);
        bool waits = here.state == instance_state::waiting; // whoever brings it up wants to know what is wrong with it
        if (found.empty() && !waits) {
            made_.kept.push_back(here.path);
            return;
        }
        step made;
        bool in_place =
            std::ranges::all_of(found, &instantiation::difference::in_place) && here.state == instance_state::ready;
        made.what = in_place ? action::change : action::restart;
        made.path = here.path;
        made.server = on.server;
        made.request = one.request;
        made.differences = std::move(found);
        made.after = after_;
        if (waits) made.reason = fmt::format("it waits to be started again: {}", here.reason);
        made_.steps.push_back(std::move(made));
    }

    const deployment& wanted_;
    std::map<std::string, std::vector<running>> there_; // by path
    std::vector<const host_state*> states_;
    std::vector<const type_info*> types_;
    std::vector<std::size_t> order_;
    std::vector<steps> before_; // of each component others
    std::vector<steps> last_;   // of each component the steps after which it is as it should be
    std::vector<bool> chosen_;
    bool all_;              // of the file, and of what it does not know any more
    std::size_t first_ = 0; // steps that come before all others
    steps after_;           // of what is planned now
    std::vector<std::string> unknown_;
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

step_plan plan_up(const deployment& wanted, const std::vector<host_state>& hosts,
                  const std::vector<std::string>& only) {
    return planner(wanted, hosts, only).up();
}

step_plan plan_down(const deployment& wanted, const std::vector<host_state>& hosts,
                    const std::vector<std::string>& only) {
    return planner(wanted, hosts, only).down();
}

std::string as_text(const step& of, bool whole) {
    auto text = fmt::format("{} {} on {}", name_of(of.what), of.path, of.server);
    if (!of.reason.empty()) text += fmt::format(" ({})", of.reason);
    if (!whole) return text;
    for (const auto& one : of.differences) {
        text += fmt::format("\n    {}", one.what);
        if (!one.is.empty() || !one.wanted.empty())
            text += fmt::format(": {} -> {}", one.is.empty() ? "(none)" : one.is,
                                one.wanted.empty() ? "(none)" : one.wanted);
        if (of.what == action::restart && !one.in_place) text += "  (takes a restart)";
    }
    return text;
}

} // namespace ise::deployment
