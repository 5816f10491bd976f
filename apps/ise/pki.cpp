#include "pki.hpp"

#include "exit_code.hpp"
#include "text.hpp"

#include <ise/core/time_text.hpp>
#include <ise/naming/services.hpp>

#include <fmt/format.h>

#include <openssl/bn.h>
#include <openssl/ec.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <ctime>
#include <memory>
#include <string_view>

namespace ise::cli::pki {
namespace {

constexpr std::string_view scheme = "ise://";
constexpr std::size_t max_common_name = 64; // of X.509
constexpr std::size_t max_hosts = 64;
constexpr int min_security_bits = 112;        // of a key that somebody else made
constexpr auto slack = std::chrono::hours(1); // of clocks that are slow

template <auto Free>
struct freeing {
    template <class T>
    void operator()(T* what) const noexcept {
        Free(what);
    }
};
void free_extensions(STACK_OF(X509_EXTENSION) * all) { sk_X509_EXTENSION_pop_free(all, X509_EXTENSION_free); }

using bio = std::unique_ptr<BIO, freeing<BIO_free>>;
using certificate_ptr = std::unique_ptr<X509, freeing<X509_free>>;
using request_ptr = std::unique_ptr<X509_REQ, freeing<X509_REQ_free>>;
using list_ptr = std::unique_ptr<X509_CRL, freeing<X509_CRL_free>>;
using key_ptr = std::unique_ptr<EVP_PKEY, freeing<EVP_PKEY_free>>;
using names_ptr = std::unique_ptr<GENERAL_NAMES, freeing<GENERAL_NAMES_free>>;
using time_ptr = std::unique_ptr<ASN1_TIME, freeing<ASN1_TIME_free>>;
using integer_ptr = std::unique_ptr<ASN1_INTEGER, freeing<ASN1_INTEGER_free>>;
using number_ptr = std::unique_ptr<BIGNUM, freeing<BN_free>>;
using extensions_ptr = std::unique_ptr<STACK_OF(X509_EXTENSION), freeing<free_extensions>>;

[[noreturn]] void fail(const std::string& what, const std::string& advice = {}) {
    throw problem(exit_code::failed, "keys", what, advice);
}

// The first thing that went wrong, in OpenSSL's words.
std::string cause() {
    auto code = ERR_get_error();
    ERR_clear_error();
    const char* text = code ? ERR_reason_error_string(code) : nullptr;
    return text ? text : "for no reason that OpenSSL tells";
}

void must(bool went, std::string_view what) {
    if (!went) fail(fmt::format("OpenSSL cannot {}: {}", what, cause()));
}

int no_passphrase(char*, int, int, void*) { return 0; }

bio over(const std::string& text) { return bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size()))); }

std::string text_of(BIO* from) {
    char* data = nullptr;
    auto size = BIO_get_mem_data(from, &data);
    return std::string(data, static_cast<std::size_t>(std::max(size, 0L)));
}

template <class Write>
std::string written(Write write) {
    bio to(BIO_new(BIO_s_mem()));
    must(to && write(to.get()), "write it");
    return text_of(to.get());
}

std::string pem_of(X509* one) {
    return written([&](BIO* to) { return PEM_write_bio_X509(to, one) == 1; });
}
std::string pem_of(X509_CRL* one) {
    return written([&](BIO* to) { return PEM_write_bio_X509_CRL(to, one) == 1; });
}

certificate_ptr read_certificate(const std::string& text, std::string_view what) {
    certificate_ptr made(PEM_read_bio_X509(over(text).get(), nullptr, no_passphrase, nullptr));
    if (!made) fail(fmt::format("{} is no certificate in PEM ({})", what, cause()));
    return made;
}

list_ptr read_list(const std::string& text) {
    list_ptr made(PEM_read_bio_X509_CRL(over(text).get(), nullptr, no_passphrase, nullptr));
    if (!made) fail(fmt::format("the authority's list of revoked certificates is none in PEM ({})", cause()));
    return made;
}

key_ptr new_key() {
    key_ptr made(EVP_EC_gen("P-256"));
    must(made != nullptr, "make a key");
    return made;
}

