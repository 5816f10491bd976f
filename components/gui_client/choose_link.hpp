#pragma once
#include <components/gui_client/view.hpp>

#include <map>
#include <string>

namespace atirma::console {

/// The proxy for a telecommand that names none: the cheapest link over which the boat was heard lately, of those that
/// are reached; else the one heard last; else any that is reached; else any. Empty: there is none at all.
std::string choose_link(const std::map<std::string, link_view>& links,
                        const std::optional<heard<configuration>>& settings, utc_time now);

} // namespace atirma::console
