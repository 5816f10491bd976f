#include <components/boat/duplicate_filter.hpp>

#include <algorithm>

namespace atirma {

bool duplicate_filter::first_time(std::uint16_t boot, std::uint32_t sequence) {
    auto known = std::find_if(lives_.begin(), lives_.end(), [&](const life& l) { return l.boot == boot; });
    if (known == lives_.end()) {
        if (lives_.size() >= max_boots) lives_.pop_back();
        auto& made = lives_.emplace_front();
        made.boot = boot;
        made.newest = sequence;
        made.seen.set(sequence % window);
        return true;
    }
    lives_.splice(lives_.begin(), lives_, known);
    auto& of = *known;
    if (sequence > of.newest) {
        if (sequence - of.newest >= window) of.seen.reset();
        else
            for (auto passed = of.newest + 1; passed != sequence; ++passed) of.seen.reset(passed % window);
        of.newest = sequence;
        of.seen.set(sequence % window);
        return true;
    }
    if (of.newest - sequence >= window) return true;
    bool first = !of.seen.test(sequence % window);
    of.seen.set(sequence % window);
    return first;
}

} // namespace atirma
