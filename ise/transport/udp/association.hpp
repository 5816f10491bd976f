#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/waiter.hpp>
#include <ise/transport/datagram_stream.hpp>
#include <ise/transport/udp/channel.hpp>
#include <ise/transport/udp/seal.hpp>

#include <asio/buffer.hpp>

#include <mutex>

namespace ise::net::udp {

class association;

/// What a channel needs of the port that it goes over.
class association_port {
public:
    virtual std::error_code send(const endpoint& to, bytes_view content) = 0;
    /// Held where the socket is closed or a peer's address changes, and by whoever sends from another thread.
    virtual std::unique_lock<std::mutex> lock() = 0;
    /// For the datagram that is being made.
    virtual buffer& scratch() noexcept = 0;
    /// Whether a channel may still send what its user has left; until it is forgotten.
    virtual bool lets_drain() noexcept = 0;
    /// The same for one that has refused its peer and says so again when it is asked again.
    virtual bool lets_refuse() noexcept = 0;
    virtual void forget(association& gone) = 0;
    /// Without a seal: the key is proved by the old scheme here.
    virtual bool old_scheme() const noexcept = 0;
    /// It is clear now whether a channel has a session.
    virtual void on_settled() = 0;

protected:
    ~association_port() = default;
};

/// A channel with its peer's address, its timer, and whoever uses it: acts as the channel decides. Shared by its port,
/// which hands it datagrams, and the stream of its user.
class association final : public flushable, public std::enable_shared_from_this<association> {
public:
    /// How long what was written last is sent again after the user has left.
    static constexpr duration max_drain = std::chrono::seconds(3);
    /// How long a peer that was refused, and asks again because the refusal was lost, hears it again.
    static constexpr duration refusal_time = std::chrono::seconds(10);

    /// `with` seals it; null: it is plain.
    association(loop& on, std::shared_ptr<association_port> of, std::uint64_t id, std::uint64_t peer_id, endpoint peer,
                std::unique_ptr<seal> with = nullptr);

    std::uint64_t id() const noexcept { return id_; }
    const endpoint& peer() const noexcept { return peer_; }
    /// Where it was when the channel was opened.
    const endpoint& first_peer() const noexcept { return first_peer_; }
    const udp::channel& channel() const noexcept { return channel_; }
    /// Its user has left, and it sends what is left.
    bool drains() const noexcept { return drain_until_ && !refuses_; }
    /// Its user has left, and it repeats that there is no session.
    bool refuses() const noexcept { return refuses_; }

    // For the port, which holds it meanwhile.
    /// Of the side that opened it: says the first word.
    void begin();
    /// All of a data datagram, plain or sealed.
    void on_datagram(const endpoint& from, bytes_view datagram);
    void on_flight(const endpoint& from, bytes_view body);
    void on_sign(const endpoint& from, bytes_view datagram);
    /// Somebody says that the peer has left, or does not know us any more; where the channel is sealed that is not
    /// believed.
    void on_said_gone();
    /// The port is closed: nothing comes any more. `why`: the problem of its socket, if that is the cause.
    void on_port_closed(const std::error_code& why);
    void flush() override;

    // For the stream.
    /// Whether it is clear that there is a session, or that there is none.
    bool settled() const noexcept { return !seal_ || seal_->sealed() || verdict_; }
    const std::optional<failure>& verdict() const noexcept { return verdict_; }
    /// Whom the peer's certificate is about; null: it has shown none.
    const tls::subject* shown() const noexcept { return seal_ ? seal_->shown() : nullptr; }
    void deliver_to(stream_reader& reader) noexcept { reader_ = &reader; }
    void use(std::weak_ptr<datagram_stream::user> receiver);
    /// Nothing: it is to be waited for.
    std::optional<transfer> read(asio::mutable_buffer into);
    /// Until `read` gives something. Cancellation: terminal, ends only the wait.
    waiter<>::operation wait_readable() noexcept { return readable_.wait(); }
    transfer write(std::span<const asio::const_buffer> from);
    /// What stands in the way of writing; would_block: the window.
    std::error_code writable() const noexcept;
    waiter<>::operation wait_writable() noexcept {
        return writable_.wait();
    } ///< until `writable`. Cancellation: as `wait_readable`
    bool message_wanted() noexcept;
    void put_message(std::uint64_t key, const wire::frame_header& header, bytes_view head, const shared_bytes& payload);
    void forget_messages(std::uint64_t key) noexcept;
    void limit_unsent(std::size_t most) noexcept { channel_.out().limit_under_way(most); }
    void shutdown_write();
    /// The user goes. What was written is still sent, where somebody is there to hear the acks.
    void leave();
    /// From any thread.
    bool show_sign() noexcept;

private:
    struct candidate {
        endpoint where;
        std::uint64_t challenge = 0;
    };
    void soon() {
        if (!flush_due()) on_.flush_later(shared_from_this());
    }
    /// What is written may go.
    bool may_send() const noexcept { return !seal_ || plain_ || seal_->sealed(); }
    void on_gone();
    /// Of the side that opened it: where nobody reads, nothing is taken and acknowledged, so that the peer finds it
    /// silent.
    bool is_read() const noexcept { return !calls_ || reader_ || readable_.waiting() || woken_at_ == on_.now(); }
    void take(const endpoint& from, bytes_view body);
    void seal_it(buffer& datagram);
    void send_flight();
    bool repeats_refusal() const noexcept;
    void fail(const failure& why);
    void turn_away(bytes_view body);
    void on_timer();
    void hand_over();
    void rearm();
    void follow(const endpoint& from, const channel::events& happened);
    void send_probe(const endpoint& to, wire::chunk_type type, std::uint64_t value);
    void part(bool tell);

    loop& on_;
    std::shared_ptr<association_port> port_;
    std::uint64_t id_;
    const endpoint first_peer_;
    endpoint peer_; // changed under the port's lock: signs are sent from another thread
    std::unique_ptr<seal> seal_;
    std::optional<failure> verdict_;
    std::error_code broken_; // the socket
    bool calls_ = false;     // this side opened it
    bool heard_ = false;     // data came
    bool refused_ = false;   // by an alert, without a seal of this side
    bool refuses_ = false;
    bool plain_ = false; // though it would be sealed: whoever does not know of that is told
    time_point flight_at_ = time_point::max();
    duration flight_pause_{};
    udp::channel channel_;
    std::optional<candidate> candidate_;        // an address that the peer seems to have moved to
    std::weak_ptr<datagram_stream::user> user_; // lives as long as `reader_`
    stream_reader* reader_ = nullptr;           // what comes is handed over; null: it is read
    timer timer_;
    waiter<> readable_;
    time_point woken_at_{}; // the turn in which `readable_` was resumed last
    waiter<> writable_;
    std::optional<time_point> drain_until_;
    bool room_asked_ = false;
    bool left_ = false; // by its user
    bool gone_ = false; // no datagram leads anywhere
};

} // namespace ise::net::udp
