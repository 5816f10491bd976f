#pragma once
#include "account.hpp"

#include <string>

namespace atirma::stress {

/// Whether each telecommand given at a window was shown to end: acknowledged, refused with a reason, or expired; and
/// whether those that a node accepted are in its record.
bool windows_hold(const account& of);

/// The section of report.md about the consoles with windows; empty without any.
std::string windows_text(const account& of);

} // namespace atirma::stress
