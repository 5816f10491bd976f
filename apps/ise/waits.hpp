#pragma once
#include <ise/component/introspection.hpp>

#include <string>

namespace ise::cli {

/// "it waits for 'helm' of atirma/boat, which is not found, since 2026-05-01T12:00:03Z (12 s): nobody is registered as
/// 'atirma/boat'"
std::string wait_line(const wait_text& of);

} // namespace ise::cli
