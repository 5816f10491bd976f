#include <ise/call/context.hpp>

#include <ise/core/asio_compat.hpp>
#include <ise/core/executor.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/loop_executor.hpp>

#include <asio/any_io_executor.hpp>
#include <fmt/format.h>

#include <utility>

namespace ise {
namespace {

/// An executor that is its loop's, and knows the call that its coroutine works for.
template <class Inner>
class context_executor {
public:
    context_executor(Inner inner, const call_context* context) : inner_(std::move(inner)), context_(context) {}

    const call_context* context() const noexcept { return context_; }

    template <class Property>
    auto query(const Property& property) const -> decltype(asio::query(std::declval<const Inner&>(), property)) {
        return asio::query(inner_, property);
    }
    template <class Property>
    auto require(const Property& property) const
        -> context_executor<std::decay_t<decltype(asio::require(std::declval<const Inner&>(), property))>> {
        return {asio::require(inner_, property), context_};
    }
    template <class Property>
    auto prefer(const Property& property) const
        -> context_executor<std::decay_t<decltype(asio::prefer(std::declval<const Inner&>(), property))>> {
        return {asio::prefer(inner_, property), context_};
    }
    template <class Function>
    void execute(Function&& function) const {
        compat::execute(inner_, std::forward<Function>(function));
    }

    friend bool operator==(const context_executor& a, const context_executor& b) noexcept {
        return a.inner_ == b.inner_ && a.context_ == b.context_;
    }
    friend bool operator!=(const context_executor& a, const context_executor& b) noexcept { return !(a == b); }

private:
    Inner inner_;
    const call_context* context_;
};

// A loop of its own has the small executor; behind a strand or a foreign executor there is the general one.
using plain = context_executor<loop_executor>;
using general = context_executor<asio::any_io_executor>;

} // namespace

const std::shared_ptr<call_contexts>& call_contexts::of(loop& on) {
    struct kept {
        std::shared_ptr<call_contexts> all = std::make_shared<call_contexts>();
    };
    return on.common<kept>().all;
}

call_context& call_contexts::take() {
    if (free_.empty()) {
        free_.reserve(all_.size() + 1); // `give_back` needs no memory
        free_.push_back(all_.emplace_back(std::make_unique<call_context>()).get());
    }
    auto& taken = *free_.back();
    free_.pop_back();
    return taken;
}

void call_contexts::give_back(call_context& unused) noexcept {
    unused = call_context();
    free_.push_back(&unused);
}

asio::any_io_executor with_context(const asio::any_io_executor& on, const call_context* context) {
    if (auto* inner = executor_cast<loop_executor>(on)) return plain(*inner, context);
    return general(on, context);
}

[[gnu::hot]] const call_context* context_of(const asio::any_io_executor& on) noexcept {
    if (auto* known = executor_cast<plain>(on)) return known->context();
    if (auto* known = executor_cast<general>(on)) return known->context();
    return nullptr;
}

std::string suspected_cycle(const call_context& context) {
    if (context.waiting.empty()) return {};
    return fmt::format("; '{}' runs one request at a time (provide_exclusive), and one from {} came meanwhile and "
                       "waits for it: if its handler waits for that caller, this is a cycle",
                       context.service, context.waiting);
}

} // namespace ise
