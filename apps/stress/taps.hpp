#pragma once
#include "ledger.hpp"

#include <components/gprs/line_reader.hpp>
#include <components/xbee/decoder.hpp>

#include <functional>
#include <map>
#include <memory>
#include <vector>

namespace atirma::stress {

/// Reads along on one line of bytes, in both directions, as its owner writes and reads them.
class tap {
public:
    virtual ~tap() = default;
    virtual void wrote(ise::bytes_view bytes) = 0;
    virtual void read(ise::bytes_view bytes) = 0;
};

using stopwatch = std::function<ise::duration()>; ///< time since the beginning

/// At the boat's XBee (API mode 2): what it gives to the radio, and which of it was acknowledged there.
std::unique_ptr<tap> tap_boat_xbee(ledger& into, stopwatch time);
/// At the proxy's XBee (API mode 1): what came out of the radio.
std::unique_ptr<tap> tap_shore_xbee(ledger& into, stopwatch time);
/// At the boat's connection over GPRS. `numbers` outlives the connection: which packet goes under which number there.
using gprs_numbers = std::map<std::pair<std::uint16_t, std::uint32_t>, packet_key>;
std::unique_ptr<tap> tap_gprs(ledger& into, stopwatch time, gprs_numbers& numbers);
/// At the boat's 9602: what a session brought to the gateway.
std::unique_ptr<tap> tap_iridium(ledger& into, stopwatch time);

} // namespace atirma::stress
