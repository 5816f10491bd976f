#pragma once
#include <ise/http/http_requests.hpp>
#include <ise/http/http_stream.hpp>
#include <ise/http/sse_channel.hpp>
#include <ise/http/web_socket.hpp>

#include <ise/core/endpoint.hpp>
#include <ise/core/log.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace ise {

/// What peers can cost a server at most.
struct http_limits {
    /// Beyond it `net::fair_places` decides; refused connections are answered 503. `listen` raises the process's
    /// limit of open files as far as it may, and accepts fewer connections where that is too low.
    std::size_t max_connections = 32;
    std::size_t max_requests = 1000; ///< of one connection
    /// Bodies of whole responses that one host has asked for and not taken yet; a body that several of its connections
    /// wait for counts once. Beyond it the host is answered 503.
    std::size_t max_unsent_bytes = 32 << 20;
    http_reader_limits message;
    http_times times;
    http_stream_times sending; ///< `write` also bounds sending a whole response
    web_socket_limits web_sockets;
    web_socket_times web_socket;
    sse_limits streams; ///< of each path; beyond `max_clients` `net::fair_places` decides
};

struct http_request {
    http_message message;
    std::string path;  ///< "/track.gpx"
    std::string query; ///< undecoded, without the '?'
    std::string peer;  ///< "tcp://10.0.0.2:40112"
};

/// A file that lies in the program. Everything it refers to outlives the server.
struct static_file {
    std::string_view path;         ///< "/app.js"
    std::string_view content_type; ///< "text/javascript; charset=utf-8"
    std::string_view bytes;
    std::string_view gzip; ///< the same, compressed; empty where that is no smaller
    std::string_view etag; ///< quoted, strong for `bytes`
};

/// The bytes of a response. Copies share them.
class http_body {
public:
    http_body() = default;
    http_body(std::string text) : owned_(std::make_shared<const std::string>(std::move(text))), bytes_(*owned_) {}
    http_body(const char* text) : http_body(std::string(text)) {}
    /// Bytes that outlive every response that has them.
    static http_body in_place(std::string_view lasting) {
        http_body made;
        made.bytes_ = lasting;
        return made;
    }
    std::string_view bytes() const noexcept { return bytes_; }
    /// The string that holds the bytes; null: the body owns none.
    const std::string* owned() const noexcept { return owned_.get(); }

private:
    std::shared_ptr<const std::string> owned_;
    std::string_view bytes_;
};

struct http_response {
    http_body body;
    std::string content_type = "text/plain; charset=utf-8";
    int status = 200;
    std::string download_as;                                  ///< file name offered to the user; empty: shown
    std::vector<std::pair<std::string, std::string>> headers; ///< beside those that every response has
    http_body gzip;                                           ///< the same, compressed, for clients that take it
    std::string etag;    ///< quoted, strong for `body`; a client that has it is answered 304. Empty: not to be kept
    bool framed = false; ///< pages of other sites may show it in a frame
    /// Makes the body while it is sent, in place of `body`; the connection ends with it.
    std::function<task<>(std::shared_ptr<http_stream>)> stream;
    /// With status 101 (`accept_web_socket`): talks over the WebSocket that the connection becomes, until its `next()`
    /// returns nothing.
    std::function<task<>(std::shared_ptr<web_socket>)> upgrade;
};

/// The response to a request for a WebSocket, which becomes one with the first of `protocols` that the client offers
/// (Sec-WebSocket-Protocol; empty: without one). Else, where the handshake is wrong or no protocol is offered, an error
/// (400 or 426) with its reason.
http_response accept_web_socket(const http_request& asked, const std::vector<std::string>& protocols,
                                std::function<task<>(std::shared_ptr<web_socket>)> talk);

struct http_statistics {
    std::uint64_t connections = 0;
    std::uint64_t connections_refused = 0;   ///< beyond max_connections
    std::uint64_t connections_displaced = 0; ///< made way for others, streams included
    std::uint64_t requests = 0;
    std::uint64_t requests_refused = 0; ///< malformed, too large, or not complete in time
    std::uint64_t handlers_failed = 0;
    std::uint64_t web_sockets = 0; ///< accepted
    std::size_t open_connections = 0;
};

/// An HTTP/1.1 server over the environment's streams, on the real and on the virtual world: handlers, embedded files,
/// event streams, and WebSockets. Requests of a connection are answered one after the other. Every response carries
/// security headers that let a page load only from this server. There is no TLS: use a reverse proxy.
///
/// Used on one loop. Connections that `stop` closed are released by the loop's next turns.
class http_server {
public:
    /// Makes the response. What it throws is logged and answered 500. Ends before what it refers to: with the spawner's
    /// owner.
    using handler = std::function<task<http_response>(http_request)>;
    using quick_handler = std::function<http_response(const http_request&)>;
    /// The text of an error that the server itself answers with.
    using error_page = std::function<http_response(int status, std::string_view what)>;
    /// Starts a coroutine that somebody else owns: a component's `spawn`.
    using spawner = std::function<void(std::string name, task<> body)>;

    http_server(loop& on, logger log, http_limits limits, spawner spawn);
    ~http_server(); ///< stops
    http_server(const http_server&) = delete;
    http_server& operator=(const http_server&) = delete;

    /// Serves files by their paths, "/index.html" also as "/".
    void serve(std::span<const static_file> files);
    /// Serves one of these files under another path as well. `framed`: pages of other sites may show it in a frame.
    /// `link`: a Link header of it, such as `<now.json>; rel=preload; as=fetch`; empty: none.
    void serve_as(std::string path, std::string file, bool framed = false, std::string link = {});
    /// Answers each GET (and HEAD) of `path`.
    void get(std::string path, handler answer);
    void get(std::string path, quick_handler answer);
    /// Answers every request for which there is nothing else, whatever its method. Default: 404, and 405 for methods
    /// other than GET and HEAD.
    void otherwise(handler answer);
    void otherwise(quick_handler answer);
    /// Lets pages load pictures from another origin, too: "https://tiles.example.org".
    void allow_images(std::string origin);
    /// Default: one line of plain text.
    void on_error(error_page page);
    /// An event stream at `path`; the reference is valid as long as the server. Throws error: invalid_argument (a
    /// second one at that path).
    sse_channel& events(std::string path, sse_channel::snapshot_source snapshot);

    /// Listens and accepts connections. Errors: address_in_use, invalid_argument, io_failed; then it may be called
    /// again.
    result<void> listen(const endpoint& at);
    /// Where it listens, with the real port; empty where it does not.
    endpoint where() const;
    /// "http://127.0.0.1:8080/"
    std::string url() const;
    /// Closes the listener, every stream and every connection. Streams refuse clients afterwards. Idempotent.
    void stop() noexcept;

    http_statistics statistics() const noexcept;

private:
    struct implementation;
    std::shared_ptr<implementation> self_;
};

} // namespace ise
