#pragma once
#include <ise/core/real/environment.hpp>
#include <support/party.hpp>

#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>

namespace ise_test {

/// Parties on the real world that share one thread, the test's own: real sockets, no races.
class real_parties {
public:
    real_parties() : work_(asio::make_work_guard(context_)) {}
    ~real_parties() {
        for (auto& one : parties_) {
            one->services->stop(std::chrono::milliseconds(100));
            one->scope.stop();
        }
        run_until([&] {
            return std::all_of(parties_.begin(), parties_.end(), [](auto& one) { return one->scope.size() == 0; });
        });
        context_.poll();
    }

    party& add(std::string path, ise::service_options options = {}, ise::security credentials = {}) {
        parties_.push_back(
            std::make_unique<party>(env_, make_loop(), std::move(path), options, std::move(credentials)));
        return *parties_.back();
    }
    /// On the thread of the test, too.
    std::unique_ptr<ise::loop_host> make_loop() { return env_.adopt(context_.get_executor(), true); }
    bool run_until(const std::function<bool()>& done) {
        while (!done()) context_.run_one();
        return true;
    }
    template <class T>
    T run(party& on, ise::task<T> body) {
        auto state = start(on.on, std::move(body));
        run_until([&] { return state->done; });
        if constexpr (std::is_void_v<T>) {
            state->get();
        } else {
            return std::move(state->get());
        }
    }
    template <class Operation>
    requires std::is_base_of_v<ise::awaiter, Operation>
    auto run(party& on, Operation what) { return run(on, ise::as_task(std::move(what))); }
    ise::environment& env() { return env_; }

private:
    ise::real_environment env_;
    asio::io_context context_;
    asio::executor_work_guard<asio::io_context::executor_type> work_;
    std::vector<std::unique_ptr<party>> parties_;
};

} // namespace ise_test
