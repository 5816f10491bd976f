#include <ise/wire/datagram.hpp>

#include <ise/wire/frame.hpp>
#include <ise/wire/messages.hpp>

#include <algorithm>
#include <cstring>

namespace ise::wire {

std::optional<datagram_view> read_datagram(bytes_view raw) noexcept {
    if (raw.size() < frame_header::size || raw.size() > datagram_bytes) return {};
    auto header = read_header(raw.data());
    auto type = static_cast<std::uint8_t>(header.type);
    if (header.length != raw.size() - frame_header::size || header.reserved != 0) return {};
    constexpr auto first = static_cast<std::uint8_t>(datagram_type::open),
                   last = std::uint8_t{15};             // of a sealed channel
    const bool of_greetings = type == 11 || type == 12; // numbers are those of frames, too
    if (type < first || type > last || of_greetings) return {};
    datagram_view read;
    read.type = static_cast<datagram_type>(type);
    read.id = header.id;
    read.body = raw.subspan(frame_header::size);
    return read;
}

void put_datagram(buffer& out, datagram_type type, std::uint64_t id, bytes_view body) {
    frame_header header;
    header.length = static_cast<std::uint32_t>(body.size());
    header.type = static_cast<frame_type>(type);
    header.id = id;
    put_header(out, header);
    out.append(body);
}

void put_opening(buffer& out, std::uint64_t id, const wire::cookie& shown) {
    std::array<std::byte, datagram_bytes - frame_header::size> body{};
    detail::store_little(body.data(), magic);
    std::memcpy(body.data() + 4, shown.data(), shown.size());
    put_datagram(out, datagram_type::open, id, body);
}

std::optional<opening> read_opening(const datagram_view& received) noexcept {
    // One that is not padded could be used to send others more than it cost.
    if (received.body.size() != datagram_bytes - frame_header::size || received.id == 0) return {};
    if (detail::load_little<std::uint32_t>(received.body.data()) != magic) return {};
    opening read;
    std::memcpy(read.cookie.data(), received.body.data() + 4, read.cookie.size());
    return read;
}

std::optional<chunk> chunk_reader::next() noexcept {
    if (left_.empty() || broken_) return {};
    if (left_.size() < chunk_head_bytes) {
        broken_ = true;
        return {};
    }
    std::size_t length = detail::load_little<std::uint16_t>(left_.data() + 1);
    if (length > left_.size() - chunk_head_bytes) {
        broken_ = true;
        return {};
    }
    chunk found;
    found.type = static_cast<chunk_type>(detail::load_little<std::uint8_t>(left_.data()));
    found.content = left_.subspan(chunk_head_bytes, length);
    left_ = left_.subspan(chunk_head_bytes + length);
    return found;
}

data_writer::data_writer(buffer& out, std::uint64_t to, std::uint64_t number) : out_(out), start_(out.size()) {
    put_datagram(out_, datagram_type::data, to);
    out_.append(number);
}

[[gnu::hot]] void data_writer::put(chunk_type type, bytes_view head, bytes_view content) {
    auto* at = out_.grow(chunk_head_bytes + head.size() + content.size());
    detail::store_little(at, static_cast<std::uint8_t>(type));
    detail::store_little(at + 1, static_cast<std::uint16_t>(head.size() + content.size()));
    std::copy(head.begin(), head.end(), at + chunk_head_bytes);
    std::copy(content.begin(), content.end(), at + chunk_head_bytes + head.size());
}

[[gnu::hot]] void data_writer::put(chunk_type type, std::uint64_t value) {
    std::array<std::byte, 8> raw;
    detail::store_little(raw.data(), value);
    put(type, raw);
}

void data_writer::finish() noexcept {
    out_.patch_u32(start_, static_cast<std::uint32_t>(out_.size() - start_ - frame_header::size));
}

} // namespace ise::wire