std::string pem_of_key(EVP_PKEY* one) {
    return written(
        [&](BIO* to) { return PEM_write_bio_PKCS8PrivateKey(to, one, nullptr, nullptr, 0, nullptr, nullptr) == 1; });
}

// Of keys that sign without one of their own.
const EVP_MD* digest_for(EVP_PKEY* key) {
    return EVP_PKEY_is_a(key, "ED25519") || EVP_PKEY_is_a(key, "ED448") ? nullptr : EVP_sha256();
}

// A time_t of 32 bits ends in 2038, so times are not put together as one.
time_ptr time_at(moment at) {
    auto day = std::chrono::floor<days>(at);
    time_ptr made(ASN1_TIME_adj(nullptr, 0, static_cast<int>(day.time_since_epoch().count()),
                                static_cast<long>((at - day).count())));
    must(made != nullptr, "write a time");
    return made;
}

moment moment_of(const ASN1_TIME* at) {
    std::tm parts{};
    if (!at || ASN1_TIME_to_tm(at, &parts) != 1) fail("a time in it cannot be read");
    auto day = std::chrono::year(parts.tm_year + 1900) / (parts.tm_mon + 1) / parts.tm_mday;
    return std::chrono::sys_days(day) + std::chrono::hours(parts.tm_hour) + std::chrono::minutes(parts.tm_min) +
           std::chrono::seconds(parts.tm_sec);
}

std::string hex_of(const ASN1_INTEGER* number) {
    number_ptr wide(ASN1_INTEGER_to_BN(number, nullptr));
    must(wide != nullptr, "read a serial");
    std::unique_ptr<char, freeing<[](char* text) { OPENSSL_free(text); }>> text(BN_bn2hex(wide.get()));
    must(text != nullptr, "write a serial");
    return text.get();
}

void number_it(X509* one) {
    number_ptr drawn(BN_new());
    must(drawn && BN_rand(drawn.get(), 127, BN_RAND_TOP_ONE, BN_RAND_BOTTOM_ANY) == 1, "draw a serial");
    must(BN_to_ASN1_INTEGER(drawn.get(), X509_get_serialNumber(one)) != nullptr, "write a serial");
}

void add_part(X509_NAME* to, const char* field, const std::string& value) {
    must(X509_NAME_add_entry_by_txt(to, field, MBSTRING_UTF8, reinterpret_cast<const unsigned char*>(value.data()),
                                    static_cast<int>(value.size()), -1, 0) == 1,
         "write a name");
}

void add_extension(X509* to, X509* issuer, int which, const char* value) {
    X509V3_CTX context;
    X509V3_set_ctx_nodb(&context);
    X509V3_set_ctx(&context, issuer, to, nullptr, nullptr, 0);
    std::unique_ptr<X509_EXTENSION, freeing<X509_EXTENSION_free>> made(
        X509V3_EXT_conf_nid(nullptr, &context, which, value));
    must(made && X509_add_ext(to, made.get(), -1) == 1, "write an extension");
}

