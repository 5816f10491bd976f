#pragma once
#include <ise/core/unique_function.hpp>

#include <memory>
#include <mutex>

namespace ise {

class loop;

/// The way into a loop for other threads. It may be kept for longer than the loop: then it is shut.
class loop_gate : public std::enable_shared_from_this<loop_gate> {
public:
    explicit loop_gate(loop& owner) : loop_(&owner) {}

    /// Runs `work` in a turn of the loop, soon. False, and `work` is dropped, once the loop has ended; work
    /// that was accepted is dropped too when the loop ends before its turn comes. Thread-safe.
    bool post(unique_function<void()> work);

private:
    friend class loop;
    void shut() noexcept;

    std::mutex mutex_;
    loop* loop_;
};

} // namespace ise
