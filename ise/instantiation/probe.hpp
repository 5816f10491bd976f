#pragma once
#include <ise/core/environment.hpp>

#include <memory>
#include <string>
#include <string_view>

namespace ise::instantiation {

/// What a health probe asks: a TCP endpoint that accepts a connection, or an HTTP resource with a status from 200 to
/// 399.
struct probe_target {
    endpoint at;
    bool http = false;
    std::string path; ///< of http
};

/// Reads "tcp://127.0.0.1:8080" or "http://127.0.0.1:8080/path". errc::invalid_argument says how it is written.
result<probe_target> parse_probe(std::string_view text);

/// Asks once, within `limit` once the connection is made; the time to connect is bounded by the system. The error says
/// why there was no good answer. Cancellation: terminal.
task<result<void>> probe(loop& on, probe_target target, duration limit);

} // namespace ise::instantiation
