#include <ise/transport/tls/identity.hpp>

#include <ise/transport/tls/subject.hpp>
#include <ise/transport/tls/verdict.hpp>

#include <fmt/format.h>

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>

#include <algorithm>
#include <optional>

namespace ise::net::tls {
namespace {

constexpr std::size_t max_file = 1u << 20;

template <auto Free>
struct freeing {
    template <class T>
    void operator()(T* what) const noexcept {
        Free(what);
    }
};
using bio = std::unique_ptr<BIO, freeing<BIO_free>>;
using certificate = std::unique_ptr<X509, freeing<X509_free>>;
using private_key = std::unique_ptr<EVP_PKEY, freeing<EVP_PKEY_free>>;
using revocations = std::unique_ptr<X509_CRL, freeing<X509_CRL_free>>;

bio over(const std::string& text) { return bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size()))); }

// The first thing that went wrong, in OpenSSL's words.
std::string cause() {
    auto code = ERR_get_error();
    ERR_clear_error();
    const char* text = code ? ERR_reason_error_string(code) : nullptr;
    return text ? text : "it is not in PEM";
}

// Nobody is asked for a passphrase: what waits for one hangs.
int no_passphrase(char*, int, int, void*) { return 0; }

// Whether reading has stopped at the end of a file; if not, at a damaged block, and `cause` says why.
bool is_at_end() {
    if (ERR_GET_REASON(ERR_peek_last_error()) != PEM_R_NO_START_LINE) return false;
    ERR_clear_error();
    return true;
}

// Every certificate of a file; nothing if it is damaged.
std::optional<std::vector<certificate>> certificates_of(const std::string& text) {
    auto from = over(text);
    std::vector<certificate> all;
    while (auto* one = PEM_read_bio_X509(from.get(), nullptr, no_passphrase, nullptr)) all.emplace_back(one);
    if (!is_at_end()) return std::nullopt;
    return all;
}

failure unusable(const std::string& file, std::string_view why) {
    return {errc::invalid_argument, fmt::format("{} cannot be used: {}", file, why)};
}

} // namespace

result<std::shared_ptr<identity>> identity::load(environment& env, identity_files from) {
    std::shared_ptr<identity> made(new identity(std::move(from)));
    made->refresh(env);
    if (made->trouble_) return std::move(*made->trouble_);
    return made;
}

result<std::shared_ptr<identity>> identity::load(environment& env, const std::string& folder) {
    identity_files from{folder + "/ca.pem", folder + "/certificate.pem", folder + "/key.pem"};
    return load(env, std::move(from));
}

result<std::shared_ptr<ssl_ctx_st>> identity::context(environment& env) {
    std::lock_guard lock(mutex_);
    if (env.now() - read_at_ >= reread_after) refresh(env);
    if (trouble_)
        return failure(trouble_->code(), fmt::format("no session with TLS can be made: {}", trouble_->message()));
    return made_;
}

bool identity::revoked(environment& env, const std::vector<std::string>& chain) {
    std::lock_guard lock(mutex_);
    if (env.now() - read_at_ >= reread_after) refresh(env); // new sessions report why it cannot
    return std::ranges::any_of(chain, [&](const auto& one) { return revoked_.contains(one); });
}

void identity::refresh(environment& env) {
    read_at_ = env.now(); // also where they cannot be used: strangers cause no reading
    auto outcome = reread(env);
    trouble_.reset();
    if (!outcome) trouble_ = outcome.error();
}

result<void> identity::reread(environment& env) {
    auto now = read(env);
    if (!now) return now.error();
    if (!made_ || !(*now == seen_)) {
        auto built = build(*now);
        if (!built) return built.error();
        made_ = std::move(*built);
        seen_ = std::move(*now);
    }
    return {};
}

result<identity::contents> identity::read(environment& env) const {
    contents made;
    auto authorities = env.read_trusted(files_.authorities, max_file);
    if (!authorities) return authorities.error();
    made.authorities = std::move(*authorities);
    if (files_.certificate.empty()) return made;
    auto certificate = env.read_trusted(files_.certificate, max_file);
    if (!certificate) return certificate.error();
    auto key = env.read_secret(files_.key, max_file);
    if (!key) return key.error();
    made.certificate = std::move(*certificate);
    made.key = std::move(*key);
    return made;
}

