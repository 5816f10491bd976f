#pragma once
#include <components/boat_simulator/wind_source.hpp>

#include <optional>
#include <utility>

namespace atirma::simulator {

/// A wind that can be overridden from a given time on. A change applies from its time only: the past does not change.
class scene_wind final : public wind_source {
public:
    static constexpr std::size_t max_changes = 1000;

    explicit scene_wind(std::shared_ptr<const wind_source> original) : original_(std::move(original)) {}

    /// Uses this wind from `time_s` on, or the original one. Beyond max_changes the oldest changes are discarded.
    void change(double time_s, std::optional<wind_sample> to) {
        if (changes_.size() >= max_changes) changes_.erase(changes_.begin());
        changes_.emplace_back(time_s, to);
    }
    /// Replaces the original wind from `time_s` on.
    void replace_original(double time_s, std::shared_ptr<const wind_source> by) {
        if (originals_.size() >= max_changes) originals_.erase(originals_.begin());
        originals_.emplace_back(time_s, std::move(by));
    }
    bool original() const { return changes_.empty() || !changes_.back().second; }

    wind_sample at(double time_s) const override {
        for (auto change = changes_.rbegin(); change != changes_.rend(); ++change)
            if (change->first <= time_s) return change->second ? *change->second : original_at(time_s);
        return original_at(time_s);
    }

private:
    wind_sample original_at(double time_s) const {
        for (auto change = originals_.rbegin(); change != originals_.rend(); ++change)
            if (change->first <= time_s) return change->second->at(time_s);
        return original_->at(time_s);
    }

    std::shared_ptr<const wind_source> original_;
    // With the time from which they apply.
    std::vector<std::pair<double, std::shared_ptr<const wind_source>>> originals_;
    std::vector<std::pair<double, std::optional<wind_sample>>> changes_;
};

} // namespace atirma::simulator
