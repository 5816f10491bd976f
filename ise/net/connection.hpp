#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/object_stream.hpp>
#include <ise/core/result.hpp>
#include <ise/core/stream.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/core/verified_peer.hpp>
#include <ise/net/heartbeats.hpp>
#include <ise/net/outbox.hpp>
#include <ise/transport/datagram_stream.hpp>
#include <ise/transport/loans.hpp>
#include <ise/wire/messages.hpp>
#include <ise/wire/parser.hpp>
#include <ise/wire/pieces.hpp>

#include <asio/buffer.hpp>

#include <memory>
#include <string>

namespace ise::net {

/// Counts of one connection since it was made; what `ise` and tests look at.
struct connection_counts {
    std::uint64_t frames_in = 0;
    std::uint64_t frames_out_batches = 0;
    std::uint64_t bytes_in = 0;
    std::uint64_t bytes_out = 0;
};

/// What counts of a peer's identity once it has greeted.
struct session_peer {
    std::string path;              ///< of the component; empty for an anonymous client
    std::uint64_t incarnation = 0; ///< one life of the component
    std::uint64_t epoch = 0;       ///< of its name, 0 if none was granted
    std::uint64_t reply_key = 0;   ///< of an initiator: see wire::hello
    verified_peer verified;        ///< what this side has verified of it; `who` once there is a session

