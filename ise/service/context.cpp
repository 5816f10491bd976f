#include <ise/service/context.hpp>

#include <ise/core/executor.hpp>

namespace ise {
namespace {

// A loop of its own has the small executor; behind a strand or a foreign executor there is the general one.
using plain = context_executor<asio::io_context::executor_type>;
using general = context_executor<asio::any_io_executor>;

} // namespace

asio::any_io_executor with_context(const asio::any_io_executor& on, const call_context* context) {
    if (auto* inner = executor_cast<asio::io_context::executor_type>(on)) return plain(*inner, context);
    return general(on, context);
}

const call_context* context_of(const asio::any_io_executor& on) noexcept {
    if (auto* known = executor_cast<plain>(on)) return known->context();
    if (auto* known = executor_cast<general>(on)) return known->context();
    return nullptr;
}

} // namespace ise
