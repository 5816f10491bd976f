#pragma once
#include <components/boat_simulator/wind_source.hpp>

#include <optional>
#include <utility>

namespace atirma::simulator {

/// A wind that somebody may take into their own hands from some time on. Changes count from their time only, so that the
/// past stays as it was.
class scene_wind final : public wind_source {
public:
    static constexpr std::size_t max_changes = 1000;

    explicit scene_wind(std::shared_ptr<const wind_source> original) : original_(std::move(original)) {}

    /// From `time_s` on this wind, or the original one. Beyond max_changes the oldest are forgotten.
    void change(double time_s, std::optional<wind_sample> to) {
        if (changes_.size() >= max_changes) changes_.erase(changes_.begin());
        changes_.emplace_back(time_s, to);
    }
    bool original() const { return changes_.empty() || !changes_.back().second; }

    wind_sample at(double time_s) const override {
        for (auto change = changes_.rbegin(); change != changes_.rend(); ++change)
            if (change->first <= time_s) return change->second ? *change->second : original_->at(time_s);
        return original_->at(time_s);
    }

private:
    std::shared_ptr<const wind_source> original_;
    std::vector<std::pair<double, std::optional<wind_sample>>> changes_;
};

} // namespace atirma::simulator
