#include <ise/component/loop_share.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/error.hpp>
#include <ise/core/executor.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/io_context.hpp>
#include <asio/packaged_task.hpp>
#include <asio/post.hpp>
#include <asio/strand.hpp>

#include <future>
#include <utility>

namespace ise {

namespace {

/// Whether the calling thread runs the program's io_context, behind which the loop's strand lies.
bool on_context_of(const asio::any_io_executor& executor) {
    const auto* behind = executor_cast<asio::strand<asio::any_io_executor>>(executor);
    if (!behind) return false;
    auto inner = behind->get_inner_executor();
    const auto* context = executor_cast<asio::io_context::executor_type>(inner);
    return context && context->running_in_this_thread();
}

} // namespace

loop_share::loop_share(std::unique_ptr<loop_host> runs, bool on_foreign_executor)
    : host(std::move(runs)), adopted(on_foreign_executor) {
    if (!adopted || host->loop().env().is_virtual()) return;
    entrance_ = std::make_shared<entrance>();
    asio::post(host->loop().get_executor(), [entrance = entrance_] {
        std::unique_lock lock(entrance->mutex);
        entrance->changed.wait(lock, [&] { return entrance->open; });
        entrance->passed = true;
    });
}

loop_share::~loop_share() { let_in(); }

void loop_share::let_in() {
    if (!entrance_) return;
    {
        std::lock_guard lock(entrance_->mutex);
        entrance_->open = true;
    }
    entrance_->changed.notify_all();
}

void loop_share::run_alone(function_ref<void()> work) {
    auto& loop = host->loop();
    if (loop.env().is_virtual()) return work();
    if (entrance_) {
        struct opening {
            loop_share& share;
            ~opening() { share.let_in(); }
        } afterwards{*this};
        std::lock_guard lock(entrance_->mutex);
        if (!entrance_->passed) return work();
    }
    if (loop.running_here()) return work();
    if (on_context_of(loop.get_executor()))
        throw error(errc::would_block_self,
                    "a component that shares the loop of a running one is started on that loop, or from a thread "
                    "that does not run the program's io_context");
    try {
        asio::post(loop.get_executor(), std::packaged_task<void()>(work)).get();
    } catch (const std::future_error&) { // dropped unrun
        throw error(errc::cancelled, "the loop ended before the component could be started on it");
    }
}

bool loop_share::turns(time_point at) {
    if (std::exchange(asked_at_, at) == at) return turned_;
    turned_ = !asked_->exchange(true);
    if (turned_) host->loop().gate()->post([asked = asked_] { *asked = false; });
    return turned_;
}

} // namespace ise
