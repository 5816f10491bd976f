#include <ise/service/reply_window.hpp>

#include <algorithm>
#include <utility>

namespace ise {
namespace {

// A reply that was larger leaves no room behind.
constexpr std::size_t most_room_kept = 512;

} // namespace

// The first that is not below `number`.
std::vector<reply_window::known>::iterator reply_window::reaching(std::uint64_t number) noexcept {
    if (known_.empty() || known_.back().number < number) return known_.end();
    // Without gaps behind it, it lies as far from the end as its number does.
    const auto behind = known_.back().number - number;
    if (behind < known_.size())
        if (auto guess = known_.end() - 1 - static_cast<std::ptrdiff_t>(behind); guess->number == number) return guess;
    auto below = [](const known& one, std::uint64_t wanted) { return one.number < wanted; };
    return std::lower_bound(known_.begin(), known_.end(), number, below);
}

reply_window::entry* reply_window::find(std::uint64_t number) noexcept {
    auto found = reaching(number);
    return found != known_.end() && found->number == number ? &slots_[found->slot] : nullptr;
}

reply_window::state reply_window::look(std::uint64_t number, bool again) const noexcept {
    if (const auto* found = find(number)) return found->answered ? state::answered : state::running;
    if (number < floor_ || seen_.contains(number)) return state::forgotten;
    return again && unsure_ ? state::forgotten : state::fresh;
}

void reply_window::begin(std::uint64_t number, place from, time_point deadline, time_point now) {
    last_used_ = now;
    make_room(now);
    if (free_.empty()) {
        free_.push_back(slots_.size());
        slots_.emplace_back();
    }
    known_.insert(reaching(number), known{number, free_.back()});
    auto& made = slots_[free_.back()];
    free_.pop_back();
    made.from = std::move(from);
    made.deadline = deadline;
    seen_.add(number, number + 1);
    while (seen_.intervals() > max_gaps) {
        floor_ = seen_.all().begin()->second;
        seen_.drop_first();
    }
}

void reply_window::redirect(std::uint64_t number, place to) {
    if (auto* found = find(number)) found->redirected = std::make_unique<place>(std::move(to));
}

std::optional<reply_window::place> reply_window::origin(std::uint64_t number) const {
    const auto* found = find(number);
    if (!found || found->answered) return {};
    return found->from;
}

std::optional<reply_window::place> reply_window::finish(std::uint64_t number, bytes_view frame) {
    auto* found = find(number);
    if (!found || found->answered) return {};
    found->frame.assign(frame.begin(), frame.end());
    found->answered = true;
    ++replies_;
    reply_bytes_ += frame.size();
    auto redirected = std::move(found->redirected);
    return std::move(redirected ? *redirected : found->from);
}

const bytes* reply_window::answer(std::uint64_t number) const noexcept {
    const auto* found = find(number);
    return found && found->answered ? &found->frame : nullptr;
}

void reply_window::give_up(std::uint64_t number) {
    auto found = reaching(number);
    if (found == known_.end() || found->number != number) return;
    drop(found->slot);
    known_.erase(found);
}

// Whoever calls takes it off the list of those known.
void reply_window::drop(std::size_t slot) {
    auto& gone = slots_[slot];
    if (std::exchange(gone.answered, false)) {
        --replies_;
        reply_bytes_ -= gone.frame.size();
    }
    gone.from = place();
    gone.redirected.reset();
    if (gone.frame.capacity() > most_room_kept) gone.frame = bytes();
    free_.push_back(slot);
}

// Replies that nobody can wait for any more go first, then the oldest; what runs stays.
void reply_window::make_room(time_point now) {
    if (replies_ < max_replies && reply_bytes_ < max_reply_bytes) return;
    auto drop_where = [this](auto condition) {
        auto kept = known_.begin();
        for (auto one : known_) {
            const auto& content = slots_[one.slot];
            if (content.answered && condition(content)) drop(one.slot);
            else *kept++ = one;
        }
        known_.erase(kept, known_.end());
    };
    drop_where([&](const entry& one) { return one.deadline <= now; });
    drop_where([&](const entry&) { return replies_ > max_replies / 2 || reply_bytes_ > max_reply_bytes / 2; });
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
