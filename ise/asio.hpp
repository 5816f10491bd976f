#pragma once
/// ISE in programs of Asio: `ise::async_run` starts an `ise::task` from Asio, with any completion token; in a task,
/// `co_await` takes an `asio::awaitable` and, with the token `ise::use_task`, any operation of Asio. A component gives
/// its executor, runs on one of the program's, and calls with a completion token.
#include <ise/core/async_run.hpp>
#include <ise/core/use_task.hpp>
#include <ise/service/asio_edge.hpp>
