#include <ise/net/outbox.hpp>

#include <ise/core/limits.hpp>
#include <ise/wire/pieces.hpp>

#include <asio/buffer.hpp>

#include <algorithm>
#include <cassert>
#include <cstring>
#include <new>
#include <utility>

namespace ise::net {
namespace {

using wire::frame_header;
using wire::frame_type;

// Payloads up to this size are copied beside their header; longer ones go by reference.
constexpr std::size_t copied_bytes = 4 * 1024;
constexpr std::size_t quantum = 16 * 1024;

// Of frames one behind the other, until `visit` returns true; whether it did.
template <class Visit>
bool any_frame(std::byte* frames, std::size_t size, Visit visit) {
    for (std::size_t at = 0; at < size;) {
        const auto header = wire::read_header(frames + at);
        if (visit(frames + at, header)) return true;
        at += frame_header::size + header.length;
    }
    return false;
}

// A request that was withdrawn before it was written becomes this, which is no frame: a cancel has no body.
void mark_withdrawn(std::byte* frame) noexcept {
    detail::store_little(frame + 4, static_cast<std::uint8_t>(frame_type::cancel));
}
bool is_withdrawn(const frame_header& header) noexcept {
    return header.type == frame_type::cancel && header.length > 0;
}

} // namespace

void batch::close_staged() {
    if (staging_.size() == staged_) return;
    segment made;
    made.begin = staged_;
    made.size = staging_.size() - staged_;
    segments_.push_back(made);
    staged_ = staging_.size();
}

void batch::share(shared_bytes owner, bytes_view content) {
    owners_.push_back(std::move(owner));
    close_staged();
    segment made;
    made.size = content.size();
    made.data = content.data();
    segments_.push_back(made);
    shared_bytes_ += content.size();
}

std::span<const asio::const_buffer> batch::remaining_segments() {
    close_staged();
    views_.clear();
    std::size_t skip = written_;
    for (const auto& part : segments_) {
        if (skip >= part.size) {
            skip -= part.size;
            continue;
        }
        const std::byte* data = part.data ? part.data : staging_.data() + part.begin;
        views_.emplace_back(data + skip, part.size - skip);
        skip = 0;
    }
    return views_;
}

buffer& batch::gather() {
    gathered_.clear();
    gathered_.reserve(bytes());
    for (const auto& part : remaining_segments())
        gathered_.append({static_cast<const std::byte*>(part.data()), part.size()});
    return gathered_;
}

void batch::visit_unwritten(const std::function<void(const carried_frame&)>& visit) {
    std::size_t segment_at = 0; // where the segment begins in the whole
    std::size_t frame_at = 0;   // where the next frame does
    auto look = [&](bytes_view content) {
        // Headers are never split: they are put down together with what follows them in the staging buffer.
        while (frame_at < segment_at + content.size()) {
            auto rest = content.subspan(frame_at - segment_at);
            auto header = wire::read_header(rest.data());
            std::size_t size = wire::frame_header::size + header.length;
            passed_object object;
            if ((header.flags & wire::flag::attached) && !attachments_.empty()) object = attachments_.pop_front();
            if (frame_at >= written_ && size <= rest.size()) {
                carried_frame one;
                one.header = header;
                one.body = rest.subspan(wire::frame_header::size, header.length);
                one.object = object ? &object : nullptr;
                visit(one);
            }
            frame_at += size;
        }
        segment_at += content.size();
    };
    for (const auto& part : segments_) look({part.data ? part.data : staging_.data() + part.begin, part.size});
    look(staging_.view().subspan(staged_));
}

[[gnu::hot]] void batch::clear() {
    staging_.recycle();
    if (!segments_.empty()) {
        gathered_.recycle();
        segments_.clear();
        owners_.clear();
        staged_ = shared_bytes_ = 0;
    }
    if (!attachments_.empty()) attachments_.clear();
    attached_weight_ = written_ = 0;
}

[[gnu::hot]] void outbox::end_call(std::size_t start, passed_object&& packet) {
    const std::size_t size = calls_.size() - start;
    if (packet) {
        const auto weight = packet.weight();
        attachments_.push_back(std::move(packet));
        beside_weight_ += weight;
    } else if (size > whole_bytes) {
        big_message message;
        message.header = wire::read_header(calls_.data() + start);
        message.owner = start > 0 ? add_block(start) : shared_bytes(std::move(calls_));
        message.payload = message.owner.view().subspan(start + frame_header::size);
        message.id = next_piece_id_++;
        big_calls_.add(std::move(message));
        return;
    }
    if (calls_.size() < std::min(block_bytes, batch_limit_) && calls_.size() + beside_weight_ < batch_limit_) return;
    try {
        add_block(calls_.size());
    } catch (const std::bad_alloc&) { // they stay where they are, and the next is put behind them
    }
}

// Makes a block of the first `size` bytes of calls_, and returns all of it. An empty block is left, which does no harm,
// where there is no memory.
shared_bytes outbox::add_block(std::size_t size) {
    blocks_.push_back(call_block());
    shared_bytes all(std::move(calls_));
    auto& made = blocks_[blocks_.size() - 1];
    made.frames = all;
    made.frames.truncate(size);
    made.weight = size + std::exchange(beside_weight_, 0);
    blocks_weight_ += made.weight;
    return all;
}

[[gnu::hot]] void outbox::add(publication_source& source) {
    if (source.pending_) return;
    source.pending_ = true;
    // Behind its message in pieces, if there is one: a subscription's packets stay in order.
    if (source.in_pieces_ == 0) sources_.push_back(&source);
}

void outbox::remove(publication_source& source) noexcept {
    if (std::exchange(source.pending_, false))
        sources_.erase_if([&](publication_source* other) { return other == &source; });
    big_packets_.all.erase_if([&](const big_message& message) {
        if (message.source != &source) return false;
        if (message.begun) put_abandoned(message);
        big_packets_.ends(message);
        return true;
    });
    source.in_pieces_ = 0;
    if (const auto key = std::exchange(source.in_lane_, std::nullopt); key && lane_) lane_->forget(*key);
}

void outbox::put_packet(publication_source& from, frame_header header, bytes_view head, const shared_bytes& payload) {
    std::size_t size = head.size() + payload.size();
    header.length = static_cast<std::uint32_t>(size);
    if (lane_) {
        lane_->put(header.id, header, head, payload);
        from.in_lane_ = header.id;
        return;
    }
    assert(filling_);
    if (loans_ && payload.size() >= large_memory_source::min_bytes && put_loan(header, head, payload)) return;
    if (size > whole_bytes) {
        big_message message;
        message.header = header;
        message.head.assign(head.begin(), head.end());
        message.owner = payload;
        message.payload = payload.view();
        message.source = &from;
        message.id = next_piece_id_++;
        ++from.in_pieces_;
        big_packets_.add(std::move(message));
        return;
    }
    auto& staging = filling_->staging();
    if (payload.size() > copied_bytes) {
        wire::put_header(staging, header);
        staging.append(head);
        filling_->share(payload, payload.view());
        return;
    }
    std::byte* at = staging.grow(frame_header::size + size);
    wire::store_header(at, header);
    at = std::copy(head.begin(), head.end(), at + frame_header::size);
    if (payload.size() > 0) std::memcpy(at, payload.view().data(), payload.size());
}

// False: it cannot be loaned.
bool outbox::put_loan(frame_header header, bytes_view head, const shared_bytes& payload) {
    const auto loaned = loans_->loan(payload);
    if (!loaned) return false;
    header.flags |= wire::flag::attached;
    header.length = static_cast<std::uint32_t>(head.size() + loan_reference::bytes);
    auto& staging = filling_->staging();
    wire::put_header(staging, header);
    staging.append(head);
    loaned->put(staging);
    loaned_bytes_ += payload.size();
    return true;
}

void outbox::put_object(frame_header header, bytes_view head, passed_object packet) {
    assert(filling_);
    header.flags |= wire::flag::attached;
    header.length = static_cast<std::uint32_t>(head.size());
    wire::put_header(filling_->staging(), header);
    filling_->staging().append(head);
    filling_->pass(std::move(packet));
}

[[gnu::hot]] void outbox::put_frames(shared_bytes frames, std::uint64_t id, bool addressed) {
    assert(filling_);
    const auto content = frames.view();
    if (addressed && content.size() > copied_bytes) return filling_->share(std::move(frames), content);
    std::byte* at = filling_->staging().grow(content.size());
    std::memcpy(at, content.data(), content.size());
    if (addressed) return;
    for (const std::byte* end = at + content.size(); at < end;
         at += frame_header::size + detail::load_little<std::uint32_t>(at))
        detail::store_little(at + 8, id);
}

bool outbox::empty() const noexcept { return calls_drained() && big_packets_.all.empty() && sources_.empty(); }

// The receiver forgets the pieces that it has.
void outbox::put_abandoned(const big_message& message) {
    frame_header header;
    header.type = frame_type::piece;
    header.flags = wire::flag::abandoned;
    header.id = message.id;
    wire::put_header(control_, header);
}

[[gnu::hot]] bool outbox::fill(batch& out) {
    // One piece of each long message a round, and small things between them. Requests that were withdrawn leave nothing
    // to write, and others may wait behind them.
    while (out.weight() < batch_limit_ && !(lane_ ? calls_drained() : empty())) {
        if (!control_.empty()) {
            out.staging().append(control_.view());
            control_.clear();
        }
        fill_calls(out);
        if (!big_calls_.all.empty()) fill_pieces(big_calls_, out);
        if (!big_packets_.all.empty()) fill_pieces(big_packets_, out);
        if (!sources_.empty() && !lane_) fill_publications(out);
    }
    return !out.empty();
}

void outbox::move_calls(batch& out) {
    out.adopt(calls_);
    while (!attachments_.empty()) out.pass(attachments_.pop_front());
    beside_weight_ = 0;
}

void outbox::fill_calls(batch& out) {
    while (!blocks_.empty() && out.weight() < batch_limit_) {
        auto block = blocks_.pop_front();
        blocks_weight_ -= block.weight;
        const auto frames = block.frames.view();
        if (fit_to_share()) out.share(std::move(block.frames), frames);
        else put_each(content_of(block), frames.size(), out);
    }
    if (calls_.empty() || out.weight() >= batch_limit_) return;
    beside_weight_ = 0;
    if (fit_to_share()) return out.adopt(calls_);
    put_each(calls_.data(), calls_.size(), out);
    calls_.clear();
}

// Without those that were withdrawn, and with what is beside the others.
void outbox::put_each(std::byte* frames, std::size_t size, batch& out) {
    any_frame(frames, size, [&](const std::byte* frame, const frame_header& header) {
        passed_object object;
        if (header.flags & wire::flag::attached) object = attachments_.pop_front();
        if (is_withdrawn(header)) {
            --withdrawn_;
            return false;
        }
        out.staging().append({frame, frame_header::size + header.length});
        if (object) out.pass(std::move(object));
        return false;
    });
}

void outbox::put_piece(big_message& message, batch& out) {
    frame_header header;
    header.type = frame_type::piece;
    header.id = message.id;
    std::size_t start = out.staging().size();
    wire::put_header(out.staging(), header);
    std::size_t body_at = out.staging().size();
    if (!message.begun) {
        wire::piece_head head;
        head.type = message.header.type;
        head.flags = message.header.flags;
        head.id = message.header.id;
        head.length = message.size();
        head.put(out.staging());
        out.staging().append(bytes_view(message.head));
        message.sent = message.head.size();
        message.begun = true;
    }
    std::size_t offset = message.sent - message.head.size();
    std::size_t count = message.payload.size() - offset;
    if (count >= 2 * piece_bytes) count = piece_bytes; // a short rest is no piece of its own
    header.length = static_cast<std::uint32_t>(out.staging().size() - body_at + count);
    message.sent += count;
    if (message.sent == message.size()) header.flags = wire::flag::last;
    out.staging().patch_u32(start, header.length);
    detail::store_little(out.staging().data() + start + 5, header.flags);
    out.share(message.owner, message.payload.subspan(offset, count));
}

bool outbox::may_begin(const big_messages& among, const big_message& one) const noexcept {
    return among.begun == 0 ||
           (among.begun < limit::unfinished_messages / 2 && among.begun_bytes + one.size() <= max_message_bytes_);
}

void outbox::fill_pieces(big_messages& from, batch& out) {
    // One piece of each in turn.
    for (std::size_t round = from.all.size(); round > 0 && out.weight() < batch_limit_; --round) {
        big_message message = from.all.pop_front();
        if (!message.begun && !may_begin(from, message)) {
            from.all.push_back(std::move(message));
            continue;
        }
        if (!message.begun) from.begins(message);
        std::size_t before = message.sent;
        put_piece(message, out);
        from.unsent_bytes -= message.sent - before;
        if (message.sent == message.size()) from.ends(message);
        if (message.sent < message.size()) {
            from.all.push_back(std::move(message));
        } else if (message.source && --message.source->in_pieces_ == 0 && message.source->pending_) {
            sources_.push_back(message.source); // it waited for this message
        }
    }
}

[[gnu::hot]] void outbox::fill_publications(batch& out) {
    filling_ = &out;
    while (!sources_.empty() && out.weight() < batch_limit_) {
        auto* source = sources_.pop_front();
        source->pending_ = false;
        bool more = source->take(*this, quantum);
        if (!more) continue;
        source->pending_ = true;
        // It waits outside of the queue until its message in pieces is through (order within a subscription).
        if (source->in_pieces_ == 0) sources_.push_back(source);
    }
    filling_ = nullptr;
}

void outbox::feed_lane() {
    while (!sources_.empty() && lane_->wanted()) {
        auto* source = sources_.front();
        sources_.pop_front();
        source->pending_ = false;
        if (!source->take(*this, 1)) continue; // one packet: the next is chosen when it is time for it
        source->pending_ = true;
        sources_.push_back(source);
    }
}

// As `any_frame`, of all calls that wait as frames.
template <class Visit>
bool outbox::any_call(Visit visit) {
    for (std::size_t i = 0; i < blocks_.size(); ++i)
        if (any_frame(content_of(blocks_[i]), blocks_[i].frames.size(), visit)) return true;
    return any_frame(calls_.data(), calls_.size(), visit);
}

void outbox::take_unwritten(const std::function<void(const carried_frame&)>& visit) {
    any_call([&](std::byte* frame, const frame_header& header) {
        bytes_view body(frame + frame_header::size, header.length);
        passed_object object;
        if (header.flags & wire::flag::attached) object = attachments_.pop_front();
        if (header.type == frame_type::request) visit({{header, body}, object ? &object : nullptr});
        return false;
    });
    for (std::size_t i = 0; i < big_calls_.all.size(); ++i) {
        const auto& message = big_calls_.all[i];
        if (message.header.type == frame_type::request && !message.begun) visit({{message.header, message.payload}});
    }
    blocks_.clear();
    calls_.clear();
    blocks_weight_ = beside_weight_ = withdrawn_ = 0;
    big_calls_ = {};
}

bool outbox::withdraw(std::uint64_t request_id) {
    bool big = false;
    big_calls_.all.erase_if([&](const big_message& message) {
        if (message.header.id != request_id || message.header.type != frame_type::request) return false;
        if (message.begun) put_abandoned(message);
        big_calls_.ends(message);
        return big = true;
    });
    if (big) return true;
    auto mark = [&](std::byte* frame, const frame_header& header) {
        if (header.id != request_id || header.type != frame_type::request) return false;
        mark_withdrawn(frame);
        ++withdrawn_;
        return true;
    };
    // The newest first: to a peer that reads nothing, what was withdrawn long ago lies before it.
    if (any_frame(calls_.data(), calls_.size(), mark)) return true;
    for (std::size_t i = blocks_.size(); i-- > 0;) {
        if (!any_frame(content_of(blocks_[i]), blocks_[i].frames.size(), mark)) continue;
        drop_if_withdrawn(i);
        return true;
    }
    return false;
}

// A block of which nothing is to be written leaves no bytes that count.
void outbox::drop_if_withdrawn(std::size_t which) {
    if (!attachments_.empty()) return; // which lie in the order of all frames
    std::size_t frames = 0;
    if (any_frame(content_of(blocks_[which]), blocks_[which].frames.size(), [&](auto*, const frame_header& header) {
            ++frames;
            return !is_withdrawn(header);
        }))
        return;
    withdrawn_ -= frames;
    blocks_weight_ -= blocks_[which].weight;
    std::size_t at = 0;
    blocks_.erase_if([&](const call_block&) { return at++ == which; });
}

} // namespace ise::net
