#include <ise/wire/parser.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

namespace ise::wire {
namespace {

// An idle connection reads heartbeats only.
constexpr std::size_t first_room = 32;
constexpr std::size_t max_room = 256 * 1024;

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

std::span<std::byte> parser::prepare() {
    // What is left of the last read moves to the front; it is less than a frame.
    const std::size_t used = end_;
    const bool filled = used == storage_.size(); // the last read filled its room: this one gets more
    if (begin_ > 0) {
        std::memmove(storage_.data(), storage_.data() + begin_, end_ - begin_);
        end_ -= begin_;
        begin_ = 0;
    }
    small_reads_ = used < storage_.size() / 8 ? small_reads_ + 1 : 0;
    if (end_ == 0 && storage_.size() > first_room && small_reads_ >= small_reads_before_shrinking) {
        storage_ = std::vector<std::byte>(std::max(storage_.size() / 8, first_room));
        small_reads_ = 0;
    }
    std::size_t wanted = storage_.empty() ? first_room : storage_.size();
    if (end_ >= frame_header::size) // a length beyond the limit is next()'s to refuse
        wanted = std::max<std::size_t>(wanted, frame_header::size +
                                                   std::min(read_header(storage_.data()).length, max_frame_bytes_));
    if (filled && storage_.size() < max_room) wanted = std::max(wanted, storage_.size() * 4);
    if (wanted > storage_.size()) storage_.resize(wanted);
    return std::span(storage_).subspan(end_);
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
