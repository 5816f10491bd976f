#include <components/boat/duplicate_filter.hpp>

#include <algorithm>
#include <utility>

namespace atirma {
namespace {

std::uint16_t mark_of(ise::bytes_view raw) {
    unsigned mark = 0;
    if (raw.size() >= 2)
        mark = std::to_integer<unsigned>(raw[raw.size() - 2]) | std::to_integer<unsigned>(raw.back()) << 8;
    return static_cast<std::uint16_t>(mark == 0 ? 1 : mark);
}

} // namespace

bool duplicate_filter::first_time(std::uint16_t boot, std::uint32_t sequence, ise::bytes_view raw) {
    auto known = std::find_if(lives_.begin(), lives_.end(), [&](const life& l) { return l.boot == boot; });
    if (known != lives_.end()) {
        lives_.splice(lives_.begin(), lives_, known);
    } else {
        if (lives_.size() >= max_boots) lives_.pop_back();
        lives_.emplace_front().boot = boot;
    }
    auto [here, made] = lives_.front().pages.try_emplace(sequence / page);
    auto mark = mark_of(raw);
    bool first = std::exchange(here->second[sequence % page], mark) != mark;
    if (made) make_room();
    return first;
}

/// The boot with most pages gives up its oldest: neither history nor the present can take the whole window from the
/// other.
void duplicate_filter::make_room() {
    std::size_t all = 0;
    auto* most = &lives_.front();
    for (auto& one : lives_) {
        all += one.pages.size();
        if (one.pages.size() >= most->pages.size()) most = &one;
    }
    if (all > max_pages) most->pages.erase(most->pages.begin());
}

} // namespace atirma
