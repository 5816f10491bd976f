#pragma once
#include <string>
#include <string_view>
#include <utility>
#include <vector>

// What the HTTP server says, and how it reads what it is asked. Pure.
namespace ise {

/// "Not Found"; "Status" for a number without a name here.
std::string_view reason_of(int status) noexcept;

/// Nothing of another host, no script or style within the page. `framed`: any site may show it in a frame. `images`:
/// origins that pictures may come from as well, each after a space.
std::string content_security_policy(bool framed, std::string_view images = {});

/// Of every answer.
std::vector<std::pair<std::string_view, std::string>> security_headers(bool framed, std::string_view images = {});

/// "gzip" stands in the list and is not forbidden by q=0.
bool takes_gzip(std::string_view accepted);
bool lists_etag(std::string_view if_none_match, std::string_view etag);
/// A name that stands safely between the quotes of a header.
std::string safe_file_name(std::string_view name);

} // namespace ise