// Letters, digits, '-', '.', and a '*' for the first label.
bool is_host_name(std::string_view text) {
    if (text.starts_with("*.")) text.remove_prefix(2);
    if (text.empty() || text.size() > 253 || text.front() == '.' || text.back() == '.') return false;
    if (text.find("..") != text.npos) return false;
    return std::ranges::all_of(text, [](char letter) {
        return (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') ||
               (letter >= '0' && letter <= '9') || letter == '-' || letter == '.' || letter == '_';
    });
}

void add_name(GENERAL_NAMES* to, int kind, ASN1_STRING* value) {
    auto* made = GENERAL_NAME_new();
    must(made && value, "write a subjectAltName");
    GENERAL_NAME_set0_value(made, kind, value);
    must(sk_GENERAL_NAME_push(to, made) > 0, "write a subjectAltName");
}

void add_text(GENERAL_NAMES* to, int kind, const std::string& text) {
    auto* value = ASN1_IA5STRING_new();
    must(value && ASN1_STRING_set(value, text.data(), static_cast<int>(text.size())) == 1, "write a subjectAltName");
    add_name(to, kind, value);
}

names_ptr names_of(const subject& whose) {
    names_ptr made(sk_GENERAL_NAME_new_null());
    must(made != nullptr, "write a subjectAltName");
    add_text(made.get(), GEN_URI, whose.identity);
    if (whose.hosts.size() > max_hosts)
        fail(fmt::format("{} hosts are too many for a certificate: at most {}", whose.hosts.size(), max_hosts));
    for (const auto& host : whose.hosts) {
        auto* address = a2i_IPADDRESS(host.c_str());
        ERR_clear_error();
        if (address) {
            add_name(made.get(), GEN_IPADD, address);
        } else {
            if (!is_host_name(host))
                throw problem(exit_code::usage, "usage", fmt::format("'{}' is no name or address of a host", host),
                              "such as --host boat.local --host 192.168.1.17");
            add_text(made.get(), GEN_DNS, host);
        }
    }
    return made;
}

std::string text_of(const ASN1_STRING* from) {
    return std::string(reinterpret_cast<const char*>(ASN1_STRING_get0_data(from)),
                       static_cast<std::size_t>(ASN1_STRING_length(from)));
}

std::string address_text(const ASN1_OCTET_STRING* from) {
    const auto* bytes = ASN1_STRING_get0_data(from);
    if (ASN1_STRING_length(from) == 4) return fmt::format("{}.{}.{}.{}", bytes[0], bytes[1], bytes[2], bytes[3]);
    if (ASN1_STRING_length(from) != 16) return "(an address of a strange length)";
    std::string made;
    for (int at = 0; at < 16; at += 2) made += fmt::format("{}{:x}", at ? ":" : "", bytes[at] << 8 | bytes[at + 1]);
    return made;
}

// The names in it; `trouble` where ISE has no use for them.
subject subject_of(const GENERAL_NAMES* names, std::string& trouble) {
    subject made;
    int identities = 0;
    for (int at = 0; names && at < sk_GENERAL_NAME_num(names); ++at) {
        int kind = 0;
        auto* value = static_cast<ASN1_STRING*>(GENERAL_NAME_get0_value(sk_GENERAL_NAME_value(names, at), &kind));
        switch (kind) {
            case GEN_URI:
                ++identities;
                made.identity = text_of(value);
                break;
            case GEN_DNS: made.hosts.push_back(text_of(value)); break;
            case GEN_IPADD: made.hosts.push_back(address_text(value)); break;
            default: trouble = "its subjectAltName has something that is no URI, host name or address"; break;
        }
    }
    if (identities == 0) trouble = "its subjectAltName has no URI, so it has no identity";
    if (identities > 1) trouble = "its subjectAltName has several URIs, so its identity is ambiguous";
    return made;
}

names_ptr names_in(const X509* one) {
    return names_ptr(static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(one, NID_subject_alt_name, nullptr, nullptr)));
}

names_ptr names_in(X509_REQ* one) {
    extensions_ptr all(X509_REQ_get_extensions(one));
    if (!all) return nullptr;
    return names_ptr(static_cast<GENERAL_NAMES*>(X509V3_get_d2i(all.get(), NID_subject_alt_name, nullptr, nullptr)));
}

// The system for which an authority signs; empty: it was not made by `ise keys ca`.
std::string system_of_authority(const X509* one) {
    std::string trouble;
    auto names = names_in(one);
    auto identity = subject_of(names.get(), trouble).identity;
    return trouble.empty() && identity.starts_with(scheme) ? identity.substr(scheme.size()) : std::string();
}

// An authority that was read, for the time of a signature.
struct signer {
    certificate_ptr own;
    key_ptr key;
    std::string system;

    explicit signer(const authority& from) : own(read_certificate(from.certificate, "ca.pem")) {
        key.reset(PEM_read_bio_PrivateKey(over(from.key).get(), nullptr, no_passphrase, nullptr));
        if (!key) fail(fmt::format("ca-key.pem is no private key without a passphrase ({})", cause()));
        if (X509_check_private_key(own.get(), key.get()) != 1)
            fail(fmt::format("ca-key.pem does not belong to ca.pem ({})", cause()));
        system = system_of_authority(own.get());
        if (system.empty())
            fail("ca.pem is no authority of a system: it has no subjectAltName URI:ise://SYSTEM",
                 "ise keys ca SYSTEM makes one");
    }

