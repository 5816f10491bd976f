// environment-boundary: the signals of a program are handled here, for programs only
#include <ise/component/node.hpp>

#include <asio/io_context.hpp>
#include <asio/signal_set.hpp>

#include <csignal>
#include <thread>

namespace ise {

int run_until_signal(node& running, const std::function<void()>& on_started) {
    // A context of its own: the signals are the program's, not a component's.
    asio::io_context context(1);
    asio::signal_set signals(context, SIGINT, SIGTERM);
    signals.async_wait([&](std::error_code problem, int) {
        if (!problem) running.stop();
    });
    std::thread watcher([&] { context.run(); });
    if (on_started) on_started();
    running.wait();
    context.stop();
    watcher.join();
    for (const auto& report : running.reports())
        if (!report.failure.empty()) return 1;
    return 0;
}

} // namespace ise
