#include <ise/core/loop_gate.hpp>

#include <ise/core/loop.hpp>

#include <asio/post.hpp>

namespace ise {

bool loop_gate::post(unique_function<void()> work) {
    std::lock_guard lock(mutex_); // held while posting: the executor lives as long as the loop
    if (!loop_) return false;
    asio::post(loop_->get_executor(), [gate = shared_from_this(), work = std::move(work)]() mutable {
        loop* into = nullptr;
        {
            std::lock_guard look(gate->mutex_);
            into = gate->loop_;
        }
        if (!into) return;
        loop::turn in(*into); // on the loop's own thread, which alone can end it
        work();
    });
    return true;
}

void loop_gate::shut() noexcept {
    std::lock_guard lock(mutex_);
    loop_ = nullptr;
}

} // namespace ise