    std::string certificate_for(const subject& whose, EVP_PKEY* public_key, moment from, moment until) const {
        auto end = moment_of(X509_get0_notAfter(own.get()));
        if (until > end)
            fail(fmt::format("the certificate of {} would outlive its authority, which ends at {}", whose.identity,
                             iso_8601(end)),
                 "choose fewer --days, or make a new authority");
        certificate_ptr made(X509_new());
        must(made && X509_set_version(made.get(), X509_VERSION_3) == 1, "make a certificate");
        number_it(made.get());
        auto* name = X509_get_subject_name(made.get());
        add_part(name, "O", system);
        add_part(name, "CN", whose.identity.substr(scheme.size() + system.size() + 1));
        must(X509_set_issuer_name(made.get(), X509_get_subject_name(own.get())) == 1 &&
                 X509_set1_notBefore(made.get(), time_at(from).get()) == 1 &&
                 X509_set1_notAfter(made.get(), time_at(until).get()) == 1 &&
                 X509_set_pubkey(made.get(), public_key) == 1,
             "make a certificate");
        auto* one = made.get();
        add_extension(one, own.get(), NID_basic_constraints, "critical,CA:FALSE");
        add_extension(one, own.get(), NID_key_usage, "critical,digitalSignature");
        add_extension(one, own.get(), NID_ext_key_usage, "serverAuth,clientAuth");
        add_extension(one, own.get(), NID_subject_key_identifier, "hash");
        add_extension(one, own.get(), NID_authority_key_identifier, "keyid:always");
        auto names = names_of(whose);
        must(X509_add1_ext_i2d(one, NID_subject_alt_name, names.get(), 0, X509V3_ADD_DEFAULT) == 1 &&
                 X509_sign(one, key.get(), digest_for(key.get())) > 0,
             "sign a certificate");
        return pem_of(one);
    }

    void sign_list(X509_CRL* list, moment from, moment until) const {
        long number = 1;
        if (integer_ptr last(static_cast<ASN1_INTEGER*>(X509_CRL_get_ext_d2i(list, NID_crl_number, nullptr, nullptr)));
            last)
            number = ASN1_INTEGER_get(last.get()) + 1;
        integer_ptr next(ASN1_INTEGER_new());
        must(next && ASN1_INTEGER_set(next.get(), number) == 1 &&
                 X509_CRL_add1_ext_i2d(list, NID_crl_number, next.get(), 0, X509V3_ADD_REPLACE) == 1 &&
                 X509_CRL_set1_lastUpdate(list, time_at(from).get()) == 1 &&
                 X509_CRL_set1_nextUpdate(list, time_at(until).get()) == 1 && X509_CRL_sort(list) == 1 &&
                 X509_CRL_sign(list, key.get(), digest_for(key.get())) > 0,
             "sign a revocation list");
    }
};

void add_key_id(X509_CRL* to, X509* issuer) {
    X509V3_CTX context;
    X509V3_set_ctx_nodb(&context);
    X509V3_set_ctx(&context, issuer, nullptr, nullptr, to, 0);
    std::unique_ptr<X509_EXTENSION, freeing<X509_EXTENSION_free>> made(
        X509V3_EXT_conf_nid(nullptr, &context, NID_authority_key_identifier, "keyid:always"));
    must(made && X509_CRL_add_ext(to, made.get(), -1) == 1, "write an extension");
}

bool is_in(X509_CRL* list, X509* one) {
    X509_REVOKED* found = nullptr;
    return X509_CRL_get0_by_cert(list, &found, one) == 1;
}

std::string one_line(const X509_NAME* name) {
    return written(
        [&](BIO* to) { return X509_NAME_print_ex(to, name, 0, XN_FLAG_ONELINE & ~ASN1_STRFLGS_ESC_MSB) >= 0; });
}

std::string key_text(EVP_PKEY* key) {
    if (!key) return "unreadable";
    std::array<char, 64> group{};
    std::size_t size = 0;
    const char* type = EVP_PKEY_get0_type_name(key);
    if (EVP_PKEY_is_a(key, "EC") && EVP_PKEY_get_group_name(key, group.data(), group.size(), &size) == 1)
        return fmt::format("EC {}", std::string_view(group.data()) == "prime256v1" ? "P-256" : group.data());
    return fmt::format("{} of {} bits", type ? type : "?", EVP_PKEY_get_bits(key));
}