// Its own certificate and key; the identity in it.
result<std::string> identity::show_own(SSL_CTX* to, const contents& from) const {
    auto own = certificates_of(from.certificate);
    if (!own) return unusable(files_.certificate, cause());
    if (own->empty()) return unusable(files_.certificate, "there is no certificate in it");
    if (SSL_CTX_use_certificate(to, own->front().get()) != 1) return unusable(files_.certificate, cause());
    for (std::size_t at = 1; at < own->size(); ++at)
        if (SSL_CTX_add1_chain_cert(to, (*own)[at].get()) != 1) return unusable(files_.certificate, cause());
    auto about = subject_of(*own->front());
    if (!about) return unusable(files_.certificate, about.error().message());
    private_key key(PEM_read_bio_PrivateKey(over(from.key).get(), nullptr, no_passphrase, nullptr));
    if (!key) return unusable(files_.key, fmt::format("{} (it must be a private key without a passphrase)", cause()));
    if (SSL_CTX_use_PrivateKey(to, key.get()) != 1)
        return unusable(files_.key, fmt::format("it does not belong to {} ({})", files_.certificate, cause()));
    return std::move(about->identity);
}

result<std::shared_ptr<ssl_ctx_st>> identity::build(const contents& from) {
    ERR_clear_error();
    std::shared_ptr<SSL_CTX> made(SSL_CTX_new(TLS_method()), SSL_CTX_free);
    if (!made) return failure(errc::io_failed, fmt::format("OpenSSL makes no context: {}", cause()));
    auto* to = made.get();
    SSL_CTX_set_min_proto_version(to, TLS1_3_VERSION);
    SSL_CTX_set_max_proto_version(to, TLS1_3_VERSION);
    SSL_CTX_set_mode(to, SSL_MODE_RELEASE_BUFFERS);
    SSL_CTX_set_num_tickets(to, 0); // every session begins with both certificates
    SSL_CTX_set_session_cache_mode(to, SSL_SESS_CACHE_OFF);
    SSL_CTX_set_max_cert_list(to, max_certificates);
    SSL_CTX_set_default_passwd_cb(to, no_passphrase);
    SSL_CTX_set_verify_depth(to, max_chain);

    std::string who;
    if (!files_.certificate.empty()) {
        auto own = show_own(to, from);
        if (!own) return own.error();
        who = std::move(*own);
    }

    auto* store = SSL_CTX_get_cert_store(to);
    auto authorities = certificates_of(from.authorities);
    if (!authorities) return unusable(files_.authorities, cause());
    if (authorities->empty()) return unusable(files_.authorities, "there is no certificate in it");
    for (const auto& one : *authorities)
        if (X509_STORE_add_cert(store, one.get()) != 1) return unusable(files_.authorities, cause());
    auto lists = over(from.authorities);
    int count = 0;
    std::set<std::string> listed;
    while (auto list = revocations(PEM_read_bio_X509_CRL(lists.get(), nullptr, no_passphrase, nullptr))) {
        if (X509_STORE_add_crl(store, list.get()) != 1) return unusable(files_.authorities, cause());
        ++count;
        auto* entries = X509_CRL_get_REVOKED(list.get());
        for (int at = 0; entries && at < sk_X509_REVOKED_num(entries); ++at)
            listed.insert(listed_as(*X509_CRL_get_issuer(list.get()),
                                    *X509_REVOKED_get0_serialNumber(sk_X509_REVOKED_value(entries, at))));
    }
    if (!is_at_end()) return unusable(files_.authorities, cause()); // a damaged list revokes nobody
    // Where there was a list once, none is not an empty one.
    if (count == 0 && knows_revoked_)
        return unusable(files_.authorities, "it had a revocation list before, and has none now");
    if (count > 0) X509_STORE_set_flags(store, X509_V_FLAG_CRL_CHECK | X509_V_FLAG_CRL_CHECK_ALL);
    knows_revoked_ = count > 0;
    revoked_ = std::move(listed);
    who_ = std::move(who);
    return std::shared_ptr<ssl_ctx_st>(std::move(made));
}

} // namespace ise::net::tls
