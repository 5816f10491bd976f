// Loops on threads of their own, for the tests of what lies between threads: the least environment that works.
#pragma once
#include <ise/asio.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/loop.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/detached.hpp>
#include <asio/io_context.hpp>
#include <asio/use_future.hpp>

#include <future>
#include <thread>

namespace threads {

class bare_environment : public ise::environment {
public:
    ise::time_point now() const override {
        return ise::time_point(
            std::chrono::duration_cast<ise::duration>(std::chrono::steady_clock::now().time_since_epoch()));
    }
    ise::wall_time wall() const override { return {}; }
    std::uint64_t random() override { return 4; }
    const ise::process_identity& identity() const override { return identity_; }
    std::optional<std::string> variable(const std::string&) const override { return {}; }
    std::unique_ptr<ise::loop_host> make_loop(const std::string&) override { return nullptr; }
    std::unique_ptr<ise::loop_host> adopt(asio::any_io_executor, bool) override { return nullptr; }
    void offload(std::function<void()> work) override { work(); }
    bool is_virtual() const noexcept override { return false; }
    ise::task<ise::result<std::unique_ptr<ise::stream>>> connect(ise::loop&, ise::endpoint) override { co_return no(); }
    ise::result<std::unique_ptr<ise::listener>> listen(ise::loop&, const ise::endpoint&) override { return no(); }
    ise::result<std::unique_ptr<ise::datagram_socket>> open_datagram(ise::loop&, const ise::endpoint&) override {
        return no();
    }
    ise::result<std::unique_ptr<ise::stream>> open_serial(ise::loop&, const ise::serial_options&) override {
        return no();
    }
    ise::result<ise::pseudo_terminal> open_pseudo_terminal(ise::loop&, const std::string&) override { return no(); }
    ise::result<std::string> read_file(const std::string&, std::size_t) override { return no(); }
    ise::result<std::string> read_secret(const std::string&, std::size_t) override { return no(); }
    std::vector<std::string> interface_addresses() const override { return {}; }

private:
    static ise::failure no() { return {ise::errc::io_failed, "not in this test"}; }
    ise::process_identity identity_;
};

// A loop on a thread. The destructor ends it as a real host does: thread, loop, what is left of the coroutines.
class looper {
public:
    explicit looper(ise::environment& env)
        : loop_(std::make_unique<ise::loop>(env, io_.get_executor(),
                                            [this] { return std::this_thread::get_id() == thread_.get_id(); })),
          thread_([this] { io_.run(); }) {}
    ~looper() {
        open_.reset();
        io_.stop();
        thread_.join();
        loop_->abandon();
        io_.restart();
        io_.poll();
    }
    ise::loop& loop() { return *loop_; }

    std::future<void> run(ise::task<> what) {
        return ise::async_run(io_.get_executor(), std::move(what), asio::use_future);
    }

private:
    asio::io_context io_{1};
    asio::executor_work_guard<asio::io_context::executor_type> open_{io_.get_executor()};
    std::unique_ptr<ise::loop> loop_;
    std::thread thread_;
};

} // namespace threads
