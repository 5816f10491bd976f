#pragma once
#include <ise/core/result.hpp>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace ise {

/// The parts of a URL: "https://gateway.example/post", "tcp://[::1]:7411".
struct url_parts {
    std::string scheme;     ///< lower case
    std::string host;       ///< lower case, IPv6 without brackets; empty: of a scheme that names none (local, file)
    std::uint16_t port = 0; ///< as written, else the usual one of the scheme; 0: not known
    std::string target;     ///< path and query as written, without a fragment; empty: none, or no host
    std::vector<std::string> files; ///< of PostgreSQL, in `urls_in`: which its parameters name, such as sslkey

    /// "https://gateway.example:443": the server without the target, which may hold secrets.
    std::string server() const;
};

/// Reads strictly, so that no reader of the same text finds another host in it: no user, no blanks, no backslashes.
/// errc::invalid_argument says what is wrong.
result<url_parts> parse_url(std::string_view text);

/// All parts of a text that are URLs: of "xbee=tcp://10.0.0.1:7411" the one behind the "=". A plain user name before
/// the host is left out. A URL of PostgreSQL extends to the end of the text and is one for each of its hosts:
/// "postgresql://atirma@db-1.example,db-2.example:5433/atirma"; the first one has its files. errc::invalid_argument as
/// above.
result<std::vector<url_parts>> urls_in(std::string_view text);

} // namespace ise
