#pragma once
#include <components/boat/telemetry.hpp>

#include <set>
#include <utility>

namespace atirma {

/// A telemetry packet's name: boot and sequence.
using packet_name = std::pair<std::uint16_t, std::uint32_t>;

/// What the shore tells the boat of telemetry that is safe ashore, over a link that has no acknowledgements of its own
/// from end to end. The boat need not send these packets again.
struct telemetry_receipt {
    static constexpr std::uint32_t span = 640;        ///< sequences that one receipt can name, from the first one on
    static constexpr std::uint32_t sealed_span = 576; ///< so that it fits a radio frame also when it is sealed
    utc_time sent_at{};
    std::set<packet_name> packets; ///< of one boot
};

/// One receipt for the first of these packets and those that fit beside it; they are taken out of `packets`, which is
/// not empty.
ise::bytes encode_receipt(utc_time sent_at, std::set<packet_name>& packets,
                          std::uint32_t span = telemetry_receipt::span);
/// Errors: malformed, with what is wrong.
ise::result<telemetry_receipt> parse_receipt(ise::bytes_view raw);

} // namespace atirma