description describe_certificate(X509* one) {
    description made;
    bool signs = X509_check_ca(one) > 0;
    made.kind = signs ? "authority" : "certificate";
    auto names = names_in(one);
    auto whose = subject_of(names.get(), made.trouble);
    made.identity = whose.identity;
    made.hosts = std::move(whose.hosts);
    made.subject = one_line(X509_get_subject_name(one));
    made.issuer = one_line(X509_get_issuer_name(one));
    made.serial = hex_of(X509_get0_serialNumber(one));
    made.public_key = key_text(X509_get0_pubkey(one));
    made.from = moment_of(X509_get0_notBefore(one));
    made.until = moment_of(X509_get0_notAfter(one));
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned size = 0;
    must(X509_digest(one, EVP_sha256(), digest.data(), &size) == 1, "make a fingerprint");
    for (unsigned at = 0; at < size; ++at) made.fingerprint += fmt::format("{:02x}", digest[at]);
    return made;
}

description describe_request(X509_REQ* one) {
    description made;
    made.kind = "request";
    auto names = names_in(one);
    auto whose = subject_of(names.get(), made.trouble);
    made.identity = whose.identity;
    made.hosts = std::move(whose.hosts);
    made.subject = one_line(X509_REQ_get_subject_name(one));
    made.public_key = key_text(X509_REQ_get0_pubkey(one));
    if (X509_REQ_verify(one, X509_REQ_get0_pubkey(one)) != 1) made.trouble = "its signature does not fit its key";
    ERR_clear_error();
    return made;
}

description describe_list(X509_CRL* one) {
    description made;
    made.kind = "revocation list";
    made.issuer = one_line(X509_CRL_get_issuer(one));
    made.from = moment_of(X509_CRL_get0_lastUpdate(one));
    if (X509_CRL_get0_nextUpdate(one)) made.until = moment_of(X509_CRL_get0_nextUpdate(one));
    auto* all = X509_CRL_get_REVOKED(one);
    for (int at = 0; all && at < sk_X509_REVOKED_num(all); ++at)
        made.revoked.push_back(hex_of(X509_REVOKED_get0_serialNumber(sk_X509_REVOKED_value(all, at))));
    return made;
}

} // namespace

std::string system_of(const std::string& identity) {
    auto wrong = [&](const std::string& why) {
        throw problem(exit_code::usage, "usage", fmt::format("'{}' is not an identity: {}", identity, why),
                      "such as ise://robots/shore or ise://robots/operator/ana");
    };
    if (!identity.starts_with(scheme)) wrong("it does not begin with ise://");
    auto rest = identity.substr(scheme.size());
    auto slash = rest.find('/');
    if (!naming::is_path(rest) || slash == rest.npos) wrong("behind ise:// are a system and a name, as in a path");
    if (rest.size() - slash - 1 > max_common_name)
        wrong(fmt::format("its name has more than {} bytes", max_common_name));
    return rest.substr(0, slash);
}

key_and_request make_request(const subject& whose) {
    ERR_clear_error();
    auto system = system_of(whose.identity);
    auto names = names_of(whose);
    auto key = new_key();
    request_ptr made(X509_REQ_new());
    must(made && X509_REQ_set_version(made.get(), X509_REQ_VERSION_1) == 1 &&
             X509_REQ_set_pubkey(made.get(), key.get()) == 1,
         "make a request");
    auto* name = X509_REQ_get_subject_name(made.get());
    add_part(name, "O", system);
    add_part(name, "CN", whose.identity.substr(scheme.size() + system.size() + 1));
    STACK_OF(X509_EXTENSION)* raw = nullptr;
    bool added = X509V3_add1_i2d(&raw, NID_subject_alt_name, names.get(), 0, X509V3_ADD_DEFAULT) == 1;
    extensions_ptr all(raw);
    must(added && X509_REQ_add_extensions(made.get(), all.get()) == 1 &&
             X509_REQ_sign(made.get(), key.get(), EVP_sha256()) > 0,
         "sign a request");
    return {pem_of_key(key.get()), written([&](BIO* to) { return PEM_write_bio_X509_REQ(to, made.get()) == 1; })};
}

