#include <ise/transport/tls/proof.hpp>

#include <ise/core/environment.hpp>
#include <ise/transport/shared_key.hpp>
#include <ise/transport/tls/identity.hpp>
#include <ise/transport/tls/psk.hpp>
#include <ise/transport/tls/verdict.hpp>

#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>

namespace ise::net::tls {
namespace {

// Called for each certificate of the peer.
int on_certificate(int good, X509_STORE_CTX* check) {
    auto* tls = static_cast<SSL*>(X509_STORE_CTX_get_ex_data(check, SSL_get_ex_data_X509_STORE_CTX_idx()));
    auto* to = static_cast<shown_certificate*>(SSL_get_app_data(tls));
    if (!good) {
        to->objection.emplace(errc::unauthorized, objection(*check, to->host, to->authorities));
        return 0;
    }
    auto* about = X509_STORE_CTX_get_current_cert(check);
    if (!about || X509_STORE_CTX_get_error_depth(check) != 0) return 1;
    auto whom = subject_of(*about);
    if (whom) {
        to->about = std::move(*whom);
        to->about.chain = chain_of(*check);
        return 1;
    }
    to->objection = whom.error();
    X509_STORE_CTX_set_error(check, X509_V_ERR_APPLICATION_VERIFICATION);
    return 0;
}

class certificate_proof final : public proof {
public:
    certificate_proof(std::shared_ptr<identity> with, environment& env) : with_(std::move(with)), env_(env) {}

    result<std::shared_ptr<ssl_ctx_st>> context() const override { return with_->context(env_); }
    bool prepare(SSL* session, shown_certificate& to) const override;
    failure noted(std::string_view scheme) const override {
        return failure_noted(scheme, !with_->files().certificate.empty());
    }
    failure stranger(std::string_view) const override {
        return {errc::unauthorized, "certificates are required here, and TLS was not begun: it dials udp://, and this "
                                    "side listens on udp+tls://"};
    }
    std::string_view what_began() const override { return "TLS"; }
    std::optional<endpoint> local(std::optional<endpoint> below) const override {
        if (below) below->kind = protocol::tls;
        return below;
    }

private:
    std::shared_ptr<identity> with_;
    environment& env_;
};

bool certificate_proof::prepare(SSL* session, shown_certificate& to) const {
    to.authorities = with_->files().authorities;
    SSL_set_app_data(session, &to);
    SSL_set_verify(session, SSL_VERIFY_PEER | SSL_VERIFY_FAIL_IF_NO_PEER_CERT, on_certificate);
    auto* rules = SSL_get0_param(session);
    X509_VERIFY_PARAM_set_time(rules, std::chrono::system_clock::to_time_t(env_.wall()));
    const auto& host = to.host;
    if (host.empty()) return true;
    if (X509_VERIFY_PARAM_set1_ip_asc(rules, host.c_str()) == 1) return true;
    ERR_clear_error();
    X509_VERIFY_PARAM_set_hostflags(rules, X509_CHECK_FLAG_NEVER_CHECK_SUBJECT | X509_CHECK_FLAG_NO_PARTIAL_WILDCARDS);
    return X509_VERIFY_PARAM_set1_host(rules, host.data(), host.size()) == 1 &&
           SSL_set_tlsext_host_name(session, host.c_str()) == 1;
}

class key_proof final : public proof {
public:
    explicit key_proof(std::shared_ptr<const shared_key> with) : with_(std::move(with)) {}

    result<std::shared_ptr<ssl_ctx_st>> context() const override { return with_->sealing(); }
    bool prepare(SSL*, shown_certificate&) const override { return true; }
    std::optional<failure> missing(SSL* session) const override;
    failure noted(std::string_view scheme) const override { return psk_failure_noted(scheme); }
    failure stranger(std::string_view begin) const override {
        return {errc::unauthorized, std::string(why_no_session(begin))};
    }
    bool answers_strangers() const override { return true; }
    std::string_view what_began() const override { return "the sealed session"; }
    std::optional<endpoint> local(std::optional<endpoint> below) const override { return below; }

private:
    std::shared_ptr<const shared_key> with_;
};

// OpenSSL could go on without the key where a peer shows a certificate; there is none that is believed here.
std::optional<failure> key_proof::missing(SSL* session) const {
    if (SSL_session_reused(session) == 1) return std::nullopt;
    return failure(errc::unauthorized, "it did not prove that it knows the shared key of this side");
}

} // namespace

std::unique_ptr<proof> by_certificate(std::shared_ptr<identity> with, environment& env) {
    return std::make_unique<certificate_proof>(std::move(with), env);
}

std::unique_ptr<proof> by_key(std::shared_ptr<const shared_key> with) {
    return std::make_unique<key_proof>(std::move(with));
}

} // namespace ise::net::tls
