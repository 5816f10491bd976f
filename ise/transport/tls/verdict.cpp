#include <ise/transport/tls/verdict.hpp>

#include <ise/transport/tls/psk.hpp>

#include <fmt/format.h>

#include <openssl/ssl.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <memory>

namespace ise::net::tls {
namespace {

// What a peer wrote, as it belongs into a line of a log.
std::string printable(std::string text) {
    constexpr std::size_t most = 200;
    if (text.size() > most) text = text.substr(0, most) + "...";
    std::ranges::replace_if(
        text, [](unsigned char letter) { return letter < 0x20 || letter >= 0x7f; }, '?');
    return text;
}

std::string written(auto&& write) {
    std::unique_ptr<BIO, decltype(&BIO_free)> to(BIO_new(BIO_s_mem()), BIO_free);
    write(to.get());
    char* data = nullptr;
    auto size = BIO_get_mem_data(to.get(), &data);
    return printable(std::string(data, static_cast<std::size_t>(std::max(size, 0L))));
}

std::string subject_of(X509* of) {
    return written([&](BIO* to) {
        X509_NAME_print_ex(to, X509_get_subject_name(of), 0, XN_FLAG_ONELINE & ~ASN1_STRFLGS_ESC_MSB);
    });
}

std::string time_of(const ASN1_TIME* at) {
    return written([&](BIO* to) { ASN1_TIME_print(to, at); });
}

// The names and addresses that it is for: "DNS:boat.local, IP Address:10.0.0.1".
std::string names_of(X509* of) {
    int at = X509_get_ext_by_NID(of, NID_subject_alt_name, -1);
    if (at < 0) return "nobody: it has no subjectAltName";
    return written([&](BIO* to) { X509V3_EXT_print(to, X509_get_ext(of, at), 0, 0); });
}

// What a peer says when it refuses, by the number of the alert.
failure refused_by_peer(int alert, std::string_view scheme) {
    auto ours = [](std::string_view why) {
        return failure(errc::unauthorized, fmt::format("it refused the certificate of this side: {}", why));
    };
    switch (alert) {
        case SSL_AD_CERTIFICATE_REQUIRED:
            return {errc::unauthorized, "it demands a certificate, and this side has shown none"};
        case SSL_AD_CERTIFICATE_EXPIRED:
            return ours("by the clock there it has expired, or the revocation list there is out of date");
        case SSL_AD_CERTIFICATE_REVOKED: return ours("it was revoked");
        case SSL_AD_DECRYPT_ERROR:
        case SSL_AD_UNKNOWN_CA:
            return ours("it was not issued by an authority that is believed there (ca.pem), or there is no revocation "
                        "list of its authority");
        case SSL_AD_BAD_CERTIFICATE:
            return ours("it is not for the name or address that was called, or not valid yet by the clock there, or "
                        "not believed there");
        case SSL_AD_UNSUPPORTED_CERTIFICATE:
            return ours("it may not be used for this (extendedKeyUsage needs serverAuth and clientAuth)");
        case SSL_AD_CERTIFICATE_UNKNOWN:
        case SSL_AD_ACCESS_DENIED: return ours("for a reason that it keeps to itself");
        case SSL_AD_PROTOCOL_VERSION: return {errc::protocol_error, "it speaks no TLS 1.3"};
        case static_cast<int>(refusal::no_key):
        case static_cast<int>(refusal::old_scheme): // a listener on tcp:// or local:// (FORMAT.md, section 17)
            return {errc::protocol_error,
                    fmt::format("it speaks without TLS: one side has {}://, the other not", scheme)};
        default:
            return {errc::protocol_error,
                    fmt::format("it ended TLS by alert {} ({})", alert, SSL_alert_desc_string_long(alert))};
    }
}

// The same where this side has no certificate, which programs in Go call a bad one.
failure refused_without_one(int alert, std::string_view scheme) {
    return refused_by_peer(alert == SSL_AD_BAD_CERTIFICATE ? SSL_AD_CERTIFICATE_REQUIRED : alert, scheme);
}

std::optional<failure> certificate_refused_here(int reason, std::string_view scheme) {
    switch (reason) {
        case SSL_R_PEER_DID_NOT_RETURN_A_CERTIFICATE: return failure(errc::unauthorized, "it showed no certificate");
        case SSL_R_EXCESSIVE_MESSAGE_SIZE:
            return failure(errc::too_large, fmt::format("it sent more than {} bytes of certificates (max_certificates)",
                                                        max_certificates));
        case SSL_R_HTTP_REQUEST:
        case SSL_R_HTTPS_PROXY_REQUEST:
        case SSL_R_PACKET_LENGTH_TOO_LONG:
        case SSL_R_WRONG_VERSION_NUMBER:
            return failure(
                errc::protocol_error,
                fmt::format("it speaks without TLS, or something else: one side has {}://, the other not", scheme));
        default: return std::nullopt;
    }
}

} // namespace

std::string objection(x509_store_ctx_st& check, const std::string& wanted_host, const std::string& authorities) {
    auto* about = X509_STORE_CTX_get_current_cert(&check);
    auto problem = X509_STORE_CTX_get_error(&check);
    auto whose = fmt::format("its certificate ({})", about ? subject_of(about) : "unreadable");
    switch (about ? problem : X509_V_ERR_UNSPECIFIED) {
        case X509_V_ERR_CERT_HAS_EXPIRED:
            return fmt::format("{} has expired: it was valid until {}", whose, time_of(X509_get0_notAfter(about)));
        case X509_V_ERR_CERT_NOT_YET_VALID:
            return fmt::format("{} is not valid before {}: is the clock right?", whose,
                               time_of(X509_get0_notBefore(about)));
        case X509_V_ERR_CERT_REVOKED: return fmt::format("{} was revoked", whose);
        case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT:
        case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT_LOCALLY:
        case X509_V_ERR_UNABLE_TO_VERIFY_LEAF_SIGNATURE:
        case X509_V_ERR_DEPTH_ZERO_SELF_SIGNED_CERT:
        case X509_V_ERR_SELF_SIGNED_CERT_IN_CHAIN:
        case X509_V_ERR_CERT_SIGNATURE_FAILURE:
            return fmt::format("{} was not issued by an authority that is believed here ({})", whose, authorities);
        case X509_V_ERR_HOSTNAME_MISMATCH:
        case X509_V_ERR_IP_ADDRESS_MISMATCH:
            return fmt::format("{} is not for '{}', but for {}", whose, wanted_host, names_of(about));
        case X509_V_ERR_UNABLE_TO_GET_CRL:
            return fmt::format(
                "{} cannot be looked up: there are revocation lists here, and none of its authority ({})", whose,
                authorities);
        case X509_V_ERR_CRL_HAS_EXPIRED:
            return fmt::format("{} cannot be looked up: the revocation list here is out of date ({})", whose,
                               authorities);
        case X509_V_ERR_CERT_CHAIN_TOO_LONG:
            return fmt::format("the chain of {} is longer than {} (max_chain)", whose, max_chain);
        case X509_V_ERR_INVALID_PURPOSE:
            return fmt::format("{} may not be used for this (extendedKeyUsage needs serverAuth and clientAuth)", whose);
        default: return fmt::format("{} is not good: {}", whose, X509_verify_cert_error_string(problem));
    }
}

failure failure_noted(std::string_view scheme, bool shows_own) {
    auto* of_alert = shows_own ? refused_by_peer : refused_without_one;
    return first_error_noted({of_alert, certificate_refused_here, "TLS broke"}, scheme);
}

} // namespace ise::net::tls
