#pragma once
#include <ise/core/result.hpp>

#include <string>
#include <vector>

struct asn1_string_st; // of OpenSSL
struct X509_name_st;
struct x509_st;
struct x509_store_ctx_st;

namespace ise::net::tls {

/// Whom a certificate is about.
struct subject {
    std::string identity; ///< `ise://SYSTEM/NAME`, its one URI; empty: it has none, or one of another kind
    std::string serial;   ///< hexadecimal
    /// Of each certificate of the chain that was verified, its own first, as `listed_as` has it.
    std::vector<std::string> chain;
};

/// A certificate as a revocation list names it: a serial is unique for its issuer only.
std::string listed_as(const X509_name_st& issuer, const asn1_string_st& serial);
/// The same of each certificate of a chain that is being verified.
std::vector<std::string> chain_of(x509_store_ctx_st& check);

/// Reads it. errc::unauthorized: it has several URIs, so that it could mean either, or one of ISE that is malformed.
result<subject> subject_of(x509_st& certificate);

} // namespace ise::net::tls
