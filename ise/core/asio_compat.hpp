#pragma once
// Where the releases of Asio differ that ISE is built with, in one place: from 1.22 (Debian 12) to current ones.
#include <ise/core/use_task.hpp>

#include <asio/version.hpp>
#if ASIO_VERSION >= 102300
    #include <asio/as_tuple.hpp>
#else
    #include <asio/experimental/as_tuple.hpp>
#endif
#if ASIO_VERSION < 102600
    #include <asio/execution/execute.hpp>
#endif

#include <utility>

namespace ise::compat {

#if ASIO_VERSION >= 102300
namespace asio_as_tuple = asio;
#else
namespace asio_as_tuple = asio::experimental;
#endif

/// Awaits an operation of Asio whose error comes with its values instead of being thrown.
inline constexpr auto as_tuple = asio_as_tuple::as_tuple(use_task);

/// Runs `work` on an executor; its member of that name is private in some and the function is gone from the others.
template <class Executor, class Work>
void execute(const Executor& on, Work&& work) {
#if ASIO_VERSION >= 102600
    on.execute(std::forward<Work>(work));
#else
    asio::execution::execute(on, std::forward<Work>(work));
#endif
}

} // namespace ise::compat
