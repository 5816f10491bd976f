#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/bytes.hpp>
#include <ise/core/passed_object.hpp>
#include <ise/core/ring.hpp>
#include <ise/net/carried_frame.hpp>
#include <ise/packet/shared_bytes.hpp>
#include <ise/transport/loans.hpp>
#include <ise/transport/packet_lane.hpp>
#include <ise/wire/frame.hpp>

#include <asio/buffer.hpp>

#include <algorithm>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace ise::net {

/// What one gathered write holds: small things side by side in a staging buffer, big ones by reference with
/// their owner. Filled, written (perhaps in several goes), cleared.
class batch {
public:
    /// Room for small content; closed by the next `share`. Whoever appends to it says nothing more.
    buffer& staging() noexcept { return staging_; }

    /// Content that stays where it is; `owner` is held until it was written.
    void share(shared_bytes owner, bytes_view content);
    /// Takes small content out of a buffer, and leaves that empty with room.
    void adopt(buffer& content) {
        if (empty()) {
            staging_ = std::move(content); // they change places
        } else {
            staging_.append(content.view());
            content.clear();
        }
    }

    /// The object of the frame that was put last, which travels beside the bytes.
    void pass(passed_object object) {
        attached_weight_ += object.weight();
        attachments_.push_back(std::move(object));
    }
    /// Those of all frames, in their order.
    ring<passed_object>& attachments() noexcept { return attachments_; }

    std::size_t bytes() const noexcept { return shared_bytes_ + staging_.size(); }
    /// The same with what travels beside.
    std::size_t weight() const noexcept { return bytes() + attached_weight_; }
    bool empty() const noexcept { return bytes() == 0; }
    bool done() const noexcept { return written_ == bytes(); }
    std::size_t left() const noexcept { return bytes() - written_; }

    /// What is still to be written.
    std::span<const asio::const_buffer> remaining() {
        if (!segments_.empty()) return remaining_segments();
        whole_ = asio::const_buffer(staging_.data() + written_, staging_.size() - written_);
        return {&whole_, 1};
    }
    /// All of it in one buffer, whoever empties it; nothing of it was written yet.
    buffer& whole() { return segments_.empty() ? staging_ : gather(); }
    void advance(std::size_t count) noexcept { written_ += count; }
    void clear();

    /// The frames of which no byte was written: a body that does not lie in one piece is passed over.
    /// What has objects is written whole or not at all; they may be taken.
    void visit_unwritten(const std::function<void(const carried_frame&)>& visit);

private:
    struct segment {
        std::size_t begin = 0; // in the staging buffer, if `data` is null
        std::size_t size = 0;
        const std::byte* data = nullptr;
    };
    std::span<const asio::const_buffer> remaining_segments();
    buffer& gather();
    void close_staged();

    buffer staging_;
    buffer gathered_;
    std::vector<segment> segments_;
    std::vector<shared_bytes> owners_;
    std::vector<asio::const_buffer> views_;
    asio::const_buffer whole_;
    ring<passed_object> attachments_;
    std::size_t attached_weight_ = 0;
    std::size_t staged_ = 0; // bytes of the staging buffer that lie in segments
    std::size_t shared_bytes_ = 0;
    std::size_t written_ = 0;
};

/// The batch into which the connections of a loop write, one after the other (`loop::common`). A connection keeps it
/// only while its socket is full; then the next one gets another.
struct spare_batch {
    std::unique_ptr<batch> empty; ///< null while it is in use
    std::unique_ptr<batch> take() { return empty ? std::move(empty) : std::make_unique<batch>(); }
};

class outbox;

/// What a subscription has to send. It is asked when the connection has room, so that "keep latest" means the
/// latest at that moment.
class publication_source {
public:
    /// Hands over packets by `outbox::put_packet`, about `quantum` bytes of them, oldest first; returns whether
    /// more is left. Not asked again before a message that went into pieces is through.
    virtual bool take(outbox& out, std::size_t quantum) = 0;
    /// Its messages that go in pieces and are not through yet.
    std::size_t in_pieces() const noexcept { return in_pieces_; }

protected:
    ~publication_source() = default;

private:
    friend class outbox;
    bool pending_ = false;
    std::size_t in_pieces_ = 0;
    std::optional<std::uint64_t> in_lane_; // its key there
};

