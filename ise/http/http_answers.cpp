#include <ise/http/http_answers.hpp>

#include <algorithm>
#include <cctype>

namespace ise {

std::string_view reason_of(int status) noexcept {
    switch (status) {
        case 101: return "Switching Protocols";
        case 200: return "OK";
        case 304: return "Not Modified";
        case 400: return "Bad Request";
        case 401: return "Unauthorized";
        case 403: return "Forbidden";
        case 404: return "Not Found";
        case 405: return "Method Not Allowed";
        case 408: return "Request Timeout";
        case 413: return "Payload Too Large";
        case 414: return "URI Too Long";
        case 426: return "Upgrade Required";
        case 431: return "Request Header Fields Too Large";
        case 500: return "Internal Server Error";
        case 503: return "Service Unavailable";
        default: return "Status";
    }
}

std::string content_security_policy(bool framed, std::string_view images) {
    std::string policy = "default-src 'self'; img-src 'self' data:" + std::string(images) +
                         "; object-src 'none'; base-uri 'none'; "
                         "form-action 'none'; frame-ancestors ";
    return policy + (framed ? "*" : "'self'");
}

std::vector<std::pair<std::string_view, std::string>> security_headers(bool framed, std::string_view images) {
    return {{"Content-Security-Policy", content_security_policy(framed, images)},
            {"X-Content-Type-Options", "nosniff"},
            {"Referrer-Policy", "no-referrer"},
            {"Cross-Origin-Opener-Policy", "same-origin"},
            {"Permissions-Policy", "geolocation=(), camera=(), microphone=()"}};
}

bool takes_gzip(std::string_view accepted) {
    for (std::size_t at = 0; at <= accepted.size();) {
        auto end = std::min(accepted.find(',', at), accepted.size());
        auto part = accepted.substr(at, end - at);
        at = end + 1;
        while (!part.empty() && part.front() == ' ') part.remove_prefix(1);
        if (part.substr(0, 4) != "gzip") continue;
        auto weight = part.find("q=");
        return weight == std::string_view::npos || part.find_first_of("123456789", weight) != std::string_view::npos;
    }
    return false;
}

bool lists_etag(std::string_view if_none_match, std::string_view etag) {
    return if_none_match == "*" || if_none_match.find(etag) != std::string_view::npos;
}

std::string safe_file_name(std::string_view name) {
    std::string safe;
    for (char c : name)
        safe += (std::isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '-' || c == '_') ? c : '_';
    return safe;
}

} // namespace ise
