#pragma once
#include <ise/core/result.hpp>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace ise {

/// Whom a URL reaches: "https://gateway.example/post", "tcp://[::1]:7411".
struct url_parts {
    std::string scheme;
    std::string
        host; ///< lower case, IPv6 without brackets; empty: of a scheme that names no host (local, inproc, file)
    std::uint16_t port = 0; ///< as written, else the usual one of the scheme; 0: not known
};

/// Reads strictly, so that no reader of the same text finds another host in it: no user, no blanks, no backslashes.
/// errc::invalid_argument says what is wrong.
result<url_parts> parse_url(std::string_view text);

/// All parts of a text that are URLs: of "xbee=tcp://10.0.0.1:7411" the one behind the "=". errc::invalid_argument as
/// above.
result<std::vector<url_parts>> urls_in(std::string_view text);

} // namespace ise
