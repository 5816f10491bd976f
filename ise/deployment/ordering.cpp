#include <ise/deployment/ordering.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

namespace ise::deployment {
namespace {

/// Who comes before whom.
class graph {
public:
    explicit graph(const deployment& of) : of_(of), before_(of.components.size()) {}

    void add(std::size_t first, std::size_t then) { before_[then].insert(first); }

    /// Whether `then` comes after `first`, by what was added so far.
    bool reaches(std::size_t first, std::size_t then) const {
        std::vector<bool> seen(before_.size(), false);
        std::vector<std::size_t> left{then};
        while (!left.empty()) {
            auto at = left.back();
            left.pop_back();
            for (auto earlier : before_[at]) {
                if (earlier == first) return true;
                if (!seen[earlier]) left.push_back(earlier);
                seen[earlier] = true;
            }
        }
        return false;
    }

    ordering sorted() const {
        ordering made;
        std::vector<bool> placed(before_.size(), false);
        auto ready = [&](std::size_t which) {
            return std::ranges::all_of(before_[which], [&](auto first) { return placed[first]; });
        };
        for (;;) {
            std::size_t next = 0;
            while (next < before_.size() && (placed[next] || !ready(next))) ++next;
            if (next == before_.size()) break;
            placed[next] = true;
            made.order.push_back(next);
        }
        made.before.resize(before_.size());
        for (std::size_t then = 0; then < before_.size(); ++then)
            made.before[then].assign(before_[then].begin(), before_[then].end());
        if (made.order.size() < before_.size()) made.problems.push_back(circle(placed));
        return made;
    }

private:
    problem circle(const std::vector<bool>& placed) const {
        std::size_t at = 0;
        while (placed[at]) ++at;
        std::vector<std::size_t> way;
        while (std::ranges::find(way, at) == way.end()) {
            way.push_back(at);
            at = *std::ranges::find_if(before_[at], [&](auto earlier) { return !placed[earlier]; });
        }
        way.erase(way.begin(), std::ranges::find(way, at));
        std::vector<std::string> reasons;
        for (std::size_t step = 0; step < way.size(); ++step)
            reasons.push_back(
                fmt::format("'{}' comes after '{}'", name(way[step]), name(way[(step + 1) % way.size()])));
        return {of_.components[way.front()].name.at,
                fmt::format("components wait for each other: {}", fmt::join(reasons, ", "))};
    }
    const std::string& name(std::size_t which) const { return of_.components[which].name.text; }

    const deployment& of_;
    std::vector<std::set<std::size_t>> before_; // of each: who
};

} // namespace

ordering order_of(const deployment& of, const std::vector<const type_info*>& types) {
    graph all(of);
    const auto& components = of.components;
    for (std::size_t then = 0; then < components.size(); ++then)
        if (components[then].after)
            for (const auto& one : *components[then].after)
                if (auto first = of.component(one.text)) all.add(*first, then);
    for (std::size_t then = 0; then < components.size(); ++then) {
        if (components[then].after || !types[then]) continue;
        for (const auto& wanted : types[then]->services) {
            if (wanted.provided) continue;
            for (std::size_t first = 0; first < components.size(); ++first) {
                // A circle is no matter: who is started first waits.
                if (first == then || !types[first] || all.reaches(then, first)) continue;
                if (types[first]->name == types[then]->name) continue; // equals, such as two that back each other
                bool provides = std::ranges::any_of(
                    types[first]->services, [&](const auto& one) { return one.provided && one.name == wanted.name; });
                if (provides) all.add(first, then);
            }
        }
    }
    return all.sorted();
}

} // namespace ise::deployment
