#pragma once
#include "../support/report.hpp"

#include <exception>
#include <future>
#include <utility>

namespace bench {

/// Takes the outcome, or the exception, from a component's thread to the main one. The first one counts.
class collector {
public:
    void take(outcome found) {
        if (!std::exchange(told_, true)) promise_.set_value(std::move(found));
    }
    void fail(std::exception_ptr why) {
        if (!std::exchange(told_, true)) promise_.set_exception(std::move(why));
    }
    /// Waits for it.
    outcome get() { return promise_.get_future().get(); }

private:
    std::promise<outcome> promise_;
    bool told_ = false; // all measuring components share one loop
};

} // namespace bench
