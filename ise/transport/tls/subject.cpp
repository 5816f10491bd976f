#include <ise/transport/tls/subject.hpp>

#include <ise/access/policy.hpp>

#include <fmt/format.h>

#include <openssl/bn.h>
#include <openssl/crypto.h>
#include <openssl/x509v3.h>

#include <memory>
#include <string_view>

namespace ise::net::tls {
namespace {

constexpr std::string_view identity_scheme = "ise://";

std::string text_of(const ASN1_INTEGER& serial) {
    std::unique_ptr<BIGNUM, decltype(&BN_free)> number(ASN1_INTEGER_to_BN(&serial, nullptr), BN_free);
    if (!number) return {};
    char* text = BN_bn2hex(number.get());
    std::string made = text ? text : "";
    OPENSSL_free(text);
    return made;
}

} // namespace

std::string listed_as(const X509_NAME& issuer, const ASN1_INTEGER& serial) {
    // The hash is of the canonical form: a list may encode the issuer differently than the certificate does.
    int good = 0;
    return fmt::format("{} of {:08x}", text_of(serial), X509_NAME_hash_ex(&issuer, nullptr, nullptr, &good));
}

std::vector<std::string> chain_of(X509_STORE_CTX& check) {
    std::vector<std::string> made;
    auto* chain = X509_STORE_CTX_get0_chain(&check);
    for (int at = 0; chain && at < sk_X509_num(chain); ++at) {
        const auto* one = sk_X509_value(chain, at);
        made.push_back(listed_as(*X509_get_issuer_name(one), *X509_get0_serialNumber(one)));
    }
    return made;
}

result<subject> subject_of(x509_st& certificate) {
    subject made;
    made.serial = text_of(*X509_get0_serialNumber(&certificate));
    auto* found = static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(&certificate, NID_subject_alt_name, nullptr, nullptr));
    std::unique_ptr<GENERAL_NAMES, decltype(&GENERAL_NAMES_free)> names(found, GENERAL_NAMES_free);
    std::string identity;
    int identities = 0;
    for (int at = 0; names && at < sk_GENERAL_NAME_num(names.get()); ++at) {
        const auto* one = sk_GENERAL_NAME_value(names.get(), at);
        if (one->type != GEN_URI) continue;
        ++identities;
        const auto* text = one->d.uniformResourceIdentifier;
        // By its length: it may hold a zero.
        identity.assign(reinterpret_cast<const char*>(ASN1_STRING_get0_data(text)),
                        static_cast<std::size_t>(ASN1_STRING_length(text)));
    }
    if (identities > 1)
        return failure(
            errc::unauthorized,
            fmt::format("its certificate has {} URIs, and so {} identities: one is allowed", identities, identities));
    if (!std::string_view(identity).starts_with(identity_scheme)) return made;
    if (auto good = access::check_identity(identity); !good)
        return failure(errc::unauthorized, "its certificate: " + good.error().message());
    made.identity = std::move(identity);
    return made;
}

} // namespace ise::net::tls
