#include <components/boat/duplicate_filter.hpp>

#include <algorithm>
#include <utility>

namespace atirma {
namespace {

std::uint16_t mark_of(ise::bytes_view raw) {
    unsigned mark = 0;
    if (raw.size() >= 2) mark = std::to_integer<unsigned>(raw[raw.size() - 2]) | std::to_integer<unsigned>(raw.back()) << 8;
    return static_cast<std::uint16_t>(mark == 0 ? 1 : mark);
}

} // namespace

bool duplicate_filter::first_time(std::uint16_t boot, std::uint32_t sequence, ise::bytes_view raw) {
    auto mark = mark_of(raw);
    auto known = std::find_if(lives_.begin(), lives_.end(), [&](const life& l) { return l.boot == boot; });
    if (known == lives_.end()) {
        if (lives_.size() >= max_boots) lives_.pop_back();
        auto& made = lives_.emplace_front();
        made.boot = boot;
        made.newest = sequence;
        made.seen[sequence % window] = mark;
        return true;
    }
    lives_.splice(lives_.begin(), lives_, known);
    auto& of = *known;
    if (sequence > of.newest) {
        if (sequence - of.newest >= window) of.seen.fill(0);
        else
            for (auto passed = of.newest + 1; passed != sequence; ++passed) of.seen[passed % window] = 0;
        of.newest = sequence;
        of.seen[sequence % window] = mark;
        return true;
    }
    if (of.newest - sequence >= window) return true;
    return std::exchange(of.seen[sequence % window], mark) != mark;
}

} // namespace atirma