authority authority::make(const std::string& system, moment now, days valid) {
    ERR_clear_error();
    system_of(fmt::format("{}{}/x", scheme, system)); // refuses what is none
    auto key = new_key();
    certificate_ptr made(X509_new());
    must(made && X509_set_version(made.get(), X509_VERSION_3) == 1, "make a certificate");
    auto* one = made.get();
    number_it(one);
    add_part(X509_get_subject_name(one), "O", system);
    add_part(X509_get_subject_name(one), "CN", "authority of " + system.substr(0, max_common_name - 13));
    must(X509_set_issuer_name(one, X509_get_subject_name(one)) == 1 &&
             X509_set1_notBefore(one, time_at(now - slack).get()) == 1 &&
             X509_set1_notAfter(one, time_at(now + valid).get()) == 1 && X509_set_pubkey(one, key.get()) == 1,
         "make a certificate");
    add_extension(one, one, NID_basic_constraints, "critical,CA:TRUE,pathlen:0");
    add_extension(one, one, NID_key_usage, "critical,keyCertSign,cRLSign");
    add_extension(one, one, NID_subject_key_identifier, "hash");
    names_ptr names(sk_GENERAL_NAME_new_null());
    must(names != nullptr, "write a subjectAltName");
    add_text(names.get(), GEN_URI, fmt::format("{}{}", scheme, system));
    must(X509_add1_ext_i2d(one, NID_subject_alt_name, names.get(), 0, X509V3_ADD_DEFAULT) == 1 &&
             X509_sign(one, key.get(), EVP_sha256()) > 0,
         "sign a certificate");
    authority whole;
    whole.certificate = pem_of(one);
    whole.key = pem_of_key(key.get());
    return whole;
}

std::string authority::sign(const std::string& request, moment now, days valid) const {
    ERR_clear_error();
    signer by(*this);
    request_ptr asked(PEM_read_bio_X509_REQ(over(request).get(), nullptr, no_passphrase, nullptr));
    if (!asked) fail(fmt::format("it is no request in PEM ({})", cause()), "ise keys request IDENTITY makes one");
    auto* asker = X509_REQ_get0_pubkey(asked.get());
    if (!asker || X509_REQ_verify(asked.get(), asker) != 1)
        fail("its signature does not fit its key: it was changed, or it is damaged");
    if (EVP_PKEY_get_security_bits(asker) < min_security_bits)
        fail(fmt::format("its key ({}) is too weak", key_text(asker)), "ise keys request makes an EC P-256 key");
    std::string trouble;
    auto names = names_in(asked.get());
    auto whose = subject_of(names.get(), trouble);
    if (!trouble.empty()) fail(trouble, "ise keys request IDENTITY makes one with exactly one identity");
    if (auto system = system_of(whose.identity); system != by.system)
        fail(fmt::format("it is for {}, and this authority signs for ise://{}/ only", whose.identity, by.system));
    return by.certificate_for(whose, asker, now - slack, now + valid);
}

std::string authority::sign_again(const std::string& former, moment now) const {
    ERR_clear_error();
    signer by(*this);
    auto old = read_certificate(former, "it");
    if (X509_verify(old.get(), by.key.get()) != 1) {
        ERR_clear_error();
        fail("it was not issued by this authority", "ise keys issue signs a request");
    }
    if (!list.empty() && is_in(read_list(list).get(), old.get()))
        fail("it was revoked", "ise keys request makes a new key, in a new folder");
    std::string trouble;
    auto names = names_in(old.get());
    auto whose = subject_of(names.get(), trouble);
    if (!trouble.empty()) fail(trouble);
    system_of(whose.identity);
    auto length = moment_of(X509_get0_notAfter(old.get())) - moment_of(X509_get0_notBefore(old.get()));
    return by.certificate_for(whose, X509_get0_pubkey(old.get()), now - slack, now - slack + length);
}

