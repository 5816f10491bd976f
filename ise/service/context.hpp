#pragma once
#include <ise/core/asio_compat.hpp>
#include <ise/core/time.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/io_context.hpp>

#include <cstdint>
#include <memory>
#include <string>

namespace ise {

/// Ties together the calls that one cause led to.
struct trace_id {
    std::uint64_t trace = 0;  ///< of the whole tree of calls; 0: none
    std::uint64_t parent = 0; ///< the call that led to this one
};

/// What a handler may know of the call it answers. It reaches nested calls by itself: the executor of a handler's
/// coroutine carries it, so a call made there has the smaller of the two deadlines and the same trace.
struct call_context {
    std::string_view service; ///< that was called
    std::string_view caller; ///< the caller's path, or its address if it has none
    time_point deadline = time_point::max(); ///< when nobody waits any more, on the loop's clock
    trace_id trace; ///< what it belongs to
};

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

/// `on`, carrying `context`, which outlives every coroutine on it.
asio::any_io_executor with_context(const asio::any_io_executor& on, const call_context* context);

/// The context that an executor carries, or null.
const call_context* context_of(const asio::any_io_executor& on) noexcept;

} // namespace ise
