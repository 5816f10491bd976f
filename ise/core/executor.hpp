#pragma once
#include <asio/any_io_executor.hpp>

#include <typeinfo>

namespace ise {

/// The executor inside, if it is an `Executor`, else null. (In Asio 1.22 `target()` itself does not look.) The order of
/// the comparison matters: where `Executor` is local to its file, names need not be compared.
template <class Executor>
const Executor* executor_cast(const asio::any_io_executor& on) noexcept {
    return on && typeid(Executor) == on.target_type() ? on.target<Executor>() : nullptr;
}

} // namespace ise
