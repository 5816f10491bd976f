#pragma once
#include <ise/core/error.hpp>

#include <string>
#include <string_view>

struct x509_store_ctx_st; // of OpenSSL

namespace ise::net::tls {

/// What a peer may show: certificates between its own and an authority that is believed, and bytes of all of them.
inline constexpr int max_chain = 5;
inline constexpr long max_certificates = 32 * 1024;

/// What is wrong with the certificate that a check has come to. `authorities`: the file with those believed here.
std::string objection(x509_store_ctx_st& check, const std::string& wanted_host, const std::string& authorities);

/// What the first failure that OpenSSL noted on this thread means for the session, where no certificate of the peer was
/// found wrong here: an alert of the peer, or what came is no TLS. Clears the notes. `scheme`: "tls" or "udp+tls".
/// `shows_own`: this side has a certificate.
failure failure_noted(std::string_view scheme, bool shows_own);

} // namespace ise::net::tls
