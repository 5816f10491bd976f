#pragma once
#include <ise/core/result.hpp>

#include <string>
#include <string_view>

namespace atirma {

/// A line of `ise echo NAME telemetry`, with the boat's report in place of its bytes: `"kind":"location","report":{…}`
/// in place of `"raw":"…"`. A line of `ise echo --losses` stays one. errc::malformed where it is no telemetry packet,
/// or where its bytes are no report: with what is wrong.
ise::result<std::string> decoded_telemetry(std::string_view line);

} // namespace atirma
