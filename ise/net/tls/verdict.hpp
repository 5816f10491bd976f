#pragma once
#include <ise/core/error.hpp>

#include <string>

struct x509_store_ctx_st; // of OpenSSL

namespace ise::net::tls {

/// What is wrong with the certificate that a check has come to.
std::string objection(x509_store_ctx_st& check, const std::string& wanted_host);

/// What the first failure that OpenSSL noted on this thread means for the session, where no certificate of the peer was
/// found wrong here: an alert of the peer, or what came is no TLS. Clears the notes.
failure failure_noted();

} // namespace ise::net::tls
