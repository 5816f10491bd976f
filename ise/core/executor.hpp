#pragma once
#include <asio/any_io_executor.hpp>

#include <typeinfo>

namespace ise {

/// The executor inside, if it is an `Executor`, else null. (In Asio 1.22 `target()` itself does not look.)
template <class Executor>
const Executor* executor_cast(const asio::any_io_executor& on) noexcept {
    return on && on.target_type() == typeid(Executor) ? on.target<Executor>() : nullptr;
}

} // namespace ise
