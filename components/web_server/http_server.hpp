#pragma once
#include <components/http/http_requests.hpp>
#include <components/web_server/assets.hpp>
#include <components/web_server/sse_channel.hpp>

#include <ise/core/loop.hpp>
#include <ise/core/task.hpp>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace atirma {

/// What a stranger can cost the server at most.
struct http_limits {
    /// Beyond it `ise::net::fair_places` decides. `listen` raises the process's limit of open files as far as it may,
    /// and accepts fewer where that is too low.
    std::size_t max_connections = 4000;
    std::size_t max_url_bytes = 2048;
    std::size_t max_header_bytes = 8 * 1024; ///< of all, with the first line
    std::size_t max_header_fields = 64;
    std::size_t max_body_bytes = 4096;              ///< nothing here takes a body
    std::chrono::seconds request_timeout{15};       ///< to send a whole request, and for an idle connection
    std::chrono::seconds write_timeout{90};         ///< to take a whole answer or event: a long track over a slow phone
    std::chrono::seconds silent_stream_timeout{60}; ///< a stream nobody writes to (see sse_channel::tick) ends
    sse_limits streams;                             ///< beyond `max_clients` `ise::net::fair_places` decides
};

struct http_options {
    std::string address = "127.0.0.1"; ///< numeric, IPv4 or IPv6
    std::uint16_t port = 8080;         ///< 0: the system chooses, see `http_server::port`
    http_limits limits;
    /// Told about handlers that threw (the client only sees "500") and limits of the system that are too low, one line
    /// each.
    std::function<void(std::string_view)> log;
};

struct http_request {
    std::string path;  ///< "/track.gpx"
    std::string query; ///< undecoded, without the '?'
};

struct http_reply {
    std::string body;
    std::string content_type = "application/json; charset=utf-8";
    int status = 200;
    std::string download_as; ///< file name offered to the user; empty: shown
};

struct http_statistics {
    std::uint64_t connections = 0;
    std::uint64_t connections_refused = 0;   ///< beyond max_connections
    std::uint64_t connections_displaced = 0; ///< made way for others, streams included
    std::uint64_t requests = 0;
    std::uint64_t handlers_failed = 0;
    std::size_t open_connections = 0;
};

/// A read-only HTTP/1.1 server over the environment's streams: embedded files, GET (and HEAD) handlers, event
/// streams. Every answer carries security headers that let the page load only from this server.
///
/// Used on one loop. What `stop` cut off is released by the loop's next turns; the coroutines hold what they use.
class http_server {
public:
    using handler = std::function<http_reply(const http_request&)>;
    /// Starts a coroutine that somebody else owns: a component's `spawn`.
    using spawner = std::function<void(std::string name, ise::task<> body)>;

    http_server(ise::loop& on, http_options options, spawner spawn);
    ~http_server(); ///< stops
    http_server(const http_server&) = delete;
    http_server& operator=(const http_server&) = delete;

    /// Serves files by their paths, "/index.html" also as "/". The memory behind them outlives the server.
    void serve(std::span<const asset> files);
    /// Serves one of these files under another path as well. `framed`: pages of other sites may show it in a frame.
    void serve_as(std::string path, std::string file, bool framed = false);
    /// Serves what `h` makes on each GET of `path`. Anything it throws is a 500 and is told to `log`.
    void get(std::string path, handler h);
    /// An event stream at `path`; the reference is valid as long as the server.
    sse_channel& events(std::string path, sse_channel::snapshot_source snapshot);

    /// Binds and accepts. Throws `ise::error`: `address_in_use`, `invalid_argument` (no numeric address) or
    /// `io_failed`, with the address in the text; the server can then be told to listen again.
    void listen();
    /// The port that is bound; 0 where it does not listen.
    std::uint16_t port() const noexcept;
    /// "http://127.0.0.1:8080/"
    std::string url() const;
    /// Closes the listener, every stream and every connection. Streams refuse clients afterwards. Idempotent.
    void stop() noexcept;

    http_statistics statistics() const noexcept;

private:
    struct implementation;
    std::shared_ptr<implementation> self_;
};

} // namespace atirma
