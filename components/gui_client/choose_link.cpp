#include <components/gui_client/choose_link.hpp>

#include <components/gui_client/freshness.hpp>

#include <tuple>

namespace atirma::console {

std::string choose_link(const std::map<std::string, link_view>& links, const report_rhythm& rhythm, utc_time now) {
    using rank = std::tuple<bool, bool, int, utc_time>; // the greatest is best
    std::string best;
    rank best_rank{};
    for (const auto& [path, link] : links) {
        if (!link.takes_commands || link.all_links) continue;
        int cheap = link.link ? -static_cast<int>(*link.link) : -100;
        bool lately = false;
        if (link.last_heard && link.link)
            lately = judge(age_s(now, *link.last_heard), rhythm.position_s(*link.link)) != freshness::stale;
        bool works = link.connected && !(link.xbee && !link.xbee->trouble.empty());
        rank made{works, lately, lately ? cheap : 0, link.last_heard.value_or(utc_time())};
        if (!best.empty() && made <= best_rank) continue;
        best = path;
        best_rank = made;
    }
    return best;
}

} // namespace atirma::console
