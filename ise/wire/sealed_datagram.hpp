#pragma once
#include <ise/wire/datagram.hpp>

/// What datagrams of a sealed channel add (FORMAT.md, section 18).
namespace ise::wire::sealed {

inline constexpr datagram_type flight{13}; ///< of the handshake: number u8, records of TLS
inline constexpr datagram_type data{14};   ///< as `datagram_type::data`, encrypted; flag 1: the phase of the keys
inline constexpr datagram_type sign{15};   ///< as `datagram_type::sign`: number u64, seal

inline constexpr chunk_type closed{9}; ///< as the datagram of that name

inline constexpr std::size_t seal_bytes = 16;
inline constexpr std::size_t head_bytes = data_head_bytes + seal_bytes; ///< frame header, number, seal

} // namespace ise::wire::sealed
