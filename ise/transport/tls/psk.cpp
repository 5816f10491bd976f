#include <ise/transport/tls/psk.hpp>

#include <fmt/format.h>

#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/ssl.h>

#include <string_view>

#if defined(__aarch64__) && defined(__linux__)
    #include <sys/auxv.h>
#endif

namespace ise::net::tls {
namespace {

constexpr std::string_view psk_identity = "ISE1";

// Where the processor has no instructions for AES, ChaCha20 is several times faster.
bool has_aes() noexcept {
#if defined(__x86_64__) || defined(__i386__)
    return __builtin_cpu_supports("aes") != 0;
#elif defined(__aarch64__) && defined(__linux__)
    constexpr unsigned long aes = 1u << 3;
    return (::getauxval(AT_HWCAP) & aes) != 0;
#else
    return false;
#endif
}

const char* suites(bool aes) noexcept {
    return aes ? "TLS_AES_128_GCM_SHA256:TLS_CHACHA20_POLY1305_SHA256"
               : "TLS_CHACHA20_POLY1305_SHA256:TLS_AES_128_GCM_SHA256";
}

SSL_SESSION* session_with_key(SSL* tls) {
    constexpr unsigned char aes_128_gcm_sha256[] = {0x13, 0x01}; // any suite with SHA-256 may be chosen then
    const auto* secret = static_cast<const psk_secret*>(SSL_CTX_get_app_data(SSL_get_SSL_CTX(tls)));
    std::unique_ptr<SSL_SESSION, decltype(&SSL_SESSION_free)> made(SSL_SESSION_new(), SSL_SESSION_free);
    const auto* suite = SSL_CIPHER_find(tls, aes_128_gcm_sha256);
    if (!made || !suite || SSL_SESSION_set1_master_key(made.get(), secret->data(), secret->size()) != 1 ||
        SSL_SESSION_set_cipher(made.get(), suite) != 1 ||
        SSL_SESSION_set1_id_context(made.get(), reinterpret_cast<const unsigned char*>(psk_identity.data()),
                                    psk_identity.size()) != 1 ||
        SSL_SESSION_set_protocol_version(made.get(), TLS1_3_VERSION) != 1)
        return nullptr;
    return made.release();
}

// Of the side that calls. OpenSSL owns the session then.
int offer(SSL* tls, const EVP_MD* digest, const unsigned char** name, std::size_t* size, SSL_SESSION** session) {
    *session = nullptr;
    if (digest && !EVP_MD_is_a(digest, "SHA256")) return 1; // none: the handshake fails for want of a key
    *session = session_with_key(tls);
    *name = reinterpret_cast<const unsigned char*>(psk_identity.data());
    *size = psk_identity.size();
    return *session ? 1 : 0;
}

// Of the side that is called.
int find(SSL* tls, const unsigned char* name, std::size_t size, SSL_SESSION** session) {
    *session = nullptr;
    if (std::string_view(reinterpret_cast<const char*>(name), size) != psk_identity) return 1;
    *session = session_with_key(tls);
    return *session ? 1 : 0;
}

failure key_refused_by_peer(int alert, std::string_view scheme) {
    switch (alert) {
        case SSL_AD_ILLEGAL_PARAMETER:
        case SSL_AD_DECRYPT_ERROR:
            return {errc::unauthorized, "it refused the session: the shared key there is another one"};
        case static_cast<int>(refusal::no_key):
            return {errc::unauthorized, "it refused the session: no shared key is known there (start it with --key "
                                        "FILE or ISE_KEY)"};
        case static_cast<int>(refusal::old_scheme):
            return {errc::unauthorized, "it refused the session: the shared key is proved by the old scheme there "
                                        "(ISE_KEY_LEGACY=1, --key-legacy); start both sides with it, or neither"};
        case SSL_AD_HANDSHAKE_FAILURE:
        case SSL_AD_CERTIFICATE_REQUIRED:
            return {errc::unauthorized,
                    fmt::format("it refused the session: it takes certificates there, and no shared "
                                "key (dial {}://)",
                                scheme)};
        case SSL_AD_PROTOCOL_VERSION: return {errc::protocol_error, "it speaks no TLS 1.3"};
        default:
            return {errc::protocol_error, fmt::format("it ended the sealed session by alert {} ({})", alert,
                                                      SSL_alert_desc_string_long(alert))};
    }
}

std::optional<failure> key_refused_here(int reason, std::string_view scheme) {
    switch (reason) {
        case SSL_R_BINDER_DOES_NOT_VERIFY: return failure(errc::unauthorized, "the shared key here is another one");
        case SSL_R_CERTIFICATE_VERIFY_FAILED:
            return failure(errc::unauthorized,
                           fmt::format("it shows a certificate instead of the shared key (dial {}://)", scheme));
        case SSL_R_NO_SHARED_CIPHER:
        case SSL_R_NO_SUITABLE_SIGNATURE_ALGORITHM:
        case SSL_R_NO_CERTIFICATE_SET:
            return failure(errc::unauthorized,
                           fmt::format("a shared key is demanded here, and TLS without it was offered: it dials {}://, "
                                       "or has something else in mind",
                                       scheme));
        case SSL_R_HTTP_REQUEST:
        case SSL_R_HTTPS_PROXY_REQUEST:
        case SSL_R_PACKET_LENGTH_TOO_LONG:
        case SSL_R_WRONG_VERSION_NUMBER:
            return failure(errc::protocol_error,
                           "it does not seal the session: it has no shared key, or it is something else");
        default: return std::nullopt;
    }
}

} // namespace

result<std::shared_ptr<ssl_ctx_st>> psk_context(const psk_secret& secret) {
    ERR_clear_error();
    std::shared_ptr<SSL_CTX> made(SSL_CTX_new(TLS_method()), SSL_CTX_free);
    auto* to = made.get();
    const bool aes = has_aes();
    if (!to || SSL_CTX_set_min_proto_version(to, TLS1_3_VERSION) != 1 ||
        SSL_CTX_set_max_proto_version(to, TLS1_3_VERSION) != 1 || SSL_CTX_set_ciphersuites(to, suites(aes)) != 1 ||
        SSL_CTX_set_session_id_context(to, reinterpret_cast<const unsigned char*>(psk_identity.data()),
                                       psk_identity.size()) != 1) {
        auto code = ERR_get_error();
        ERR_clear_error();
        const char* text = code ? ERR_reason_error_string(code) : nullptr;
        return failure(errc::io_failed, fmt::format("OpenSSL seals no sessions here: {}", text ? text : "no TLS 1.3"));
    }
    if (!aes) SSL_CTX_set_options(to, SSL_OP_CIPHER_SERVER_PREFERENCE); // the weaker end decides
    SSL_CTX_set_mode(to, SSL_MODE_RELEASE_BUFFERS);
    SSL_CTX_clear_options(to, SSL_OP_ENABLE_MIDDLEBOX_COMPAT); // nobody else's port is used
    SSL_CTX_set_num_tickets(to, 0);                            // every session has an exchange of its own
    SSL_CTX_set_session_cache_mode(to, SSL_SESS_CACHE_OFF);
    SSL_CTX_set_verify(to, SSL_VERIFY_PEER, nullptr); // no authority is believed: a certificate is no key
    SSL_CTX_set_app_data(to, const_cast<psk_secret*>(&secret));
    SSL_CTX_set_psk_use_session_callback(to, offer);
    SSL_CTX_set_psk_find_session_callback(to, find);
    return std::shared_ptr<ssl_ctx_st>(std::move(made));
}

bool use_sealing_ciphers(SSL* session) noexcept {
    const bool aes = has_aes();
    if (!aes) SSL_set_options(session, SSL_OP_CIPHER_SERVER_PREFERENCE); // the weaker end decides
    return SSL_set_ciphersuites(session, suites(aes)) == 1;
}

failure first_error_noted(const error_meanings& here, std::string_view scheme) {
    auto code = ERR_get_error();
    ERR_clear_error();
    if (code != 0 && ERR_GET_LIB(code) == ERR_LIB_SSL) {
        int reason = ERR_GET_REASON(code);
        if (reason >= SSL_AD_REASON_OFFSET) return here.of_alert(reason - SSL_AD_REASON_OFFSET, scheme);
        if (reason == SSL_R_UNSUPPORTED_PROTOCOL || reason == SSL_R_VERSION_TOO_LOW)
            return {errc::protocol_error, "it speaks no TLS 1.3"};
        if (auto special = here.of_reason(reason, scheme)) return *special;
    }
    const char* text = code ? ERR_reason_error_string(code) : nullptr;
    return {errc::protocol_error,
            fmt::format("{}: {}", here.otherwise, text ? text : "for no reason that OpenSSL tells")};
}

failure psk_failure_noted(std::string_view scheme) {
    return first_error_noted({key_refused_by_peer, key_refused_here, "the sealed session broke"}, scheme);
}

} // namespace ise::net::tls
