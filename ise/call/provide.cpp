#include <ise/call/provide.hpp>

#include <ise/core/task_scope.hpp>

namespace ise::detail {

failure failure_of(const std::exception_ptr& thrown) {
    if (is_cancellation(thrown)) return {errc::cancelled, "the handler was cancelled", execution::unknown};
    try {
        std::rethrow_exception(thrown);
    } catch (const error& known) {
        // It ran: what failed inside it says nothing about whether it had an effect; a refusal says that it had none.
        if (known.code() == errc::refused || known.code() == errc::access_denied) return known.why();
        return {errc::handler_failed, known.what(), execution::unknown};
    } catch (...) {
        return {errc::handler_failed, describe(thrown), execution::unknown};
    }
}

} // namespace ise::detail
