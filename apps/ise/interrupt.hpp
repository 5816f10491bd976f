#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/unique_function.hpp>

#include <functional>
#include <memory>
#include <mutex>

namespace ise::cli {

/// Ctrl-C for a command that has something to put right before it ends. Unless somebody cares, it just ends.
class interrupt {
public:
    /// From now on the first Ctrl-C calls `first` on the loop; the next one ends the command at once.
    void care(loop& on, std::function<void()> first) {
        std::lock_guard lock(mutex_);
        gate_ = on.gate();
        first_ = std::move(first);
    }
    /// Nobody does any more. Nothing is called once it returns, on the loop of `care`.
    void leave() {
        std::lock_guard lock(mutex_);
        first_ = nullptr;
        gate_.reset();
        *valid_ = false;
        valid_ = std::make_shared<bool>(true);
    }
    /// Ctrl-C was pressed; from any thread. False: the command is to end.
    bool raise() {
        std::lock_guard lock(mutex_);
        if (!first_) return false;
        gate_->post([first = std::exchange(first_, nullptr), valid = valid_] {
            if (*valid) first();
        });
        return true;
    }

private:
    std::mutex mutex_;
    std::shared_ptr<loop_gate> gate_;
    std::function<void()> first_;
    std::shared_ptr<bool> valid_ = std::make_shared<bool>(true); // of the loop
};

} // namespace ise::cli
