#pragma once
#include <condition_variable>
#include <memory>
#include <mutex>

namespace ise {

/// How many jobs run on other threads. Thread-safe.
class job_count : public std::enable_shared_from_this<job_count> {
public:
    /// Counts one more for as long as the result is held.
    std::shared_ptr<void> begin() {
        std::lock_guard lock(mutex_);
        ++running_;
        auto end = [self = shared_from_this()](void*) { self->ended(); };
        return std::shared_ptr<void>(this, std::move(end));
    }
    bool none() const {
        std::lock_guard lock(mutex_);
        return running_ == 0;
    }
    /// Blocks until there is none.
    void wait() {
        std::unique_lock lock(mutex_);
        none_.wait(lock, [this] { return running_ == 0; });
    }

private:
    void ended() {
        std::lock_guard lock(mutex_);
        if (--running_ == 0) none_.notify_all();
    }

    mutable std::mutex mutex_;
    std::condition_variable none_;
    int running_ = 0;
};

} // namespace ise
