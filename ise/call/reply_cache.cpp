#include <ise/call/reply_cache.hpp>

#include <algorithm>
#include <utility>

namespace ise {
namespace {

// A reply that was larger leaves no room behind.
constexpr std::size_t max_room_kept = 512;
// Beside its answer, about what one call takes.
constexpr std::size_t slot_room = 128;

} // namespace

// The first that is not below `number`.
std::vector<reply_cache::known>::iterator reply_cache::reaching(std::uint64_t number) noexcept {
    if (known_.empty() || known_.back().number < number) return known_.end();
    // Without gaps behind it, it lies as far from the end as its number does.
    const auto behind = known_.back().number - number;
    if (behind < known_.size())
        if (auto guess = known_.end() - 1 - static_cast<std::ptrdiff_t>(behind); guess->number == number) return guess;
    auto below = [](const known& one, std::uint64_t wanted) { return one.number < wanted; };
    return std::lower_bound(known_.begin(), known_.end(), number, below);
}

reply_cache::entry* reply_cache::find(std::uint64_t number) noexcept {
    auto found = reaching(number);
    return found != known_.end() && found->number == number ? &slots_[found->slot] : nullptr;
}

[[gnu::hot]] reply_cache::state reply_cache::look(std::uint64_t number, bool again) const noexcept {
    if (const auto* found = find(number)) return found->answered ? state::answered : state::running;
    auto key = key_of(number);
    auto of = std::ranges::find(ranges_, key, &range::key);
    if (of != ranges_.end() && (number < of->floor || of->seen.contains(number))) return state::forgotten;
    bool unsure = of != ranges_.end() ? of->unsure : key < sure_from_;
    return again && unsure ? state::forgotten : state::fresh;
}

[[gnu::hot]] void reply_cache::begin(std::uint64_t number, place from, time_point deadline, time_point now) {
    last_used_ = now;
    note(number);
    if (free_.empty()) {
        slots_.emplace_back();
        free_.reserve(slots_.capacity());
        free_.push_back(slots_.size() - 1);
        took(0, slot_room);
    }
    known_.insert(reaching(number), known{number, free_.back()});
    auto& made = slots_[free_.back()];
    free_.pop_back();
    made.from = std::move(from);
    made.deadline = deadline;
}

// It does not run again, whatever becomes of the rest.
[[gnu::hot]] void reply_cache::note(std::uint64_t number) {
    auto key = key_of(number);
    auto found = std::ranges::find(ranges_, key, &range::key);
    if (found == ranges_.end()) {
        if (ranges_.size() >= max_ranges) {
            sure_from_ = std::max(sure_from_, ranges_.back().key + 1);
            gaps_ -= ranges_.back().seen.intervals();
            ranges_.pop_back();
        }
        found = ranges_.insert(ranges_.end(), range{key, key < sure_from_, 0, {}});
    }
    if (found != ranges_.begin()) std::rotate(ranges_.begin(), found, found + 1);
    auto& seen = ranges_.front().seen;
    auto before = seen.intervals();
    seen.add(number, number + 1);
    gaps_ += seen.intervals() - before;
    while (gaps_ > max_gaps) {
        auto& most = *std::ranges::max_element(ranges_, {}, [](const range& one) { return one.seen.intervals(); });
        most.floor = most.seen.all().front().second;
        most.seen.drop_first();
        --gaps_;
    }
}

void reply_cache::redirect(std::uint64_t number, place to) {
    if (auto* found = find(number)) found->redirected = std::make_unique<place>(std::move(to));
}

std::optional<reply_cache::place> reply_cache::origin(std::uint64_t number) const {
    const auto* found = find(number);
    if (!found || found->answered) return {};
    return found->from;
}

const reply_cache::place* reply_cache::destination(std::uint64_t number) const noexcept {
    const auto* found = find(number);
    if (!found || found->answered) return nullptr;
    return found->redirected ? found->redirected.get() : &found->from;
}

[[gnu::hot]] std::optional<reply_cache::place> reply_cache::finish(std::uint64_t number, bytes_view frame,
                                                                   time_point now) {
    auto* found = find(number);
    if (!found || found->answered) return {};
    last_used_ = now;
    make_room(frame.size(), now);
    auto before = found->frame.capacity();
    found->frame.assign(frame.begin(), frame.end());
    took(before, found->frame.capacity());
    found->answered = true;
    ++replies_;
    reply_bytes_ += frame.size();
    auto redirected = std::move(found->redirected);
    return std::move(redirected ? *redirected : found->from);
}

const bytes* reply_cache::answer(std::uint64_t number) const noexcept {
    const auto* found = find(number);
    return found && found->answered ? &found->frame : nullptr;
}

void reply_cache::give_up(std::uint64_t number) {
    auto found = reaching(number);
    if (found == known_.end() || found->number != number) return;
    drop(found->slot);
    known_.erase(found);
}

void reply_cache::took(std::size_t before, std::size_t after) noexcept {
    if (before == after) return;
    room_ += after - before;
    *room_of_all_ += after - before;
}

// Whoever calls takes it off the list of those known.
[[gnu::hot]] void reply_cache::drop(std::size_t slot) noexcept {
    auto& gone = slots_[slot];
    if (std::exchange(gone.answered, false)) {
        --replies_;
        reply_bytes_ -= gone.frame.size();
    }
    gone.from = place();
    gone.redirected.reset();
    if (gone.frame.capacity() > max_room_kept) {
        took(gone.frame.capacity(), 0);
        gone.frame = bytes();
    }
    free_.push_back(slot);
}

// Answers only: what runs stays.
template <class Condition>
void reply_cache::drop_where(Condition condition) {
    auto kept = known_.begin();
    for (auto one : known_) {
        const auto& content = slots_[one.slot];
        if (content.answered && condition(content)) drop(one.slot);
        else *kept++ = one;
    }
    known_.erase(kept, known_.end());
}

// Those that nobody can wait for any more go first, then the oldest.
[[gnu::hot]] void reply_cache::make_room(std::size_t more, time_point now) {
    auto full = [&](std::size_t of) {
        return replies_ >= max_replies / of || reply_bytes_ + more > max_reply_bytes / of;
    };
    if (!full(1)) return;
    drop_where([&](const entry& one) { return one.deadline <= now; });
    drop_where([&](const entry&) { return full(2); });
}

void reply_cache::forget_answers() {
    drop_where([](const entry&) { return true; });
    std::vector<entry> left;
    left.reserve(known_.size());
    std::vector<std::size_t> none;
    none.reserve(left.capacity());
    std::size_t room = 0;
    for (auto& one : known_) {
        left.push_back(std::move(slots_[one.slot]));
        one.slot = left.size() - 1;
        room += slot_room + left.back().frame.capacity();
    }
    slots_ = std::move(left);
    free_ = std::move(none);
    known_.shrink_to_fit();
    took(room_, room);
}

std::shared_ptr<reply_cache> reply_windows::of(std::uint64_t reply_key, std::uint64_t incarnation, time_point now,
                                               std::string_view who) {
    auto& known = all_[{reply_key, incarnation, std::string(who)}];
    if (known) return known;
    known = std::make_shared<reply_cache>(dropped_any_, room_);
    auto made = known;
    made->touch(now);
    if (all_.size() > sweep_at_ || now >= next_sweep_) sweep(now);
    return made;
}

// Answers first; that a call ran is known of so many clients, for as long as there are no more.
void reply_windows::sweep(time_point now) {
    using place = decltype(all_)::iterator;
    std::vector<place> idle;
    for (auto at = all_.begin(); at != all_.end(); ++at) {
        auto& window = *at->second;
        if (at->second.use_count() > 1 || window.running() > 0) continue;
        idle.push_back(at);
        if (window.room() > 0 && now - window.last_used() > idle_caller_life) window.forget_answers();
    }
    if (idle.size() > max_idle_callers) {
        std::ranges::stable_sort(idle, {}, [](place at) { return at->second->last_used(); });
        idle.resize(idle.size() - max_idle_callers);
        for (auto at : idle) all_.erase(at);
        dropped_any_ = true;
    }
    sweep_at_ = all_.size() + max_idle_callers;
    next_sweep_ = now + idle_caller_life / 5;
}

// A quarter at once, so that not each answer looks through all of them.
void reply_windows::make_room() {
    std::vector<reply_cache*> by_age;
    for (const auto& [client, window] : all_)
        if (window->room() > 0) by_age.push_back(window.get());
    std::ranges::stable_sort(by_age, {}, &reply_cache::last_used);
    for (auto* window : by_age) {
        if (*room_ <= max_kept_bytes / 4 * 3) return;
        window->forget_answers();
    }
}

} // namespace ise
