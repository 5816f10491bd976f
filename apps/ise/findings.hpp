#pragma once
#include "survey.hpp"

#include <string>
#include <vector>

namespace ise::cli {

enum class severity_level : std::uint8_t {
    error,   ///< something does not work
    warning, ///< something works badly, or soon will not
    note     ///< worth knowing; the system is healthy all the same
};
std::string_view name_of(severity_level of) noexcept;

/// Something that is not as it should be, and what to do about it.
struct finding {
    severity_level severity = severity_level::error;
    std::string kind;      ///< for programs: "unreachable", "clock_skew"…
    std::string component; ///< its path; empty: no component's
    std::string message;
    std::string advice;
};

/// "it waits for 'helm' of atirma/boat, which is not found, since 2026-05-01T12:00:03Z (12 s): nobody is registered as
/// 'atirma/boat'"
std::string wait_line(const wait_info& of);

/// What two surveys, one `apart` from the other, tell of a system: worst first, then by component.
/// `here`: the name of the host that this runs on.
std::vector<finding> examine(const std::vector<surveyed>& before, const std::vector<surveyed>& now, duration apart,
                             const std::string& here);

/// Services that components require and those that provide them do not fit, or nobody provides.
std::vector<finding> examine_services(const std::vector<surveyed>& now);

/// Why the packets of a service do not fit between a requirer and a provider, a line a difference; empty if they do.
std::string misfit(const service_info& required, const service_info& provided);

} // namespace ise::cli
