#include <components/communication_node/link_table.hpp>

#include <algorithm>

namespace atirma {

using namespace std::chrono_literals;

std::vector<link_terms> usual_links() {
    return {{link_id::xbee, 30s, 20s}, {link_id::gprs, 60s, 30s}, {link_id::iridium, 1h, 10min}};
}

std::size_t link_table::find(link_id link) const {
    std::size_t at = 0;
    while (at < terms_.size() && terms_[at].link != link) ++at;
    return at;
}

void link_table::heard(link_id link, ise::time_point when) {
    auto at = find(link);
    if (at < terms_.size()) state_[at].heard = std::max(state_[at].heard, std::optional(when));
}

void link_table::reached(link_id link, bool is) {
    if (auto at = find(link); at < terms_.size()) state_[at].reached = is;
}

bool link_table::is_reached(link_id link) const {
    auto at = find(link);
    return at < terms_.size() && state_[at].reached;
}

bool link_table::alive(link_id link, ise::time_point now) const {
    auto at = find(link);
    return at < terms_.size() && state_[at].heard && now - *state_[at].heard <= terms_[at].alive_for;
}

ise::duration link_table::patience(link_id link) const {
    auto at = find(link);
    return at < terms_.size() ? terms_[at].patience : ise::duration(30s);
}

std::optional<link_id> link_table::best(ise::time_point now, const std::set<link_id>& except) const {
    std::optional<link_id> second;
    for (std::size_t i = 0; i < terms_.size(); ++i) {
        auto link = terms_[i].link;
        if (except.contains(link) || !state_[i].reached) continue;
        if (alive(link, now)) return link;
        if (!second) second = link;
    }
    return second;
}

} // namespace atirma
