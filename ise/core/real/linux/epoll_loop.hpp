#pragma once
#include <ise/core/environment.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/loop_executor.hpp>
#include <ise/core/real/descriptor.hpp>
#include <ise/core/real/linux/poller.hpp>
#include <ise/core/real/linux/receive_ring.hpp>
#include <ise/core/ring.hpp>

#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>

#include <array>
#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <sys/epoll.h>

namespace ise::real {

/// A loop of ISE's own and its thread: sockets by epoll, edge-triggered, and by io_uring where messages are short; a
/// timer; work of other threads, which wake it only when it sleeps. Without a lock on the way of a turn.
///
/// Objects of Asio that are made on its executor live on an io_context beside it, whose thread starts with the first of
/// them; their completions are posted to the loop.
class epoll_loop final : public loop_host, public loop_queue, public readiness {
public:
    /// Throws std::system_error where the system has no descriptor or thread left.
    /// `held` is let go of last of all.
    epoll_loop(environment& world, const std::string& name, std::shared_ptr<void> held,
               std::shared_ptr<poll_seats> seats);
    ~epoll_loop() override;

    ise::loop& loop() noexcept override { return *loop_; }
    void poll(duration window) override;
    void end() override;

    void post(work what) override;
    bool running_here() const noexcept override;
    asio::execution_context& objects() override;

    std::error_code add(descriptor& watched) override;
    std::error_code change(descriptor& watched, bool to_write) override;
    void remove(descriptor& watched) noexcept override;
    void again(descriptor& watched) override;
    bool receive(descriptor& watched) override;

private:
    class next_alarm;
    class inside;
    // Destroys what waits in it before it is destroyed itself.
    struct ending_context : asio::io_context {
        using asio::execution_context::shutdown;
        using asio::io_context::io_context;
    };

    void run();
    void wait();
    void take_events(int timeout) noexcept;
    void tell();
    void tell_again();
    void take_posted();
    void work_off();
    void drop_posted();
    void wake() noexcept;

    const std::shared_ptr<void> held_;
    environment& world_;
    owned_fd epoll_, doorbell_;
    owned_fd timer_; // moved seldom; a time-out of each sleep would set a timer of the system each time
    std::array<epoll_event, 64> events_{};
    int told_ = 0, come_ = 0; // of the events
    std::vector<descriptor*> again_;
    std::unique_ptr<receive_ring> ring_; // once a socket is received for, where the system offers it
    bool ring_sought_ = false;

    std::shared_ptr<poll_seats> seats_;
    std::unique_ptr<ise::loop> loop_;
    std::unique_ptr<poller> poller_;
    ring<work> queue_; // from here on it may hold parts of the loop

    std::mutex mutex_; // of what other threads touch
    ring<work> posted_;
    std::atomic<bool> has_posted_{false};
    std::atomic<bool> sleeping_{false};
    std::atomic<bool> stopped_{false};

    ending_context asio_; // the objects of Asio
    std::optional<asio::executor_work_guard<asio::io_context::executor_type>> asio_work_;
    std::mutex asio_mutex_;
    bool asio_over_ = false;
    std::thread asio_thread_;

    std::thread thread_;
};

} // namespace ise::real
