#pragma once
#include <asio/any_io_executor.hpp>

#include <typeinfo>

namespace ise {

/// The executor of type `Executor` that `on` holds, or null. (Asio's own `target<>()` casts without looking.)
template <class Executor>
const Executor* target_of(const asio::any_io_executor& on) noexcept {
    return on && on.target_type() == typeid(Executor) ? on.target<Executor>() : nullptr;
}

} // namespace ise