/// What waits to be written on one connection, in three classes: control goes first, then calls and replies, then
/// publications, fairly by bytes; messages beyond a frame go in interleaved pieces. Bounded; without I/O.
class outbox {
public:
    /// A message of up to this many bytes travels as one frame; a longer one in pieces.
    static constexpr std::size_t whole_bytes = 128 * 1024;
    static constexpr std::size_t piece_bytes = 64 * 1024; // the last piece may have twice as many
    /// One gathered write takes about this much, and up to four times as much while the system takes each at once.
    static constexpr std::size_t batch_bytes = 256 * 1024;
    /// Calls and replies are put side by side up to this size: such a block is written from where it lies.
    static constexpr std::size_t block_bytes = 64 * 1024;
    /// Or about this much, if it is less: what was moved to a write is out of the reach of priorities.
    void limit_batch(std::size_t most) noexcept {
        usual_batch_ = std::clamp<std::size_t>(most, 1, batch_bytes);
        batch_waits();
    }
    /// The system took a batch of so many bytes at once.
    void batch_went(std::size_t bytes) noexcept {
        if (bytes >= batch_limit_) batch_limit_ = std::min(2 * batch_limit_, 4 * usual_batch_);
    }
    /// It has no room for the rest of one.
    void batch_waits() noexcept { batch_limit_ = usual_batch_; }
    /// The longest message that the peer accepts; unfinished ones it holds up to twice that.
    void limit_messages(std::uint64_t max_bytes) noexcept { max_message_bytes_ = max_bytes; }

    /// Where a control frame is appended (`wire::put_frame`).
    buffer& control() noexcept { return control_; }
    const buffer& control() const noexcept { return control_; }

    /// Where the frame of a call or a reply is appended, followed by `end_call()`. It may be withdrawn before it is
    /// written: what a later frame relies on (a service's introduction) goes into `control()`.
    buffer& calls() noexcept { return calls_; }
    /// A frame was appended that begins at `start`. `packet`: what it has beside it (`wire::flag::attached`), if
    /// anything. Throws where there is no memory: the frame is to be truncated then, those before it wait as before.
    void end_call(std::size_t start, passed_object&& packet = passed_object());

    void add(publication_source& source);
    void remove(publication_source& source) noexcept;
    /// For sources: a packet frame. `head` is the part of the body before the shared payload.
    void put_packet(publication_source& from, wire::frame_header header, bytes_view head, const shared_bytes& payload);
    /// For sources: a packet frame, `head` is its body, with the packet beside it.
    void put_object(wire::frame_header header, bytes_view head, passed_object packet);
    /// For sources, where there is no lane: whole frames, one behind the other, each a packet that need not go in
    /// pieces. Where they do not bear it already (`addressed`), `id` is written into each.
    void put_frames(shared_bytes frames, std::uint64_t id, bool addressed);

    /// From now on packets go into `lane`, which lives as long as this, by `feed_lane` instead of `fill`.
    void use(packet_lane& lane) noexcept { lane_ = &lane; }
    void feed_lane();
    /// From now on large packets that lie in the memory of `with`, which lives as long as this, are loaned.
    void use(loans& with) noexcept { loans_ = &with; }
    /// Bytes that were loaned since this was asked last.
    std::uint64_t take_loaned_bytes() noexcept { return std::exchange(loaned_bytes_, 0); }

    /// Moves what goes into one write to the batch; false if nothing waits.
    bool fill(batch& out);

    /// True where nothing waits but calls and replies, all of them go into one write, and none was withdrawn: they may
    /// be written from where they lie. Whoever does that says so when they went whole, or moves them to a batch.
    bool calls_alone() const noexcept {
        return !calls_.empty() && calls_.size() + beside_weight_ <= batch_limit_ && blocks_.empty() &&
               withdrawn_ == 0 && control_.empty() && big_calls_.all.empty() && big_packets_.all.empty() &&
               (lane_ || sources_.empty());
    }
    ring<passed_object>& beside_calls() noexcept { return attachments_; }
    void calls_went() noexcept {
        calls_.recycle();
        beside_weight_ = 0;
    }
    void move_calls(batch& out);

