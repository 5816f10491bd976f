#include <ise/service/reply_window.hpp>

#include <algorithm>

namespace ise {

reply_window::state reply_window::look(std::uint64_t number, bool again) const noexcept {
    auto found = entries_.find(number);
    if (found != entries_.end()) return found->second.frame ? state::answered : state::running;
    if (number < floor_ || seen_.contains(number)) return state::forgotten;
    return again && unsure_ ? state::forgotten : state::fresh;
}

void reply_window::begin(std::uint64_t number, place from, time_point deadline, time_point now) {
    last_used_ = now;
    make_room(now);
    entry made;
    made.from = from;
    made.to = std::move(from);
    made.deadline = deadline;
    entries_.emplace(number, std::move(made));
    seen_.add(number, number + 1);
    while (seen_.intervals() > max_gaps) {
        floor_ = seen_.all().begin()->second;
        seen_.drop_first();
    }
}

void reply_window::redirect(std::uint64_t number, place to) {
    auto found = entries_.find(number);
    if (found != entries_.end()) found->second.to = std::move(to);
}

std::optional<reply_window::place> reply_window::origin(std::uint64_t number) const {
    auto found = entries_.find(number);
    if (found == entries_.end() || found->second.frame) return {};
    return found->second.from;
}

std::optional<reply_window::place> reply_window::finish(std::uint64_t number, bytes_view frame) {
    auto found = entries_.find(number);
    if (found == entries_.end() || found->second.frame) return {};
    auto to = found->second.to;
    found->second.frame.emplace(frame.begin(), frame.end());
    ++replies_;
    reply_bytes_ += frame.size();
    return to;
}

const bytes* reply_window::answer(std::uint64_t number) const noexcept {
    auto found = entries_.find(number);
    return found == entries_.end() || !found->second.frame ? nullptr : &*found->second.frame;
}

void reply_window::give_up(std::uint64_t number) {
    auto found = entries_.find(number);
    if (found != entries_.end()) drop(found);
}

void reply_window::drop(std::map<std::uint64_t, entry>::iterator which) {
    if (which->second.frame) {
        --replies_;
        reply_bytes_ -= which->second.frame->size();
    }
    entries_.erase(which);
}

// Replies that nobody can wait for any more go first, then the oldest; what runs stays.
void reply_window::make_room(time_point now) {
    if (replies_ < max_replies && reply_bytes_ < max_reply_bytes) return;
    for (auto at = entries_.begin(); at != entries_.end();) {
        auto next = std::next(at);
        if (at->second.frame && at->second.deadline <= now) drop(at);
        at = next;
    }
    for (auto at = entries_.begin(); at != entries_.end() && (replies_ > max_replies / 2 || reply_bytes_ > max_reply_bytes / 2);) {
        auto next = std::next(at);
        if (at->second.frame) drop(at);
        at = next;
    }
}

std::shared_ptr<reply_window> reply_windows::of(std::uint64_t incarnation, time_point now) {
    auto& known = all_[incarnation];
    if (known) return known;
    known = std::make_shared<reply_window>(dropped_any_);
    auto made = known;
    if (all_.size() > sweep_at_) sweep(now);
    return made;
}

void reply_windows::sweep(time_point now) {
    auto idle = [](const auto& entry) { return entry.second.use_count() == 1 && entry.second->running() == 0; };
    auto dropped = std::erase_if(all_, [&](const auto& entry) { return idle(entry) && now - entry.second->last_used() > idle_life; });
    auto left = static_cast<std::size_t>(std::count_if(all_.begin(), all_.end(), idle));
    for (; left > max_idle; --left) {
        auto oldest = all_.end();
        for (auto at = all_.begin(); at != all_.end(); ++at)
            if (idle(*at) && (oldest == all_.end() || at->second->last_used() < oldest->second->last_used())) oldest = at;
        all_.erase(oldest);
        ++dropped;
    }
    dropped_any_ = dropped_any_ || dropped > 0;
    sweep_at_ = std::max<std::size_t>(64, all_.size() * 2);
}

} // namespace ise
