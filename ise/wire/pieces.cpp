#include <ise/wire/pieces.hpp>

#include <ise/core/limits.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace ise::wire {
namespace {

using limit::unfinished_messages;

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
    std::uint64_t id = piece.header.id;
    bytes_view content = piece.body;
    auto found = messages_.find(id);
    if (piece.header.flags & flag::abandoned) {
        if (found != messages_.end()) {
            held_ -= found->second.body.size();
            messages_.erase(found);
        }
        return std::optional<assembled>{};
    }
    if (found == messages_.end()) {
        if (content.size() < piece_head::size)
            return failure(errc::protocol_error, "a first piece came without the head of its message");
        if (messages_.size() >= unfinished_messages)
            return failure(
                errc::too_large,
                fmt::format("more than {} messages came in pieces at once (unfinished_messages)", unfinished_messages));
        ise::wire::reassembly::message begun;
        begun.head = piece_head::read(content);
        content = content.subspan(piece_head::size);
        if (begun.head.length > max_message_bytes_)
            return failure(errc::too_large,
                           fmt::format("a message '{}' of {} bytes was announced, {} are allowed (max_message_bytes)",
                                       name_of(begun.head.type), begun.head.length, max_message_bytes_));
        found = messages_.emplace(id, std::move(begun)).first;
    }
    auto& partial = found->second;
    if (content.size() > partial.head.length - partial.body.size())
        return failure(errc::protocol_error, fmt::format("a message '{}' is longer than the {} bytes it announced",
                                                         name_of(partial.head.type), partial.head.length));
    if (held_ + content.size() > 2 * max_message_bytes_)
        return failure(errc::too_large, fmt::format("unfinished messages hold more than {} bytes (unfinished_messages)",
                                                    2 * max_message_bytes_));
    // Room for what was announced, as far as what has come vouches for it.
    if (const auto size = partial.body.size() + content.size(); size > partial.body.capacity())
        partial.body.reserve(static_cast<std::size_t>(std::min<std::uint64_t>(partial.head.length, 4 * size)));
    partial.body.append(content);
    held_ += content.size();
    if (!(piece.header.flags & flag::last)) return std::optional<assembled>{};
    if (partial.body.size() != partial.head.length)
        return failure(errc::protocol_error,
                       fmt::format("a message '{}' ended after {} of {} bytes", name_of(partial.head.type),
                                   partial.body.size(), partial.head.length));
    held_ -= partial.body.size();
    assembled whole;
    whole.header.type = partial.head.type;
    whole.header.flags = partial.head.flags;
    whole.header.id = partial.head.id;
    whole.header.length = static_cast<std::uint32_t>(
        std::min<std::uint64_t>(partial.head.length, std::numeric_limits<std::uint32_t>::max()));
    whole.body = std::move(partial.body);
    messages_.erase(found);
    return std::optional<assembled>(std::move(whole));
}

} // namespace ise::wire