    bool empty() const noexcept;
    /// Whether neither control frames nor calls and replies wait.
    bool calls_drained() const noexcept {
        return control_.empty() && blocks_.empty() && calls_.empty() && big_calls_.all.empty();
    }
    /// Whether a call or reply that goes in pieces is not through: frames behind it overtake it.
    bool big_calls_wait() const noexcept { return !big_calls_.all.empty(); }
    /// Bytes that wait, as far as they are here: packets that their sources still hold are not.
    std::size_t pending_bytes() const noexcept {
        return control_.size() + pending_call_bytes() + big_packets_.unsent_bytes;
    }
    std::size_t pending_call_bytes() const noexcept {
        return blocks_weight_ + calls_.size() + beside_weight_ + big_calls_.unsent_bytes;
    }

    /// Takes the requests that were never begun to be written; the body holds head and packet.
    void take_unwritten(const std::function<void(const carried_frame&)>& visit);
    /// A request that was given up: true if the peer will never have it whole, so that it need not be told. One of
    /// which pieces were written already is abandoned.
    bool withdraw(std::uint64_t request_id);

private:
    struct big_message {
        wire::frame_header header;
        bytes head; // before the payload
        shared_bytes owner;
        bytes_view payload;
        publication_source* source = nullptr; // publications
        std::uint64_t id = 0;                 // of its pieces
        std::size_t sent = 0;
        bool begun = false;
        std::size_t size() const noexcept { return head.size() + payload.size(); }
    };

    /// Frames of calls that wait, as many as go together.
    struct call_block {
        shared_bytes frames;
        std::size_t weight = 0; // with what is beside them
    };

    /// Messages of one class that go in pieces. Each class begins no more at once than half of what a receiver takes
    /// (FORMAT.md §6), so that neither waits for the other.
    struct big_messages {
        ring<big_message> all;
        std::size_t begun = 0;
        std::uint64_t begun_bytes = 0;
        std::size_t unsent_bytes = 0;

        void add(big_message one) {
            unsent_bytes += one.size();
            all.push_back(std::move(one));
        }
        void begins(const big_message& one) noexcept {
            ++begun;
            begun_bytes += one.size();
        }
        /// It is through, or given up.
        void ends(const big_message& one) noexcept {
            unsent_bytes -= one.size() - one.sent;
            if (!one.begun) return;
            --begun;
            begun_bytes -= one.size();
        }
    };
    bool may_begin(const big_messages& among, const big_message& one) const noexcept;

    shared_bytes add_block(std::size_t size);
    static std::byte* content_of(const call_block& block) noexcept {
        return const_cast<std::byte*>(block.frames.view().data());
    }
    template <class Visit>
    bool any_call(Visit visit);
    void drop_if_withdrawn(std::size_t which);
    void fill_calls(batch& out);
    bool put_loan(wire::frame_header header, bytes_view head, const shared_bytes& payload);
    bool fit_to_share() const noexcept { return withdrawn_ == 0 && attachments_.empty(); }
    void put_each(std::byte* frames, std::size_t size, batch& out);
    void fill_pieces(big_messages& from, batch& out);
    void fill_publications(batch& out);
    static void put_piece(big_message& message, batch& out);
    void put_abandoned(const big_message& message);

    buffer control_;
    ring<call_block> blocks_; // of the calls before those in calls_
    std::size_t blocks_weight_ = 0;
    buffer calls_;
    ring<passed_object> attachments_; // of the frames in blocks_ and calls_ that have one
    std::size_t beside_weight_ = 0;   // of those in calls_
    std::size_t withdrawn_ = 0;       // frames in blocks_ and calls_ that are not written
    big_messages big_calls_;
    big_messages big_packets_;
    ring<publication_source*> sources_;
    std::size_t batch_limit_ = batch_bytes;
    std::size_t usual_batch_ = batch_bytes;
    batch* filling_ = nullptr; // during fill_publications
    packet_lane* lane_ = nullptr;
    loans* loans_ = nullptr;
    std::uint64_t loaned_bytes_ = 0;
    std::uint64_t max_message_bytes_ = std::numeric_limits<std::uint64_t>::max();
    std::uint64_t next_piece_id_ = 1;
};

} // namespace ise::net
