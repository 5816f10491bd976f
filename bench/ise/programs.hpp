#pragma once
#include "../support/report.hpp"
#include "packets.hpp"

#include <ise/ise.hpp>

#include <memory>
#include <string>

namespace bench {

/// Of kind `ise`, a program is written as the documentation writes it: handlers are coroutines, `co_await call`,
/// `co_await send`, `co_await next`. Of kind `ise-fast` it uses what the interface offers to those in a hurry: plain
/// functions as handlers, calls with a callback, `try_send`, `try_next`. Kind `ise-poll` is `ise` on nodes that poll
/// for 50 µs. Kind `ise-dynamic` calls, one after the other, a service whose packets neither side has headers of.
bool in_a_hurry(const options& asked);

/// The component that serves one kind of work: the other side of a measurement.
std::unique_ptr<ise::component> make_call_server(const options& asked);
std::unique_ptr<ise::component> make_dynamic_server(const options& asked);
std::unique_ptr<ise::component> make_publisher(const options& asked);
std::unique_ptr<ise::component> make_pacer(const options& asked);
std::unique_ptr<ise::component> make_memory_teller();

/// Components of the measuring side; each tells its outcome to the collector.
class collector;
void start_callers(ise::node& node, const options& asked, const ise::endpoint& server, collector& into);
void start_dynamic_caller(ise::node& node, const options& asked, const ise::endpoint& server, collector& into);
void start_subscribers(ise::node& node, const options& asked, const ise::endpoint& server, collector& into);
void start_listener_of_pacer(ise::node& node, const options& asked, const ise::endpoint& server, collector& into);
void start_idlers(ise::node& node, const options& asked, const ise::endpoint& server, collector& into);

ise::node_options node_options();
/// For components that only ask.
ise::component_options asking(std::string together_with = {});
/// The same, on the server's loop where that was asked for.
inline ise::component_options beside_server(const options& asked) {
    return asking(asked.transport == "oneloop" ? "bench/server" : "");
}

/// When a measurement begins and ends.
struct span {
    std::int64_t begin_ns = 0, end_ns = 0;
    static span after_warm_up(const options& asked);
};

inline constexpr ise::duration generous = std::chrono::seconds(10); ///< the deadline of every call

/// Work `names`: a node at the name servers `--connect` with `--outstanding` components of `--services` services each,
/// from the number `--first` on.
void serve_names(const options& asked);
/// Prints a line of JSON of its own: how many of `--outstanding` names the name server resolves a second, measured for
/// `--seconds`; with 0 of these when it knew all.
void measure_names(const options& asked);

} // namespace bench
