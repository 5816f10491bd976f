#pragma once
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>
#include <ise/core/time.hpp>

#include <string>
#include <utility>
#include <vector>

namespace ise {

/// What is asked of an HTTP server.
struct http_exchange {
    std::string method = "GET";
    std::string url; ///< "https://host/path?query"
    std::vector<std::pair<std::string, std::string>> headers;
    std::string body;
};

/// What it answered, whatever the status.
struct http_answer {
    int status = 0;
    std::vector<std::pair<std::string, std::string>> headers; ///< names in lower case
    std::string body;
};

/// Asks HTTP servers: libcurl in the real world (components/curl), over the environment's streams in the virtual one.
/// Lifetime: outlives its exchanges. Used on one loop.
class http_client {
public:
    virtual ~http_client() = default;

    /// One request and its answer, of at most `max_answer_bytes` (1 MiB).
    /// Errors: invalid_argument (no such URL), unreachable (name, address, TLS: nothing was sent), timed_out and
    /// peer_lost (unknown whether the server acted), too_large. Cancellation: terminal, the transfer ends.
    virtual task<result<http_answer>> exchange(http_exchange what, duration within) = 0;

    static constexpr std::size_t max_answer_bytes = 1 << 20;
};

} // namespace ise
