#pragma once
#include <ise/instantiation/limits.hpp>

#include <string>

namespace ise::instantiation {

/// A control group of version 2 below which this process may make others: its own, where that is writable. Empty: there
/// is none. In a group of its own that was delegated to it (systemd: `Delegate=yes`, `DelegateSubgroup=ise-server`) it
/// enables the controllers pids, memory and cpu, and goes into a group below for that.
std::string usable_cgroup();

/// One group, of an instance. Its folder is made by `open`.
class cgroup {
public:
    explicit cgroup(std::string folder) : folder_(std::move(folder)) {}

    /// Makes it and sets the limits; false: no such group can be made.
    bool open(const resource_limits& limits);
    bool is_open() const noexcept { return open_; }
    /// Which limits the kernel keeps.
    bool keeps_pids() const noexcept { return pids_; }
    bool keeps_memory() const noexcept { return memory_; }
    bool keeps_cpus() const noexcept { return cpus_; }
    /// Moves the calling process in. For the child of a fork: makes system calls only.
    bool enter() const noexcept;
    /// Kills all processes in it, also those that are being forked.
    void kill() const;
    /// Whether the kernel killed a process in it for lack of memory.
    bool ran_out_of_memory() const;
    /// Removes it; it must be empty.
    void close();

private:
    std::string folder_, processes_;
    bool open_ = false, pids_ = false, memory_ = false, cpus_ = false;
};

} // namespace ise::instantiation
