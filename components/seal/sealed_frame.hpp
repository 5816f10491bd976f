#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

/// Packets of the radio with a tag that only a holder of the key can make (README.md: byte by byte). Pure.
namespace atirma::seal {

inline constexpr std::size_t tag_size = 8, counter_size = 5, key_size = 32;
inline constexpr std::uint64_t max_counter = (std::uint64_t{1} << 40) - 1;
inline constexpr std::uint8_t max_epoch = 63; ///< of a key

/// Of a node: each has counters of its own.
enum class lane : std::uint8_t { primary = 0, secondary = 1 };

/// The types that exist only sealed: a question for the boat's notice, the next key, and the notice.
enum : std::uint8_t { ask_type = 0x46, rekey_type = 0x47, notice_type = 0x48 };

/// What a packet to the boat is bound to: the random number that the boat drew when it last began to count. A packet
/// that was sealed for another one fails, also if all counters are lost.
using session = std::uint64_t;
inline constexpr session no_session = 0; ///< the shore does not know it; the boat draws another one

/// The radio's key, and the boat that it is for.
struct radio_key {
    std::string boat; ///< its name: a packet of another boat fails, also if both have one key
    std::uint8_t epoch = 0;
    std::array<std::byte, key_size> secret{};
    /// Of the link, not in the file: each link has counters of its own, and a packet of another link fails.
    std::string link;
};

/// Eight hexadecimal digits by which people compare keys; they do not reveal it.
std::string fingerprint(const radio_key& key);

/// Whether a packet has the form of a sealed one, from its first byte alone.
bool is_sealed(ise::bytes_view raw) noexcept;
/// Of the key of a sealed packet.
std::uint8_t epoch_of(ise::bytes_view raw) noexcept;
/// Whether a sealed packet of the boat is a notice, which is about one key only. Its tag is not looked at.
bool is_notice(ise::bytes_view raw) noexcept;

/// A packet to the boat: `counter` differs for each one of a session and lane. The content is encrypted.
struct to_boat_frame {
    std::uint8_t type = 0;
    seal::lane lane = lane::primary;
    std::uint64_t counter = 0;
    ise::bytes content;
};

/// Adds 15 bytes to the content: version, type, counter and tag.
ise::bytes seal_to_boat(const radio_key& key, session of, const to_boat_frame& frame);
/// Errors: malformed (too short), refused (not sealed, another epoch, the tag is wrong).
ise::result<to_boat_frame> open_to_boat(const radio_key& key, session of, ise::bytes_view raw);

/// A plain packet of the boat with the tag in place of its checksum: 6 bytes longer. It can be read without the key.
ise::bytes seal_from_boat(const radio_key& key, ise::bytes_view plain);
/// The plain packet with its checksum. Errors as of open_to_boat.
ise::result<ise::bytes> open_from_boat(const radio_key& key, ise::bytes_view raw);

} // namespace atirma::seal
