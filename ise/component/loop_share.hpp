#pragma once
#include <ise/core/function_ref.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/time.hpp>

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>

namespace ise {

/// A loop that one component runs on, or several together.
class loop_share {
public:
    loop_share(std::unique_ptr<loop_host> runs, bool on_foreign_executor);
    ~loop_share();
    loop_share(const loop_share&) = delete;
    loop_share& operator=(const loop_share&) = delete;

    /// Runs `work` and waits for it, while nothing else runs on the loop; throws what it throws.
    /// errc::would_block_self where waiting would hold up the thread that has to run it.
    void run_alone(function_ref<void()> work);

    /// Whether the loop has turned since it was asked last; asks again. By one thread, and once for all its components
    /// in a round: `at` is the round's time.
    bool turns(time_point at);

    std::unique_ptr<loop_host> host;
    const bool adopted;             ///< it runs on an executor of the embedding program
    std::atomic<int> unfinished{0}; ///< components that have not stopped; the last one ends an adopted loop

private:
    /// The first handler of an adopted loop waits here until the first component has been started: whether the program
    /// runs its executor already, with however many threads, or not yet, nothing else runs on the loop until then.
    struct entrance {
        std::mutex mutex;
        std::condition_variable changed;
        bool open = false;
        bool passed = false;
    };
    void let_in();

    std::shared_ptr<entrance> entrance_;
    std::shared_ptr<std::atomic<bool>> asked_ = std::make_shared<std::atomic<bool>>(false);
    time_point asked_at_ = time_point::min();
    bool turned_ = true;
};

} // namespace ise
