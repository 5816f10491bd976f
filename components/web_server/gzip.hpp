#pragma once
#include <string>
#include <string_view>

namespace atirma {

/// `text` in the gzip format. Throws ise::error: io_failed (no memory).
std::string gzip(std::string_view text);

} // namespace atirma
