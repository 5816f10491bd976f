#pragma once
#include <components/gui_client/view.hpp>

#include <map>
#include <string>

namespace atirma::console {

/// Returns the proxy for a telecommand that names none: of the reachable ones the cheapest over which the boat was
/// heard recently; else the one heard last; else any reachable one; else any. Empty: there is none.
std::string choose_link(const std::map<std::string, link_view>& links, const report_rhythm& rhythm, utc_time now);

} // namespace atirma::console
