#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <span>
#include <vector>

namespace atirma::iridium {

/// What one SBD message carries: a session costs the same for fifty bytes as for one, so several packets of the boat
/// (components/boat) go together. A message is either one packet as it is (its first byte is the version, 01), or a
/// bundle: `42`, then each packet behind its length byte.

/// As many of `packets` as fit into `most` bytes, in their order, beginning with the first; those that were taken are
/// counted in `taken`. A single packet goes as it is. Packets are 1 … 255 bytes.
ise::bytes bundle(std::span<const ise::bytes> packets, std::size_t most, std::size_t& taken);

/// The packets of a message. Error: malformed (empty, or lengths that do not add up: nothing of it is used then).
ise::result<std::vector<ise::bytes>> unbundle(ise::bytes_view message);

} // namespace atirma::iridium
