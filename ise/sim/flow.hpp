#pragma once
#include <ise/core/unique_function.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/io_context.hpp>

#include <memory>
#include <string>
#include <utility>

namespace ise::sim {

class scheduler;

/// One flow of execution of the virtual world (behind one `ise::loop`), as the scheduler sees it.
struct flow {
    scheduler* owner = nullptr; ///< null once the world is gone
    asio::execution_context* context = nullptr;
    std::string name;         ///< "shore/proxy/main"
    bool alive = true;        ///< what is handed to a dead flow is destroyed instead of run
    bool paused = false;      ///< it is kept until the flow goes on
    std::uint64_t events = 0; ///< how many events it ran in the present run
};

using work = unique_function<void(), 80>;

void submit(const std::shared_ptr<flow>& into, work what);
bool running_in(const flow& which) noexcept;

/// The executor of a flow: an Asio executor whose queue is the scheduler's.
class flow_executor {
public:
    explicit flow_executor(std::shared_ptr<flow> into, bool may_block = true) noexcept
        : flow_(std::move(into)), may_block_(may_block) {}

    asio::execution_context& query(asio::execution::context_t) const noexcept { return *flow_->context; }
    asio::execution::blocking_t query(asio::execution::blocking_t) const noexcept {
        if (may_block_) return asio::execution::blocking.possibly;
        return asio::execution::blocking.never;
    }
    flow_executor require(asio::execution::blocking_t::never_t) const noexcept { return flow_executor(flow_, false); }
    flow_executor require(asio::execution::blocking_t::possibly_t) const noexcept { return flow_executor(flow_, true); }

    template <class F>
    void execute(F&& function) const {
        if (may_block_ && running_in(*flow_)) {
            auto here = std::forward<F>(function);
            here();
        } else {
            submit(flow_, work(std::forward<F>(function)));
        }
    }

    bool operator==(const flow_executor& other) const noexcept {
        return flow_ == other.flow_ && may_block_ == other.may_block_;
    }
    bool operator!=(const flow_executor& other) const noexcept { return !(*this == other); }

private:
    std::shared_ptr<flow> flow_;
    bool may_block_;
};

} // namespace ise::sim
