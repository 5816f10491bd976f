#include <ise/service/role_choice.hpp>

#include <algorithm>

namespace ise {
namespace {

constexpr duration min_pause = std::chrono::seconds(1);

} // namespace

role_options role_options::no_failback() noexcept {
    role_options made;
    made.failback = false;
    return made;
}

role_options role_options::failback_after(duration delay) noexcept {
    role_options made;
    made.failback_delay = delay;
    return made;
}

bool role_choice::outranks(const location& a, const location& b) noexcept {
    return a.ready != b.ready ? a.ready : a.priority > b.priority;
}

void role_choice::know(std::vector<location> members, time_point now) {
    members_ = std::move(members);
    std::map<std::string, presence> present;
    for (const auto& one : members_) {
        auto before = present_.find(one.path);
        bool same = before != present_.end() && before->second.incarnation == one.incarnation &&
                    before->second.ready == one.ready;
        auto& here = present[one.path];
        if (same) here = before->second;
        else here.since = now;
        here.incarnation = one.incarnation;
        here.ready = one.ready;
        if (!taken_ || taken_->path != one.path) continue;
        taken_ = one;
        left_ = false; // it has come back
    }
    // One that is not told of any more keeps its rank: its session lives, perhaps only its lease did not.
    present_ = std::move(present);
}

std::vector<location> role_choice::candidates() const {
    auto order = members_;
    auto last = std::ranges::find(order, lost_, &location::path);
    if (last == order.end()) return order;
    if (in_doubt_) {
        std::rotate(last, last + 1, order.end());
    } else {
        std::rotate(order.begin(), last, last + 1);
    }
    return order;
}

void role_choice::took(const location& which) {
    taken_ = which;
    lost_.clear();
    in_doubt_ = left_ = false;
}

std::optional<location> role_choice::unlisted() const {
    if (!taken_ || left_ || std::ranges::find(members_, taken_->path, &location::path) != members_.end())
        return std::nullopt;
    return taken_;
}

void role_choice::left(const location& which) {
    auto now = unlisted();
    left_ = now && now->path == which.path && now->incarnation == which.incarnation;
}

void role_choice::lost(bool in_doubt) {
    if (!taken_) return;
    lost_ = taken_->path;
    in_doubt_ = in_doubt;
    left_ = false;
    taken_.reset();
}

std::optional<role_choice::change> role_choice::better(bool bound) const {
    if (!taken_) return std::nullopt;
    auto open_from = [this](const location& one) { return present_.at(one.path).not_before; };
    if (left_) {
        if (members_.empty()) return std::nullopt;
        auto next = std::ranges::min_element(members_, {}, open_from);
        return change{*next, open_from(*next)};
    }
    if (!how_.failback || bound) return std::nullopt;
    for (const auto& one : members_) {
        if (one.path == taken_->path || !outranks(one, *taken_)) continue;
        return change{one, std::max(saturating_add(present_.at(one.path).since, how_.failback_delay), open_from(one))};
    }
    return std::nullopt;
}

void role_choice::put_off(const std::string& path, time_point now) {
    auto found = present_.find(path);
    if (found == present_.end()) return;
    found->second.since = now;
    found->second.not_before = saturating_add(now, std::max(how_.failback_delay, min_pause));
}

} // namespace ise
