#pragma once
#include <ise/core/bytes.hpp>

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace ise {

class service_runtime;

/// Something that happened to a run of an action, for recorders and viewers.
struct tapped_run {
    std::string action;
    std::uint64_t run = 0; ///< counted by its provider; the run's id stays a secret of both sides
    std::string requester; ///< its path and its address, for people
    std::uint8_t part = 0; ///< what `packet` is
    bytes packet;          ///< in the provider's layout

    static constexpr std::uint8_t goal = 0;     ///< it was accepted
    static constexpr std::uint8_t feedback = 1; ///< a report
    static constexpr std::uint8_t result = 2;   ///< it has ended
    static constexpr std::uint8_t failure = 3;  ///< it has ended without a result: a `run_failure`
};

/// The runs at the components of one loop, for those that are watched (`loop::common`). On the loop only.
class run_taps {
public:
    run_taps() = default;
    run_taps(const run_taps&) = delete;
    run_taps& operator=(const run_taps&) = delete;

    /// Calls `observer` for everything that happens to runs of that component.
    void watch(const service_runtime& component, std::function<void(tapped_run)> observer);
    void ignore(const service_runtime& component);
    bool watches(const service_runtime& component) const noexcept { return find(component) != nullptr; }
    /// Only for a component that is watched.
    void tell(const service_runtime& component, tapped_run what) const { (*find(component))(std::move(what)); }

private:
    const std::function<void(tapped_run)>* find(const service_runtime& component) const noexcept;

    std::vector<std::pair<const service_runtime*, std::function<void(tapped_run)>>> observers_;
};

} // namespace ise