void authority::revoke(const std::vector<std::string>& more, moment now, days valid) {
    ERR_clear_error();
    signer by(*this);
    list_ptr made = list.empty() ? list_ptr(X509_CRL_new()) : read_list(list);
    must(made && X509_CRL_set_version(made.get(), X509_CRL_VERSION_2) == 1 &&
             X509_CRL_set_issuer_name(made.get(), X509_get_subject_name(by.own.get())) == 1,
         "make a revocation list");
    if (list.empty()) add_key_id(made.get(), by.own.get());
    for (const auto& text : more) {
        auto one = read_certificate(text, "what is to be revoked");
        if (X509_verify(one.get(), by.key.get()) != 1) {
            ERR_clear_error();
            fail("it was not issued by this authority, which cannot revoke it");
        }
        if (is_in(made.get(), one.get())) continue;
        auto* entry = X509_REVOKED_new();
        must(entry && X509_REVOKED_set_serialNumber(entry, X509_get_serialNumber(one.get())) == 1 &&
                 X509_REVOKED_set_revocationDate(entry, time_at(now).get()) == 1 &&
                 X509_CRL_add0_revoked(made.get(), entry) == 1,
             "write a revocation list");
    }
    by.sign_list(made.get(), now - slack, now + valid);
    list = pem_of(made.get());
}

void authority::list_again(moment now) {
    ERR_clear_error();
    signer by(*this);
    auto made = read_list(list);
    auto from = moment_of(X509_CRL_get0_lastUpdate(made.get()));
    auto until = moment_of(X509_CRL_get0_nextUpdate(made.get()));
    by.sign_list(made.get(), now - slack, now - slack + (until - from));
    list = pem_of(made.get());
}

bool same_key(const std::string& one, const std::string& other) {
    ERR_clear_error();
    auto first = read_certificate(one, "a certificate"), second = read_certificate(other, "a certificate");
    return EVP_PKEY_eq(X509_get0_pubkey(first.get()), X509_get0_pubkey(second.get())) == 1;
}

std::vector<description> describe(const std::string& text, const std::string& from) {
    ERR_clear_error();
    std::vector<description> all;
    auto source = over(text);
    for (;;) {
        char *kind = nullptr, *head = nullptr;
        unsigned char* data = nullptr;
        long size = 0;
        if (PEM_read_bio(source.get(), &kind, &head, &data, &size) != 1) {
            bool end = ERR_GET_REASON(ERR_peek_last_error()) == PEM_R_NO_START_LINE;
            auto why = cause();
            if (!end) fail(fmt::format("{} has a block that cannot be read: {}", from, why));
            break;
        }
        std::string_view is = kind;
        std::unique_ptr<char, freeing<[](char*one) { OPENSSL_free(one); }>> kind_guard(kind), head_guard(head);
        std::unique_ptr<unsigned char, freeing<[](unsigned char* one) { OPENSSL_free(one); }>> data_guard(data);
        const unsigned char* at = data;
        if (is == PEM_STRING_X509 || is == PEM_STRING_X509_TRUSTED) {
            certificate_ptr one(d2i_X509(nullptr, &at, size));
            if (!one) fail(fmt::format("{} has a certificate that cannot be read: {}", from, cause()));
            all.push_back(describe_certificate(one.get()));
        } else if (is == PEM_STRING_X509_REQ || is == PEM_STRING_X509_REQ_OLD) {
            request_ptr one(d2i_X509_REQ(nullptr, &at, size));
            if (!one) fail(fmt::format("{} has a request that cannot be read: {}", from, cause()));
            all.push_back(describe_request(one.get()));
        } else if (is == PEM_STRING_X509_CRL) {
            list_ptr one(d2i_X509_CRL(nullptr, &at, size));
            if (!one) fail(fmt::format("{} has a revocation list that cannot be read: {}", from, cause()));
            all.push_back(describe_list(one.get()));
        } else {
            description made;
            made.kind = is.ends_with("PRIVATE KEY") ? "private key" : fmt::format("'{}'", is);
            if (is == PEM_STRING_PKCS8) made.trouble = "it has a passphrase, which ISE cannot ask for";
            else if (is.ends_with("PRIVATE KEY")) {
                key_ptr one(d2i_AutoPrivateKey(nullptr, &at, size));
                made.public_key = one ? key_text(one.get()) : "";
                if (!one) made.trouble = fmt::format("it cannot be read ({})", cause());
            } else made.trouble = "it is nothing that ISE uses";
            all.push_back(std::move(made));
        }
    }
    if (all.empty()) fail(fmt::format("{} has nothing in PEM: no certificate, request, revocation list or key", from));
    return all;
}

} // namespace ise::cli::pki
