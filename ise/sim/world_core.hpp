#pragma once
#include <ise/sim/fault_plan.hpp>
#include <ise/sim/scheduler.hpp>
#include <ise/sim/trace.hpp>

#include <cstdint>
#include <string_view>

namespace ise::sim {

/// What all parts of a virtual world stand on: its seed, its clock, its faults and its trace.
class world_core {
public:
    /// Made as a `world`.
    explicit world_core(std::uint64_t seed) : seed_(seed) {}
    world_core(const world_core&) = delete;
    world_core& operator=(const world_core&) = delete;

    /// The seed passed to the constructor.
    std::uint64_t seed() const noexcept { return seed_; }
    /// Virtual time.
    time_point now() const noexcept { return scheduler_.now(); }
    /// Virtual time since the world began.
    duration elapsed() const noexcept { return now() - start; }
    /// The wall clock at the beginning, UTC.
    wall_time wall_start = std::chrono::sys_days(std::chrono::year(2017) / 9 / 4) + std::chrono::hours(8);
    /// Makes the n-th I/O operation from now on fail, of any kind: see fault_plan.
    void fail_at(std::uint64_t n, std::error_code with = asio::error::connection_reset) { faults_.fail_at(n, with); }
    /// The number of I/O operations so far.
    std::uint64_t operations() const noexcept { return faults_.operations(); }
    /// Which operation fails, and whether it did.
    fault_plan& faults() noexcept { return faults_; }
    /// The trace of events so far.
    sim::trace& trace() noexcept { return trace_; }
    /// For programs that embed ISE on an executor of their own; only the world runs it.
    asio::io_context& context() noexcept { return scheduler_.context(); }

    /// @cond
    // For the world's parts.
    scheduler& engine() noexcept { return scheduler_; }
    void note(std::string_view kind, std::string_view subject, std::uint64_t amount = 0) {
        trace_.note(now(), kind, subject, amount);
    }
    /// @endcond

    /// Not zero, so that a time point that nobody has set is seen to be wrong.
    static constexpr time_point start{std::chrono::hours(1)};

protected:
    ~world_core() = default;

private:
    std::uint64_t seed_;
    fault_plan faults_;
    sim::trace trace_;
    scheduler scheduler_{start};
};

} // namespace ise::sim