    session_peer() = default;
    explicit session_peer(wire::identity greeted)
        : path(std::move(greeted.path)), incarnation(greeted.incarnation), epoch(greeted.epoch) {}
};

/// How the two sides agreed to talk, and with whom.
struct session_terms {
    std::uint16_t version = 0;
    std::uint64_t features = 0;
    session_peer peer;
    wire::limits we_accept;
    wire::limits peer_accepts;
    peer_clock clock; ///< as far as the handshake told
};

/// One session with a peer over a stream: frames in, an outbox out, heartbeats, an end with a cause.
///
/// Every frame is handed to the `user`, in one turn of the loop for all that one read brought; what is written in a
/// turn leaves in one gathered write. It needs no coroutine: there is a reader only where the transport has to be asked
/// for bytes, and a writer only while the socket is full.
/// Whatever breaks (a write as well as a read) ends it for both directions, once, with its cause. Lives on one
/// loop; shared by its scope, its coroutines and its user.
/// Bytes come to the parser in one way: the transport, or the reader, puts them into `room()`. Over datagrams, packets
/// of subscriptions are messages of their own beside the stream (`lossy()`). Within a process the parser takes over
/// whole buffers, and packets need no bytes: objects travel beside their frames (`passes_objects()`). Over
/// shared memory large packets stay where they are, and their frames refer to them (`loan_memory()`).
class connection final : public std::enable_shared_from_this<connection>,
                         public flushable,
                         public task_scope::member,
                         private stream_reader,
                         public datagram_stream::user,
                         public object_stream::user {
public:
    /// Who understands the frames. Called inside a turn of the loop, and not destroyed from within a call; a frame's
    /// body is valid during the call only.
    class user {
    public:
        /// A failure ends the connection: the peer broke the protocol.
        virtual result<void> on_frame(const carried_frame& received) = 0;
        /// Called after a read, or a datagram, that leaves something incomplete (`unfinished_bytes()`). A failure as
        /// above.
        virtual result<void> on_unfinished() { return {}; }
        /// The last call, exactly once, never from within a call of the user.
        virtual void on_closed(const failure& cause) = 0;

    protected:
        ~user() = default;
    };

    connection(loop& on, std::unique_ptr<stream> transport, session_terms terms, wire::parser parser);
    ~connection();

    /// Begins to read, owned by `scope` until it has ended; frames that came together with the handshake may be handed
    /// over at once, and the connection may have ended when this returns. `receiver` is held weakly: a session that is
    /// gone ends the connection.
    void start(task_scope& scope, std::weak_ptr<user> receiver);

    /// Where frames are put; `written()` afterwards sees to it that they leave.
    outbox& out() noexcept { return outbox_; }
    void written() {
        if (!flush_due()) on_.flush_later(*this);
    }
    void flush() override;
    /// Much waits that may not be dropped: it is written now, while it is still in the processor's cache, unless the
    /// socket is full, or it is being written already.
    void written_much() {
        if (writer_ != writer::waiting && !batch_) flush();
    }

    /// The system holds at most about this many bytes that were not sent yet, and one write begins with at most twice
    /// as many, unless the system took those before at once.
    void limit_unsent(std::size_t most) {
        transport_->limit_unsent(most);
        outbox_.limit_batch(2 * most);
    }

    /// The peer hears something four times in the time that it asked for.
    void sign_often() {
        signs_->quicken();
        pulse();
    }

    /// Sends what waits for at most `grace`, tells the peer why, then closes.
    void finish(failure why, duration grace);
    /// Requests of which no byte was written, for the user's `on_closed`, who may take their objects.
    void take_unwritten(const std::function<void(const carried_frame&)>& visit);
    /// Ends it now. The first cause stays.
    void close(failure cause);
    bool open() const noexcept { return phase_ < phase::closed; }
    /// Packets may be lost and come late; everything else arrives, whole and in order.
    bool lossy() const noexcept { return datagrams_ != nullptr; }
    /// Whether both sides are in one process and agreed to hand packets over as they are.
    bool passes_objects() const noexcept { return objects_ != nullptr; }
    /// Memory for large packets that are published over it and not copied; null: there is none.
    large_memory_source* loan_memory() const noexcept { return loans_ ? loans_->memory() : nullptr; }
    /// Only where `!open()`.
    const failure& cause() const noexcept { return *cause_; }

    const session_terms& terms() const noexcept { return terms_; }
    /// Sets the peer's identity by the access policy.
    void identify_peer(std::string who) { terms_.peer.verified.who = std::move(who); }
    /// The peer for people: its path if it has one, and its address.
    const std::string& peer_name() const noexcept { return peer_name_; }
    const connection_counts& counts() const noexcept { return counts_; }
    /// Whether published packets carry their time.
    bool tells_stamps() const noexcept { return terms_.features & wire::feature::stamps; }
    /// Whether both sides know traces of 128 bits.
    bool tells_traces() const noexcept { return terms_.features & wire::feature::traces; }
    /// Whether both sides know traces of published packets.
    bool tells_packet_traces() const noexcept { return terms_.features & wire::feature::packet_traces; }
    /// Whether deadlines are told as times of the receiver's clock.
    bool tells_clock() const noexcept { return terms_.features & wire::feature::clock; }
    /// Whether that clock is known here (`terms().clock`), and deadlines can be told so.
    bool knows_clock() const noexcept { return tells_clock() && terms_.clock.known(); }
    /// The last measured round trip of a heartbeat; zero before the first.
    duration round_trip() const noexcept { return alive_.round_trip(); }
    /// Bytes of frames, of messages in pieces and, over datagrams, of packets, of which a part is missing.
    std::uint64_t unfinished_bytes() const noexcept {
        return parser_.pending() + (reassembly_ ? reassembly_->bytes_held() : 0) +
               (datagrams_ ? datagrams_->bytes_held() : 0);
    }
    time_point last_heard() const noexcept { return alive_.last_heard(); }
    /// The last thing heard was its node, which says that the peer is busy.
    bool peer_stalled() const noexcept { return stalled_sign_ != 0 && stalled_sign_ == counts_.frames_in; }
    /// For who answers in this side's place while its loop does not turn.
    const std::shared_ptr<heartbeat_sender>& signs() const noexcept { return signs_; }

private:
    enum class phase : std::uint8_t {
        open,
        finishing, // what waits is sent yet, and nothing new begins
        closed,
        reported, // the user knows
    };
    // The coroutine that waits while the socket is full.
    enum class writer : std::uint8_t {
        none,
        waiting, // for room
        writing, // there is room again
    };

    std::string name() const override { return "connection to " + peer_name(); }
    void cancel() override;
    task<> read(std::shared_ptr<connection> held);
    // Two locked instructions less than a lock.
    user* receiver() const noexcept { return user_.expired() ? nullptr : known_user_; }
    void begin_to_take();
    asio::mutable_buffer room() noexcept override;
    void on_bytes(const transfer& got) override;
    void end_for_read(const std::error_code& problem);
    void end_for_write(const std::error_code& problem);
    void end_for_memory();
    task<> write(std::shared_ptr<connection> held);
    void take_frames();
    void begin_piece();
    result<void> fill_piece(std::size_t count);
    result<void> take_assembled(result<std::optional<wire::assembled>> whole, user* receiver);
    result<void> take(const carried_frame& received, user* receiver);
    result<void> take_attached(carried_frame received, user* receiver);
    result<void> take_loan(carried_frame received, user* receiver);
    result<void> take_own(const carried_frame& received, user* receiver);
    static failure too_many_answers();
    void look_at_unfinished();
    void on_heard() override;
    void on_message(bytes_view message) override;
    void on_passed(buffer& content, ring<passed_object>& attachments) override;
    void on_room() override { written(); }
    void on_sign() override;
    void end_for(const failure& wrong);
    void pulse();
    bool write_calls();
    void write_out();
    void say_goodbye();
    void report_end();

    loop& on_;
    std::unique_ptr<stream> transport_;
    datagram_stream* datagrams_ = nullptr;       // the same, where it is one
    object_stream* objects_ = nullptr;           // the same, where it is one and objects were agreed on
    loans* loans_ = nullptr;                     // the same, where it is one and loans were agreed on
    ring<passed_object>* attachments_ = nullptr; // of the frames that are being taken
    session_terms terms_;
    std::shared_ptr<heartbeat_sender> signs_;
    std::string peer_name_;
    wire::parser parser_;
    std::unique_ptr<wire::reassembly> reassembly_; // once a piece has come
    outbox outbox_;
    std::unique_ptr<batch> batch_; // while it is being written
    spare_batch& spare_;
    timer heartbeat_;
    std::unique_ptr<timer> grace_; // once it finishes
    std::weak_ptr<user> user_;
    user* known_user_ = nullptr; // the same, while it is there
    std::unique_ptr<failure> cause_;
    connection_counts counts_;
    liveness alive_;
    std::uint64_t stalled_sign_ = 0; // which frame it was
    phase phase_ = phase::open;
    writer writer_ = writer::none;
    std::unique_ptr<failure> farewell_; // goodbye is to be said once everything else was sent
};

} // namespace ise::net
