#pragma once
#include <ise/core/result.hpp>

#include <string>

struct x509_st; // of OpenSSL

namespace ise::net::tls {

/// Whom a certificate is about.
struct subject {
    std::string identity; ///< `ise://SYSTEM/NAME`, its one URI; empty: it has none, or one of another kind
    std::string serial;   ///< hexadecimal
};

/// Reads it. errc::unauthorized: it has several URIs, so that it could mean either, or one of ISE that is malformed.
result<subject> subject_of(x509_st& certificate);

} // namespace ise::net::tls
