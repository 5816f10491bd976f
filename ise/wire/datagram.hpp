#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/bytes.hpp>

#include <array>
#include <cstdint>
#include <optional>

/// How sessions lie in datagrams (FORMAT.md, "Datagrams"): every datagram has one frame header, whose types are here.
namespace ise::wire {

enum class datagram_type : std::uint8_t {
    open = 4,    ///< a stranger asks for a channel; id: how it wants to be addressed; padded
    cookie = 5,  ///< the answer to one that has not shown that it receives at its address
    opened = 6,  ///< the channel is there; the body is the id by which the answerer wants to be addressed
    closed = 7,  ///< the sender has left the channel
    unknown = 8, ///< nobody has the channel of this id here
    data = 9,    ///< a number and chunks
    sign = 10,   ///< the sender is there, but busy
};

/// No datagram is longer: it passes every IPv6 link, and every IPv4 link that is in use, in one piece.
inline constexpr std::size_t datagram_bytes = 1200;
/// The most that a message over datagrams has, its frame header not counted.
inline constexpr std::uint64_t max_datagram_message_bytes = 1u << 20;

using cookie = std::array<std::uint8_t, 16>;

/// One that was received, cut open; views of its bytes.
struct datagram_view {
    datagram_type type{};
    std::uint64_t id = 0;
    bytes_view body;
};

/// Nothing where it is no datagram of ISE, or one of a later version.
std::optional<datagram_view> read_datagram(bytes_view raw) noexcept;
void put_datagram(buffer& out, datagram_type type, std::uint64_t id, bytes_view body = {});

/// The body of `open`.
struct opening {
    wire::cookie cookie{}; ///< zeros at first, then what the answer was
};
/// A whole datagram, padded to `datagram_bytes`.
void put_opening(buffer& out, std::uint64_t id, const wire::cookie& shown);
std::optional<opening> read_opening(const datagram_view& received) noexcept;

/// What the body of `data` consists of, behind its number: kind u8, length u16, content.
enum class chunk_type : std::uint8_t {
    ack = 1,       ///< which numbers came
    content = 2,   ///< bytes of the stream: offset u64, bytes
    end = 3,       ///< where the stream ends: offset u64
    room = 4,      ///< bytes of the stream are taken up to here: u64
    fragment = 5,  ///< of a message that may be lost: number u64, whole length u32, offset u32, bytes
    probe = 6,     ///< asks for nothing but an ack
    challenge = 7, ///< u64 that is to be sent back from the address that it was sent to
    response = 8,  ///< that u64
};

struct chunk {
    chunk_type type{};
    bytes_view content;
};

inline constexpr std::size_t chunk_head_bytes = 3;
inline constexpr std::size_t data_head_bytes = 24; ///< frame header and number
inline constexpr std::size_t content_head_bytes = chunk_head_bytes + 8;
inline constexpr std::size_t fragment_head_bytes = chunk_head_bytes + 16;

/// Walks over the chunks of a data datagram.
class chunk_reader {
public:
    explicit chunk_reader(bytes_view chunks) noexcept : left_(chunks) {}
    /// The next one, or nothing at the end or where the rest makes no chunk (`broken`).
    std::optional<chunk> next() noexcept;
    bool broken() const noexcept { return broken_; }

private:
    bytes_view left_;
    bool broken_ = false;
};

/// Writes a data datagram: begin, chunks, finish. `room()` is what still fits.
class data_writer {
public:
    data_writer(buffer& out, std::uint64_t to, std::uint64_t number);
    std::size_t room() const noexcept { return datagram_bytes - (out_.size() - start_); }
    bool empty() const noexcept { return out_.size() - start_ == data_head_bytes; }
    void put(chunk_type type, bytes_view head, bytes_view content = {});
    void put(chunk_type type, std::uint64_t value);
    void finish() noexcept;

private:
    buffer& out_;
    std::size_t start_;
};

} // namespace ise::wire
