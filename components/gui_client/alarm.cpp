#include <components/gui_client/alarm.hpp>

#include <algorithm>
#include <utility>

namespace atirma::console {

std::string_view name_of(severity how) noexcept {
    return how == severity::critical ? "critical" : how == severity::warning ? "warning" : "notice";
}

std::string_view name_of(alarm_change what) noexcept {
    switch (what) {
        case alarm_change::raised: return "raised";
        case alarm_change::more_severe: return "more severe";
        case alarm_change::over: return "over";
        case alarm_change::acknowledged: return "acknowledged";
    }
    return "changed";
}

void alarm_book::raise(const std::string& key, severity how, std::string text, utc_time now) {
    auto found = alarms_.find(key);
    if (found == alarms_.end()) {
        if (alarms_.size() >= max_alarms) { // the least severe of those that are over is removed
            auto least = alarms_.end();
            for (auto it = alarms_.begin(); it != alarms_.end(); ++it)
                if (it->second.over_at && it->second.how <= how &&
                    (least == alarms_.end() || it->second.raised_at < least->second.raised_at))
                    least = it;
            ++dropped_;
            if (least == alarms_.end()) return;
            alarms_.erase(least);
        }
        auto before = remembered_.find(key);
        bool known = before != remembered_.end() && now < remembered_until_ && how <= before->second;
        if (before != remembered_.end()) remembered_.erase(before);
        found = alarms_.emplace(key, alarm_entry{key, how, {}, now, std::nullopt, known}).first;
        found->second.text = text;
        note(alarm_change::raised, found->second, now);
    }
    auto& a = found->second;
    bool again = a.over_at.has_value(), worse = how > a.how;
    if (again) {
        a.over_at.reset();
        a.raised_at = now;
        a.acknowledged = false;
    }
    if (worse) a.acknowledged = false;
    a.how = how;
    a.text = std::move(text);
    if (again || worse) note(again ? alarm_change::raised : alarm_change::more_severe, a, now);
}

void alarm_book::note(alarm_change what, const alarm_entry& of, utc_time now) {
    events_.push_back({last_event() + 1, now, what, of.how, of.key, of.text});
    if (events_.size() > max_events) events_.pop_front();
    shared_log_.reset();
}

std::shared_ptr<const std::vector<alarm_event>> alarm_book::log() const {
    if (!shared_log_) shared_log_ = std::make_shared<const std::vector<alarm_event>>(events_.begin(), events_.end());
    return shared_log_;
}

void alarm_book::clear(const std::string& key, utc_time now) {
    auto found = alarms_.find(key);
    if (found == alarms_.end()) return;
    if (!found->second.over_at) note(alarm_change::over, found->second, now);
    if (found->second.acknowledged) alarms_.erase(found);
    else if (!found->second.over_at) found->second.over_at = now;
}

void alarm_book::set(const std::string& key, bool there, severity how, const std::string& text, utc_time now) {
    if (there) raise(key, how, text, now);
    else clear(key, now);
}

void alarm_book::tell(const std::string& key, severity how, std::string text, utc_time now) {
    raise(key, how, std::move(text), now);
    clear(key, now);
}

bool alarm_book::acknowledge(const std::string& key, utc_time now) {
    bool any = false;
    for (auto it = alarms_.begin(); it != alarms_.end();) {
        if (!key.empty() && it->first != key) {
            ++it;
            continue;
        }
        any = true;
        if (!std::exchange(it->second.acknowledged, true)) note(alarm_change::acknowledged, it->second, now);
        it = it->second.over_at ? alarms_.erase(it) : std::next(it);
    }
    return any;
}

void alarm_book::remember(const std::vector<acknowledged_alarm>& before, utc_time until) {
    remembered_until_ = until;
    for (const auto& one : before)
        if (remembered_.size() < max_alarms) remembered_[one.key] = one.how;
}

const alarm_entry* alarm_book::find(const std::string& key) const {
    auto found = alarms_.find(key);
    return found == alarms_.end() ? nullptr : &found->second;
}

std::vector<alarm_entry> alarm_book::list() const {
    std::vector<alarm_entry> all;
    for (const auto& [key, one] : alarms_) all.push_back(one);
    std::stable_sort(all.begin(), all.end(), [](const alarm_entry& a, const alarm_entry& b) {
        if (a.acknowledged != b.acknowledged) return b.acknowledged;
        if (a.how != b.how) return a.how > b.how;
        return a.raised_at > b.raised_at;
    });
    return all;
}

} // namespace atirma::console
