#pragma once
#include <ise/http/http_requests.hpp>
#include <ise/http/web_socket_frames.hpp>

#include <ise/core/loop.hpp>
#include <ise/core/task.hpp>
#include <ise/core/waiter.hpp>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace ise {

struct web_socket_times {
    duration write = std::chrono::seconds(30);     ///< for the client to take one write; then it is disconnected
    duration ping = std::chrono::seconds(1);       ///< between pings while data is sent
    duration idle_ping = std::chrono::seconds(15); ///< between pings otherwise
    /// No data is sent while a ping has been unanswered for this long: what is sent but not received is bounded in
    /// time, and what waits can still be replaced by something newer.
    duration hold = std::chrono::seconds(1);
    duration lost = std::chrono::seconds(30);   ///< a client that does not answer a ping for so long is disconnected
    duration closing = std::chrono::seconds(5); ///< for the client to answer a close frame
};

/// Counts of a connection.
struct web_socket_counts {
    std::uint64_t received = 0; ///< messages
    std::uint64_t sent_bytes = 0;
    duration round_trip{}; ///< of the last ping
    bool held = false;     ///< nothing is sent now, as a ping is not answered
};

/// The server's end of a WebSocket. Data is pulled: whenever the connection has room, `on_room` is asked for what is
/// to be sent next, so that a slow client holds no more than one batch. Used on one loop.
class web_socket {
public:
    /// Appends whole frames (web_socket_frames.hpp) to be sent next, or nothing.
    using source = std::function<void(std::string& to)>;

    web_socket(loop& on, std::shared_ptr<http_requests> over, web_socket_limits limits, web_socket_times times);

    /// The next text or binary message of the client; nothing once the connection is over, which includes the closing
    /// handshake: call it until then. Pings and close frames are answered here; a violation of the protocol closes the
    /// connection with its code. Cancellation: terminal.
    task<std::optional<web_socket_message>> next();
    /// Replaces what is asked for data; null: nothing.
    void on_room(source fill) { fill_ = std::move(fill); }
    /// There is something to be sent: `on_room` is asked soon.
    void wake();
    /// Sends a close frame after what is being sent, and ends the connection. Idempotent: the first code counts.
    void close(web_socket_code code, std::string reason);
    /// Ends the connection at once.
    void abort() noexcept;

    bool over() const noexcept { return closing_.has_value() || aborted_; } ///< it is being closed, or is closed
    /// Why it was closed; empty: it is not, or the client left.
    const std::string& cause() const noexcept { return cause_; }
    const web_socket_counts& counts() const noexcept { return counts_; }

    /// The writing half: sends until the connection is over. Started once, by the server. Cancellation: terminal.
    static task<> write(std::shared_ptr<web_socket> self);

private:
    struct closing {
        web_socket_code code;
        std::string reason;
    };
    void end(web_socket_code code, std::string reason);
    void on_pong(std::string_view payload);
    void on_timer();
    bool held() const;
    void collect(std::string& to);

    loop& loop_;
    std::shared_ptr<http_requests> over_;
    web_socket_reader reader_;
    web_socket_times times_;
    source fill_;
    bytes_view rest_;
    std::string control_; // frames that go first
    std::optional<closing> closing_;
    bool close_sent_ = false, aborted_ = false;
    std::size_t unread_ = 0; // bytes that came after the end
    std::string cause_;
    std::uint64_t ping_ = 0; // its number
    bool ping_unanswered_ = false;
    time_point pinged_at_{};
    web_socket_counts counts_;
    waiter<std::error_code> room_;
    bool woken_ = false;
    timer timer_;
};

} // namespace ise
