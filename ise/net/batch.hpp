#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/bytes.hpp>
#include <ise/core/passed_object.hpp>
#include <ise/core/ring.hpp>
#include <ise/net/carried_frame.hpp>
#include <ise/packet/shared_bytes.hpp>
#include <ise/wire/frame.hpp>

#include <asio/buffer.hpp>

#include <functional>
#include <memory>
#include <span>
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
    /// Takes over a whole buffer as content and gives back an empty one with room.
    void adopt(buffer& content) {
        if (empty()) staging_ = std::move(content); // they change places
        else if (adopted_.empty()) adopt_behind(content);
        else { // the one before is not written yet
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
    void adopt_behind(buffer& content);
    std::span<const asio::const_buffer> remaining_segments();
    buffer& gather();
    void close_staged();
    void refer_to(bytes_view content);

    buffer staging_;
    buffer adopted_;
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

/// The batches of all connections of a loop (`loop::common`): a connection has one only while something is being
/// written, and what it grew to serves the next one.
class batch_pool {
public:
    std::unique_ptr<batch> lend() {
        if (unused_.empty()) return std::make_unique<batch>();
        auto lent = std::move(unused_.back());
        unused_.pop_back();
        return lent;
    }
    /// Takes an empty one back.
    void take_back(std::unique_ptr<batch> unused) {
        if (unused_.size() < kept) unused_.push_back(std::move(unused));
    }

private:
    static constexpr std::size_t kept = 2; // more are in use only where several sockets are full

    std::vector<std::unique_ptr<batch>> unused_;
};

} // namespace ise::net
