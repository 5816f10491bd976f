#pragma once
#include <ise/transport/udp/association.hpp>
#include <ise/transport/udp/cookie.hpp>

#include <deque>
#include <map>
#include <memory>

namespace ise::net::udp {

/// What the channels of a socket are sealed with.
struct port_security {
    std::shared_ptr<const shared_key> key; ///< null: none
    std::shared_ptr<tls::identity> tls;    ///< in the place of the key; null: no certificates
};

/// One socket and all that is said over it. A listener's serves everybody who comes, a requester's one peer.
class port final : public association_port, public datagram_reader, public std::enable_shared_from_this<port> {
public:
    /// Channels that nobody has accepted yet; a stranger beyond asks again.
    static constexpr std::size_t max_waiting = 64;
    /// Channels whose user has left and that still send; others end at once.
    static constexpr std::size_t max_draining = 256;
    /// Channels that were refused and repeat that; others are forgotten at once.
    static constexpr std::size_t max_refusing = 64;

    port(loop& on, std::unique_ptr<datagram_socket> socket, bool listens, port_security with = port_security());
    ~port();

    void on_datagram(const endpoint& from, bytes_view content) override;
    void on_problem(const std::error_code& why) override;
    std::error_code send(const endpoint& to, bytes_view content) override {
        return closed_ ? std::error_code() : socket_->try_send(to, content);
    }
    std::unique_lock<std::mutex> lock() override { return std::unique_lock(mutex_); }
    buffer& scratch() noexcept override { return scratch_; }
    endpoint where() const { return socket_->where(); }

    struct woken {
        std::error_code problem; ///< operation_aborted: the waiting coroutine was cancelled
    };
    /// Until a channel is there or settled, the socket has a problem, or the port is closed. Cancellation: terminal.
    waiter<woken>::operation changed() noexcept { return changed_.wait(); }
    /// The last error of the socket, once.
    std::error_code take_problem() noexcept { return std::exchange(problem_, {}); }

    /// The next channel that a stranger opened, or null.
    std::shared_ptr<association> accepted();
    /// Nobody new is let in; the socket goes with the last channel.
    void stop_listening();
    /// Ends everything now.
    void close();
    bool closed() const noexcept { return closed_; }
    bool lets_drain() noexcept override;
    bool lets_refuse() noexcept override;
    void forget(association& gone) override;
    bool old_scheme() const noexcept override { return with_.key != nullptr; }
    void on_settled() override { changed_.resume(); }

    /// Opens a channel to `to`, asking again with growing pauses; `opened()` has it once the peer has answered.
    std::error_code dial(const endpoint& to);
    std::shared_ptr<association> opened() const noexcept { return dialled_; }

    std::size_t associations() const noexcept { return all_.size(); }

private:
    void on_open(const endpoint& from, const wire::datagram_view& received);
    void on_answer(const endpoint& from, const wire::datagram_view& received);
    void answer_opened(const association& to);
    std::error_code ask();
    std::uint64_t draw_id();
    std::unique_ptr<seal> make_seal(bool calls) const;

    loop& on_;
    std::unique_ptr<datagram_socket> socket_;
    std::mutex mutex_;
    buffer scratch_;
    port_security with_;
    bool listens_;
    bool accepting_;
    bool closed_ = false;
    std::map<std::uint64_t, std::shared_ptr<association>> all_;                           // by our id
    std::map<std::pair<endpoint, std::uint64_t>, std::shared_ptr<association>> openings_; // by what opened them
    std::deque<std::shared_ptr<association>> waiting_;
    std::size_t draining_ = 0, refusing_ = 0;
    cookie_jar jar_;
    waiter<woken> changed_;
    std::error_code problem_;

    // Dialling.
    endpoint target_;
    std::uint64_t dial_id_ = 0;
    wire::cookie cookie_{};
    timer again_;
    duration pause_{};
    std::shared_ptr<association> dialled_;
};

} // namespace ise::net::udp
