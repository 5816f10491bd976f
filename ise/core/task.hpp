#pragma once
#include <ise/core/asio_configuration.hpp>

#include <asio/awaitable.hpp>

namespace ise {

/// A coroutine of ISE: Asio's awaitable, so that it composes with any Asio code of the embedding program.
template <class T = void>
using task = asio::awaitable<T>;

} // namespace ise
