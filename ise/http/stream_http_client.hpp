#pragma once
#include <ise/http/http_client.hpp>

#include <ise/core/loop.hpp>

namespace ise {

/// HTTP without TLS over the environment's streams: for the virtual world, and for servers on the same host. Each
/// exchange has a connection of its own. Errors beside those of `http_client`: invalid_argument for an https URL.
class stream_http_client final : public http_client {
public:
    explicit stream_http_client(loop& on) : loop_(on) {}
    task<result<http_answer>> exchange(http_exchange what, duration within) override;

private:
    loop& loop_;
};

/// The parts of "http://host:8080/path?query".
struct http_url {
    std::string host;
    std::uint16_t port = 80;
    std::string target = "/";
};
/// Errors: invalid_argument (https, or no URL).
result<http_url> parse_http_url(std::string_view url);

} // namespace ise
