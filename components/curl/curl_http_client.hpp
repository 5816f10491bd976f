#pragma once
#include <components/curl/curl_transfers.hpp>
#include <ise/http/http_client.hpp>

namespace atirma {

struct curl_http_options {
    std::string ca_file; ///< PEM file of the authorities to trust; empty: those of the system
    std::string proxy;   ///< "http://proxy.example:3128"; the process's variables are not looked at
};

/// HTTP and HTTPS by libcurl. Redirections are answers like others; each exchange has a connection of its own, so that
/// no request is ever sent twice. Certificates are always verified. Lifetime: `on` outlives it.
class curl_http_client final : public ise::http_client {
public:
    explicit curl_http_client(curl_transfers& on, curl_http_options options = curl_http_options())
        : on_(on), options_(std::move(options)) {}

    ise::task<ise::result<ise::http_answer>> exchange(ise::http_exchange what, ise::duration within) override;

private:
    curl_transfers& on_;
    curl_http_options options_;
};

} // namespace atirma
