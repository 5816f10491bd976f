#include <ise/wire/parser.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace ise::wire {
namespace {

// An idle connection reads heartbeats only.
constexpr std::size_t first_room = 32;
constexpr std::size_t max_room = 256 * 1024;
// About one heartbeat a second: an idle connection has let go of a burst's buffer within a minute.
constexpr unsigned small_reads_before_shrinking = 16;

} // namespace

std::string_view name_of(frame_type type) noexcept {
    switch (type) {
        case frame_type::hello: return "hello";
        case frame_type::welcome: return "welcome";
        case frame_type::reject: return "reject";
        case frame_type::challenge: return "challenge";
        case frame_type::proof: return "proof";
        case frame_type::request: return "request";
        case frame_type::reply: return "reply";
        case frame_type::error: return "error";
        case frame_type::cancel: return "cancel";
        case frame_type::introduce: return "introduce";
        case frame_type::answers: return "answers";
        case frame_type::subscribe: return "subscribe";
        case frame_type::subscribed: return "subscribed";
        case frame_type::packet: return "packet";
        case frame_type::unsubscribe: return "unsubscribe";
        case frame_type::unsubscribed: return "unsubscribed";
        case frame_type::ended: return "ended";
        case frame_type::credit: return "credit";
        case frame_type::ping: return "ping";
        case frame_type::pong: return "pong";
        case frame_type::goodbye: return "goodbye";
        case frame_type::piece: return "piece";
        case frame_type::schema_request: return "schema_request";
        case frame_type::schema: return "schema";
    }
    return "unknown";
}

[[gnu::hot]] std::span<std::byte> parser::prepare() {
    const std::size_t used = storage_.size();
    const bool filled = used == room_; // the last read filled its room: this one gets more
    drop_taken();
    small_reads_ = used < room_ / 8 ? small_reads_ + 1 : 0;
    if (storage_.empty() && room_ > first_room && small_reads_ >= small_reads_before_shrinking) {
        room_ = std::max(room_ / 8, first_room);
        storage_ = buffer(room_);
        small_reads_ = 0;
    }
    std::size_t wanted = std::max(room_, first_room);
    if (storage_.size() >= frame_header::size) // a length beyond the limit is next()'s to refuse
        wanted = std::max<std::size_t>(wanted, frame_header::size +
                                                   std::min(read_header(storage_.data()).length, max_frame_bytes_));
    if (filled && room_ < max_room) wanted = std::max(wanted, room_ * 4);
    storage_.reserve(wanted);
    room_ = wanted; // the buffer may have more
    return {storage_.data() + storage_.size(), room_ - storage_.size()};
}

[[gnu::hot]] bytes_view parser::take_alike(const frame& first, std::uint64_t& others) noexcept {
    const std::byte* const from = first.body.data() - frame_header::size;
    while (pending() >= frame_header::size) {
        const auto header = read_header(storage_.data() + begin_);
        if (header.type != first.header.type || header.flags != first.header.flags || header.id != first.header.id)
            break;
        if (frame another; !take(another)) break;
        ++others;
    }
    return {from, storage_.data() + begin_};
}

void parser::add(buffer& content) {
    if (pending() == 0) {
        storage_ = std::move(content); // they change places
        begin_ = 0;
    } else {
        drop_taken();
        storage_.append(content.view());
    }
    room_ = storage_.capacity();
    content.recycle();
}

void parser::add(bytes_view content) {
    drop_taken();
    storage_.append(content);
}

// What is left of the last read moves to the front; it is less than a frame.
void parser::drop_taken() noexcept {
    if (pending() == 0) storage_.clear();
    else if (begin_ > 0) storage_.drop_front(begin_);
    begin_ = 0;
}

failure parser::refuse(const frame_header& header) const {
    auto first_bytes = header.length & 0xffff; // of TLS: an alert or a greeting, and its version
    if (header.length > max_frame_bytes_ && (first_bytes == 0x0315 || first_bytes == 0x0316))
        return failure(errc::protocol_error,
                       "received TLS on an endpoint without TLS: one side has tls://, the other tcp://");
    if (header.length > max_frame_bytes_)
        return failure(errc::too_large, fmt::format("a frame '{}' of {} bytes came, {} are allowed ({})",
                                                    name_of(header.type), header.length, max_frame_bytes_, limit_));
    return failure(errc::protocol_error,
                   fmt::format("received data that is not a frame of ISE (type {}, reserved {:#x})",
                               static_cast<int>(header.type), header.reserved));
}

} // namespace ise::wire
