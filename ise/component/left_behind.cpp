#include <ise/component/left_behind.hpp>

#include <asio/execution/context.hpp>
#include <asio/execution_context.hpp>
#include <asio/query.hpp>

#include <mutex>
#include <thread>

namespace ise {
namespace {

// Holds what must live as long as an execution context. Destroyed with it: after everything that still waits there,
// before the services that sockets and timers need.
class keeper final : public asio::execution_context::service {
public:
    static inline asio::execution_context::id id;

    explicit keeper(asio::execution_context& of) : service(of) {}
    ~keeper() override {
        for (auto& runner : held_) runner->wait_for_jobs();
    }
    void keep(std::vector<std::shared_ptr<component_runner>> held) {
        std::lock_guard lock(mutex_);
        held_.insert(held_.end(), held.begin(), held.end());
    }

private:
    void shutdown() override {}

    std::mutex mutex_;
    std::vector<std::shared_ptr<component_runner>> held_;
};

} // namespace

void leave_behind(std::vector<std::shared_ptr<component_runner>> runners) {
    auto& share = *runners.front()->share();
    if (share.adopted) {
        auto executor = share.host->loop().get_executor();
        asio::use_service<keeper>(asio::query(executor, asio::execution::context)).keep(std::move(runners));
        return;
    }
    // It waits as long as it takes; nobody waits for it but the environment.
    std::thread([held = std::move(runners)]() mutable {
        for (auto& runner : held) runner->wait_for_jobs();
        held.front()->share()->host->end();
        held.clear();
    }).detach();
}

} // namespace ise
