#include <ise/wire/pieces.hpp>

#include <ise/core/limits.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace ise::wire {
namespace {

using limit::unfinished_messages;

// A message may claim so many times what has come of it: fewer growing copies, and little room for who sends no more.
constexpr std::uint64_t vouched_for = 16;

} // namespace

void piece_head::put(buffer& out) const {
    out.append(static_cast<std::uint8_t>(type));
    out.append(flags);
    out.append(id);
    out.append(length);
}

piece_head piece_head::read(bytes_view from) {
    piece_head head;
    head.type = static_cast<frame_type>(detail::load_little<std::uint8_t>(from.data()));
    head.flags = detail::load_little<std::uint8_t>(from.data() + 1);
    head.id = detail::load_little<std::uint64_t>(from.data() + 2);
    head.length = detail::load_little<std::uint64_t>(from.data() + 10);
    return head;
}

result<std::optional<assembled>> reassembly::take(const frame& piece) {
    if (piece.header.flags & flag::abandoned) {
        if (const auto found = messages_.find(piece.header.id); found != messages_.end()) {
            held_ -= found->second.body.size();
            messages_.erase(found);
        }
        return std::optional<assembled>{};
    }
    frame_header header = piece.header;
    header.length = static_cast<std::uint32_t>(piece.body.size());
    auto opened = open(header, piece.body);
    if (!opened) return opened.error();
    return fill(0);
}

result<bool> reassembly::begin(const frame& part) {
    if (part.header.flags & flag::abandoned) return false;
    if (part.body.size() < piece_head::size && !messages_.contains(part.header.id)) return false;
    auto opened = open(part.header, part.body);
    if (!opened) return opened.error();
    return true;
}

// Takes what has come of a piece, and makes room for the rest.
result<void> reassembly::open(const frame_header& piece, bytes_view come) {
    std::size_t length = piece.length;
    auto found = messages_.find(piece.id);
    if (found == messages_.end()) {
        if (length < piece_head::size)
            return failure(errc::protocol_error, "a first piece came without the head of its message");
        if (messages_.size() >= unfinished_messages)
            return failure(
                errc::too_large,
                fmt::format("more than {} messages came in pieces at once (unfinished_messages)", unfinished_messages));
        message begun;
        begun.head = piece_head::read(come);
        come = come.subspan(piece_head::size);
        length -= piece_head::size;
        if (begun.head.length > max_message_bytes_)
            return failure(errc::too_large,
                           fmt::format("a message '{}' of {} bytes was announced, {} are allowed (max_message_bytes)",
                                       name_of(begun.head.type), begun.head.length, max_message_bytes_));
        found = messages_.emplace(piece.id, std::move(begun)).first;
    }
    auto& [head, body] = found->second;
    if (length > head.length - body.size())
        return failure(errc::protocol_error, fmt::format("a message '{}' is longer than the {} bytes it announced",
                                                         name_of(head.type), head.length));
    if (held_ + length > 2 * max_message_bytes_)
        return failure(errc::too_large, fmt::format("unfinished messages hold more than {} bytes (unfinished_messages)",
                                                    2 * max_message_bytes_));
    // Room for what was announced, as far as what has come vouches for it.
    if (const auto needed = body.size() + length + frame_header::size; needed > body.capacity()) {
        const auto vouched = std::min<std::uint64_t>(head.length, vouched_for * (body.size() + come.size()));
        body.reserve(std::max(needed, static_cast<std::size_t>(vouched) + frame_header::size));
    }
    body.append(come);
    held_ += length;
    filled_ = found;
    missing_ = length - come.size();
    last_ = (piece.flags & flag::last) != 0;
    return {};
}

std::span<std::byte> reassembly::room() {
    auto& body = filled_->second.body;
    return {body.data() + body.size(), missing_ + frame_header::size};
}

result<std::optional<assembled>> reassembly::fill(std::size_t count) {
    auto& [head, body] = filled_->second;
    body.grow(count);
    missing_ -= count;
    if (missing_ > 0 || !last_) return std::optional<assembled>{};
    if (body.size() != head.length)
        return failure(errc::protocol_error, fmt::format("a message '{}' ended after {} of {} bytes",
                                                         name_of(head.type), body.size(), head.length));
    held_ -= body.size();
    assembled whole;
    whole.header.type = head.type;
    whole.header.flags = head.flags;
    whole.header.id = head.id;
    whole.header.length =
        static_cast<std::uint32_t>(std::min<std::uint64_t>(head.length, std::numeric_limits<std::uint32_t>::max()));
    whole.body = std::move(body);
    messages_.erase(filled_);
    return std::optional<assembled>(std::move(whole));
}

} // namespace ise::wire
