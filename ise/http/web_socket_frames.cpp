#include <ise/http/web_socket_frames.hpp>

#include <ise/packet/detail/text_forms.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <utility>

namespace ise {
namespace {

using opcode = web_socket_opcode;

constexpr std::size_t max_control_bytes = 125;
constexpr std::string_view handshake_guid = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";

bool is_control(opcode kind) noexcept { return static_cast<std::uint8_t>(kind) >= 8; }

// Which codes a peer may put into a close frame.
bool may_be_sent(std::uint16_t code) noexcept {
    if (code >= 3000) return code < 5000;
    return code >= 1000 && code <= 1014 && code != 1004 && code != 1005 && code != 1006;
}

std::uint64_t big_endian(std::string_view bytes) noexcept {
    std::uint64_t value = 0;
    for (char one : bytes) value = value << 8 | static_cast<std::uint8_t>(one);
    return value;
}

void append_big_endian(std::string& to, std::uint64_t value, int bytes) {
    for (int shift = 8 * (bytes - 1); shift >= 0; shift -= 8) to += static_cast<char>(value >> shift & 0xff);
}

void append_head(std::string& to, opcode kind, std::uint64_t payload_bytes, bool masked, bool last) {
    to += static_cast<char>((last ? 0x80 : 0) | static_cast<std::uint8_t>(kind));
    const int mask = masked ? 0x80 : 0;
    if (payload_bytes < 126) {
        to += static_cast<char>(mask | static_cast<int>(payload_bytes));
    } else if (payload_bytes <= 0xffff) {
        to += static_cast<char>(mask | 126);
        append_big_endian(to, payload_bytes, 2);
    } else {
        to += static_cast<char>(mask | 127);
        append_big_endian(to, payload_bytes, 8);
    }
}

// The handshake is defined with SHA-1; nothing is kept secret by it.
std::array<std::byte, 20> sha1(std::string text) {
    const std::uint64_t bits = text.size() * 8;
    text += static_cast<char>(0x80);
    while (text.size() % 64 != 56) text += '\0';
    append_big_endian(text, bits, 8);
    std::array<std::uint32_t, 5> h = {0x67452301, 0xefcdab89, 0x98badcfe, 0x10325476, 0xc3d2e1f0};
    for (std::size_t at = 0; at < text.size(); at += 64) {
        std::array<std::uint32_t, 80> w{};
        for (std::size_t i = 0; i < 16; ++i)
            w[i] = static_cast<std::uint32_t>(big_endian(std::string_view(text).substr(at + 4 * i, 4)));
        for (std::size_t i = 16; i < 80; ++i) w[i] = std::rotl(w[i - 3] ^ w[i - 8] ^ w[i - 14] ^ w[i - 16], 1);
        auto [a, b, c, d, e] = h;
        for (std::size_t i = 0; i < 80; ++i) {
            const std::uint32_t f = i < 20   ? ((b & c) | (~b & d))
                                    : i < 40 ? (b ^ c ^ d)
                                    : i < 60 ? ((b & c) | (b & d) | (c & d))
                                             : (b ^ c ^ d);
            const std::uint32_t k = i < 20 ? 0x5a827999 : i < 40 ? 0x6ed9eba1 : i < 60 ? 0x8f1bbcdc : 0xca62c1d6;
            const std::uint32_t next = std::rotl(a, 5) + f + e + k + w[i];
            e = d;
            d = c;
            c = std::rotl(b, 30);
            b = a;
            a = next;
        }
        h[0] += a;
        h[1] += b;
        h[2] += c;
        h[3] += d;
        h[4] += e;
    }
    std::array<std::byte, 20> made{};
    for (std::size_t i = 0; i < made.size(); ++i) made[i] = static_cast<std::byte>(h[i / 4] >> (24 - 8 * (i % 4)));
    return made;
}

} // namespace

web_socket_reader::web_socket_reader(from whose, web_socket_limits limits) : whose_(whose), limits_(limits) {}

failure web_socket_reader::refuse(web_socket_code code, std::string why) {
    failed_ = true;
    refusal_ = code;
    return failure(code == web_socket_code::too_large ? errc::too_large : errc::malformed, std::move(why));
}

/// The head of a frame is whole.
result<void> web_socket_reader::begin() {
    const auto first = static_cast<std::uint8_t>(head_[0]), second = static_cast<std::uint8_t>(head_[1]);
    const std::size_t length_bytes = (second & 0x7f) == 126 ? 2 : (second & 0x7f) == 127 ? 8 : 0;
    left_ = length_bytes == 0 ? second & 0x7f : big_endian(std::string_view(head_).substr(2, length_bytes));
    if ((length_bytes == 2 && left_ < 126) || (length_bytes == 8 && left_ <= 0xffff))
        return refuse(web_socket_code::protocol_error, "a frame's length is not written in its shortest form");
    if (second & 0x80)
        for (std::size_t i = 0; i < 4; ++i) mask_[i] = static_cast<std::uint8_t>(head_[2 + length_bytes + i]);
    masked_ = 0;
    last_ = (first & 0x80) != 0;
    if (is_control(opcode_)) {
        control_.clear();
    } else {
        if (left_ > limits_.max_message_bytes || data_.size() + left_ > limits_.max_message_bytes)
            return refuse(web_socket_code::too_large,
                          fmt::format("a message has more than {} bytes", limits_.max_message_bytes));
        if (opcode_ == opcode::continuation) {
            if (message_ == opcode::continuation)
                return refuse(web_socket_code::protocol_error, "a message begins with a continuation frame");
        } else {
            if (message_ != opcode::continuation)
                return refuse(web_socket_code::protocol_error, "a message begins within another one");
            message_ = opcode_;
            fragments_ = 0;
        }
        if (++fragments_ > limits_.max_fragments)
            return refuse(web_socket_code::too_large,
                          fmt::format("a message has more than {} fragments", limits_.max_fragments));
    }
    in_payload_ = true;
    return {};
}

/// The payload of a frame is whole.
result<void> web_socket_reader::end() {
    in_payload_ = false;
    head_.clear();
    head_bytes_ = 2;
    if (!is_control(opcode_)) {
        if (!last_) return {};
        made_.kind = std::exchange(message_, opcode::continuation);
        made_.payload = std::exchange(data_, {});
        if (made_.kind == opcode::text && !detail::is_utf8(made_.payload))
            return refuse(web_socket_code::not_utf8, "a text message is not UTF-8");
        complete_ = true;
        return {};
    }
    made_.kind = opcode_;
    made_.code = web_socket_code::no_status;
    made_.payload = std::exchange(control_, {});
    if (opcode_ == opcode::close && !made_.payload.empty()) {
        if (made_.payload.size() < 2) return refuse(web_socket_code::protocol_error, "a close frame has half a code");
        auto code = static_cast<std::uint16_t>(big_endian(std::string_view(made_.payload).substr(0, 2)));
        if (!may_be_sent(code))
            return refuse(web_socket_code::protocol_error, fmt::format("a close frame has the code {}", code));
        made_.code = static_cast<web_socket_code>(code);
        made_.payload.erase(0, 2);
        if (!detail::is_utf8(made_.payload))
            return refuse(web_socket_code::not_utf8, "the reason of a close frame is not UTF-8");
    }
    complete_ = true;
    return {};
}

result<std::size_t> web_socket_reader::feed(bytes_view in) {
    if (failed_) return failure(errc::malformed, "an earlier frame was refused");
    std::size_t used = 0;
    while (!complete_ && (used < in.size() || (in_payload_ && left_ == 0))) {
        if (in_payload_) {
            auto& to = is_control(opcode_) ? control_ : data_;
            auto count = static_cast<std::size_t>(std::min<std::uint64_t>(left_, in.size() - used));
            const auto start = to.size();
            to.append(as_text(in.subspan(used, count)));
            if (whose_ == from::clients)
                for (std::size_t i = 0; i < count; ++i)
                    to[start + i] = static_cast<char>(static_cast<std::uint8_t>(to[start + i]) ^ mask_[masked_++ & 3]);
            used += count;
            left_ -= count;
            if (left_ > 0) break;
            if (auto ended = end(); !ended) return ended.error();
            continue;
        }
        auto next = std::to_integer<std::uint8_t>(in[used++]);
        head_ += static_cast<char>(next);
        if (head_.size() == 1) {
            opcode_ = static_cast<opcode>(next & 0x0f);
            if (next & 0x70) return refuse(web_socket_code::protocol_error, "a frame has reserved bits");
            if ((next & 0x0f) > 10 || ((next & 0x0f) > 2 && (next & 0x0f) < 8))
                return refuse(web_socket_code::protocol_error, fmt::format("a frame has the opcode {}", next & 0x0f));
            if (is_control(opcode_) && !(next & 0x80))
                return refuse(web_socket_code::protocol_error, "a control frame is fragmented");
        } else if (head_.size() == 2) {
            const bool masked = (next & 0x80) != 0;
            if (masked != (whose_ == from::clients))
                return refuse(web_socket_code::protocol_error,
                              masked ? "a frame of a server is masked" : "a frame of a client is not masked");
            if (is_control(opcode_) && (next & 0x7f) > max_control_bytes)
                return refuse(web_socket_code::protocol_error, "a control frame has more than 125 bytes");
            head_bytes_ = 2 + ((next & 0x7f) == 126 ? 2 : (next & 0x7f) == 127 ? 8 : 0) + (masked ? 4 : 0);
        }
        if (head_.size() >= 2 && head_.size() == head_bytes_)
            if (auto begun = begin(); !begun) return begun.error();
    }
    return used;
}

web_socket_message web_socket_reader::take() {
    complete_ = false;
    return std::exchange(made_, {});
}

void append_frame_head(std::string& to, web_socket_opcode kind, std::uint64_t payload_bytes) {
    append_head(to, kind, payload_bytes, false, true);
}

void append_frame(std::string& to, web_socket_opcode kind, std::string_view payload) {
    append_frame_head(to, kind, payload.size());
    to += payload;
}

void append_masked_frame(std::string& to, web_socket_opcode kind, std::string_view payload, std::uint32_t mask,
                         bool last) {
    append_head(to, kind, payload.size(), true, last);
    append_big_endian(to, mask, 4);
    std::size_t at = 0;
    for (char one : payload)
        to += static_cast<char>(static_cast<std::uint8_t>(one) ^ (mask >> (24 - 8 * (at++ & 3)) & 0xff));
}

void append_close(std::string& to, web_socket_code code, std::string_view reason) {
    std::string payload;
    append_big_endian(payload, static_cast<std::uint16_t>(code), 2);
    auto most = std::min(reason.size(), max_control_bytes - 2);
    while (most > 0 && most < reason.size() && (static_cast<std::uint8_t>(reason[most]) & 0xc0) == 0x80) --most;
    payload += reason.substr(0, most);
    append_frame(to, opcode::close, payload);
}

std::string web_socket_accept(std::string_view key) {
    auto digest = sha1(std::string(key).append(handshake_guid));
    return detail::to_base64(digest);
}

bool is_web_socket_key(std::string_view key) noexcept {
    auto is_digit = [](char c) {
        return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '+' || c == '/';
    };
    return key.size() == 24 && key.ends_with("==") && std::ranges::all_of(key.substr(0, 22), is_digit);
}

bool lists_token(std::string_view header, std::string_view token) noexcept {
    auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; };
    for (std::size_t at = 0; at <= header.size();) {
        auto end = std::min(header.find(',', at), header.size());
        auto part = header.substr(at, end - at);
        at = end + 1;
        while (!part.empty() && (part.front() == ' ' || part.front() == '\t')) part.remove_prefix(1);
        while (!part.empty() && (part.back() == ' ' || part.back() == '\t')) part.remove_suffix(1);
        if (std::ranges::equal(part, token, [&](char a, char b) { return lower(a) == lower(b); })) return true;
    }
    return false;
}

} // namespace ise
