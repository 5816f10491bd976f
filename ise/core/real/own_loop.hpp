#pragma once
#include <ise/core/environment.hpp>
#include <ise/core/loop.hpp>

#include <asio/steady_timer.hpp>

#include <memory>
#include <string>

namespace ise::real {

/// A loop with a thread of its own: on epoll (linux/epoll_loop), or an io_context (context_loop), as ISE was built
/// (ISE_WITH_EPOLL). Throws std::system_error where the system has no descriptor or thread left. `held` is let go of
/// last of all.
std::unique_ptr<loop_host> make_own_loop(environment& world, const std::string& name, std::shared_ptr<void> held);

/// Wakes a loop on an io_context.
class asio_alarm final : public alarm {
public:
    explicit asio_alarm(loop& owner) : loop_(owner), timer_(owner.get_executor()) {}

    void arm(time_point at) override {
        timer_.expires_at(std::chrono::steady_clock::time_point(at.time_since_epoch())); // cancels the former wait
        timer_.async_wait([this, alive = std::weak_ptr<bool>(alive_)](std::error_code problem) {
            if (!problem && !alive.expired()) loop_.on_alarm();
        });
    }

private:
    loop& loop_;
    asio::steady_timer timer_;
    std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
};

} // namespace ise::real
