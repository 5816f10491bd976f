#include "ledger.hpp"

namespace atirma::stress {

ledger::entry& ledger::at(link_id over, packet_key which) {
    auto& e = entries_[which];
    e.link = over;
    return e;
}

void ledger::sent(link_id over, packet_key which, ise::duration when) {
    auto& e = at(over, which);
    if (e.sent.count() < 0) e.sent = when;
}

void ledger::acknowledged(link_id over, packet_key which, ise::duration when) {
    auto& e = at(over, which);
    if (e.acknowledged.count() < 0) e.acknowledged = when;
}

void ledger::arrived(packet_key which, ise::duration when) {
    auto& e = at(link_id::xbee, which);
    if (e.arrived.count() < 0) e.arrived = when;
}

void ledger::receipted(packet_key which, ise::duration when) {
    auto found = entries_.find(which);
    if (found != entries_.end() && found->second.receipted.count() < 0) found->second.receipted = when;
}

void ledger::shown(const std::string& who, packet_key which) {
    auto& s = subscribers_[who];
    if (!s.known.insert(which).second) ++s.twice;
}

ledger::verdict ledger::judge(std::span<const std::set<packet_key>> disks, ise::duration until,
                              const std::set<packet_key>& at_boat) const {
    verdict made;
    std::set<packet_key> all;
    for (const auto& disk : disks) all.insert(disk.begin(), disk.end());
    for (auto which : all)
        for (const auto& disk : disks)
            if (!disk.contains(which)) {
                ++made.only_on_one;
                break;
            }
    for (auto which : all) made.unheard += !entries_.contains(which);
    bool nothing_lost = true;
    for (const auto& [which, e] : entries_) {
        auto& counts = made.links[static_cast<std::size_t>(e.link)];
        ++counts.sent;
        counts.acknowledged += e.acknowledged.count() >= 0;
        counts.heard += e.heard();
        const bool kept = all.contains(which);
        counts.kept += kept;
        if (!kept && at_boat.contains(which)) ++counts.waiting;
        else if (!kept) made.lost.push_back(e);
        if (!e.owed() || e.owed_since() > until) continue;
        ++counts.owed;
        if (kept) continue;
        missing_packet missed;
        missed.which = which;
        missed.what = e;
        made.missing.push_back(missed);
        nothing_lost = false;
    }
    bool shown_well = true;
    for (const auto& [who, s] : subscribers_) {
        auto& result = made.subscribers[who];
        result.shown = s.known.size();
        result.twice = s.twice;
        for (auto which : all) result.missed += !s.known.contains(which);
        for (auto which : s.known) result.unknown += !all.contains(which);
        if (result.twice + result.missed + result.unknown > 0) shown_well = false;
    }
    made.holds = nothing_lost && shown_well && made.only_on_one == 0 && made.unheard == 0 && !entries_.empty();
    return made;
}

} // namespace atirma::stress
