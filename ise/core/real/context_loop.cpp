#include <ise/core/real/own_loop.hpp>

#include <ise/core/real/system.hpp>

#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>

#include <thread>
#include <utility>

namespace ise::real {
namespace {

// Destroys what waits in it before it is destroyed itself.
struct ending_context : asio::io_context {
    using asio::execution_context::shutdown;
    using asio::io_context::io_context;
};

// A thread with an io_context of its own. It sleeps between events: `poll` does nothing.
class context_loop final : public loop_host {
public:
    context_loop(environment& world, const std::string& name, std::shared_ptr<void> held)
        : held_(std::move(held)), context_(std::make_unique<ending_context>(1)),
          loop_(std::make_unique<ise::loop>(
              world, context_->get_executor(),
              [executor = context_->get_executor()] { return executor.running_in_this_thread(); })),
          work_(context_->get_executor()) {
        loop_->use_alarm(std::make_unique<asio_alarm>(*loop_));
        thread_ = std::thread([this] { context_->run(); });
        name_thread(thread_, name);
    }

    // Work that was posted since holds parts of the loop: the context goes first.
    ~context_loop() override {
        end();
        context_.reset();
    }

    void end() override {
        if (!thread_.joinable()) return;
        work_.reset();
        context_->stop();
        thread_.join();
        loop_->abandon();
        loop_->use_alarm(nullptr);
        context_->restart();
        context_->poll();
        context_->shutdown(); // and what waits for sockets and the like
    }

    ise::loop& loop() noexcept override { return *loop_; }

private:
    const std::shared_ptr<void> held_;
    std::unique_ptr<ending_context> context_;
    std::unique_ptr<ise::loop> loop_;
    asio::executor_work_guard<asio::io_context::executor_type> work_;
    std::thread thread_;
};

} // namespace

std::unique_ptr<loop_host> make_own_loop(environment& world, const std::string& name, std::shared_ptr<void> held) {
    return std::make_unique<context_loop>(world, name, std::move(held));
}

} // namespace ise::real
