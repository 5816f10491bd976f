#include <components/iridium/jwt.hpp>

#include <components/iridium/text.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <algorithm>
#include <optional>

namespace atirma::iridium {
namespace {

template <auto Free>
struct releases {
    template <class T>
    void operator()(T* what) const noexcept {
        Free(what);
    }
};
using bio = std::unique_ptr<BIO, releases<BIO_free_all>>;
using evp_key = std::unique_ptr<EVP_PKEY, releases<EVP_PKEY_free>>;
using certificate = std::unique_ptr<X509, releases<X509_free>>;
using digest_context = std::unique_ptr<EVP_MD_CTX, releases<EVP_MD_CTX_free>>;

constexpr std::size_t max_token = 16 * 1024;
constexpr auto clock_tolerance = std::chrono::minutes(5);

bio memory(std::string_view text) {
    return bio(BIO_new_mem_buf(text.data(), static_cast<int>(std::min<std::size_t>(text.size(), 1 << 20))));
}

ise::failure unauthorized(std::string why) {
    return ise::failure(ise::errc::unauthorized, "the JWT is not accepted: " + std::move(why));
}

bool same_letters(std::string_view a, std::string_view b) {
    auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; };
    return std::equal(a.begin(), a.end(), b.begin(), b.end(), [&](char x, char y) { return lower(x) == lower(y); });
}

/// The claims of a token against what a post says. The first that is missing or differs is kept.
class claim_check {
public:
    explicit claim_check(const nlohmann::json& claims) : claims_(claims) {}

    void text(const char* name, std::string_view message, bool required) {
        if (auto claim = find(name, required); claim && !same_letters(*claim, message)) wrong(name);
    }
    /// `told`: what the post says, if it says it; then the token has to, too.
    void number(const char* name, std::optional<double> result) {
        auto claim = find(name, result.has_value());
        if (!claim) return;
        auto read = parse_real(name, *claim, -1e12, 1e12);
        if (!result || !read || *read != *result) wrong(name);
    }
    void time(const char* name, std::chrono::sys_seconds result) {
        auto claim = find(name, true);
        if (!claim) return;
        auto read = parse_transmit_time(*claim); // in either notation
        if (!read || *read != result) wrong(name);
    }
    /// Seconds since 1970, as `exp` and `nbf` are.
    std::optional<std::chrono::sys_seconds> instant(const char* name) {
        auto claim = find(name, false);
        if (!claim) return std::nullopt;
        auto read = parse_real(name, *claim, 0, 1e11);
        if (!read) {
            wrong(name);
            return std::nullopt;
        }
        return std::chrono::sys_seconds(std::chrono::seconds(static_cast<std::int64_t>(*read)));
    }
    void object(std::string what) {
        if (!problem_) problem_ = std::move(what);
    }
    const std::optional<std::string>& problem() const noexcept { return problem_; }

private:
    /// Numbers may come as texts, and the other way round.
    std::optional<std::string> find(const char* name, bool required) {
        auto found = claims_.find(name);
        if (found != claims_.end()) return found->is_string() ? found->get<std::string>() : found->dump();
        if (required) object(fmt::format("it does not sign {}", name));
        return std::nullopt;
    }
    void wrong(const char* name) { object(fmt::format("it signs another {}", name)); }

    const nlohmann::json& claims_;
    std::optional<std::string> problem_;
};

} // namespace

struct jwt_key::key {
    evp_key handle;
};

jwt_key::jwt_key(std::unique_ptr<key> made) : key_(std::move(made)) {}
jwt_key::jwt_key(jwt_key&&) noexcept = default;
jwt_key& jwt_key::operator=(jwt_key&&) noexcept = default;
jwt_key::~jwt_key() = default;

ise::result<jwt_key> jwt_key::parse(std::string_view pem) {
    auto text = memory(pem);
    evp_key read(PEM_read_bio_PUBKEY(text.get(), nullptr, nullptr, nullptr));
    if (!read) {
        auto again = memory(pem);
        certificate issued(PEM_read_bio_X509(again.get(), nullptr, nullptr, nullptr));
        if (issued) read.reset(X509_get_pubkey(issued.get()));
    }
    if (!read || EVP_PKEY_base_id(read.get()) != EVP_PKEY_RSA)
        return ise::failure(ise::errc::invalid_argument,
                            "no RSA public key or certificate in PEM (-----BEGIN PUBLIC KEY-----)");
    auto made = std::make_unique<key>();
    made->handle = std::move(read);
    return jwt_key(std::move(made));
}

ise::result<std::string> jwt_key::verify(std::string_view token) const {
    if (token.size() > max_token) return unauthorized("it is too long");
    auto first = token.find('.'), second = first == std::string_view::npos ? first : token.find('.', first + 1);
    if (second == std::string_view::npos || token.find('.', second + 1) != std::string_view::npos)
        return unauthorized("it does not have three parts");
    auto header = from_base64url(token.substr(0, first));
    auto claims = from_base64url(token.substr(first + 1, second - first - 1));
    auto signature = from_base64url(token.substr(second + 1));
    if (!header || !claims || !signature) return unauthorized("it is not base64url");
    auto read = nlohmann::json::parse(*header, nullptr, false);
    if (!read.is_object()) return unauthorized("its header is not JSON");
    auto algorithm = read.find("alg");
    if (algorithm == read.end() || !algorithm->is_string() || algorithm->get<std::string>() != "RS256")
        return unauthorized("its algorithm is not RS256");
    digest_context context(EVP_MD_CTX_new());
    auto body = token.substr(0, second);
    bool good =
        context && EVP_DigestVerifyInit(context.get(), nullptr, EVP_sha256(), nullptr, key_->handle.get()) == 1 &&
        EVP_DigestVerify(context.get(), reinterpret_cast<const unsigned char*>(signature->data()), signature->size(),
                         reinterpret_cast<const unsigned char*>(body.data()), body.size()) == 1;
    if (!good) return unauthorized("its signature is not of the configured key");
    return std::move(*claims);
}

ise::result<void> jwt_key::verify(const mo_delivery& delivery, std::chrono::sys_seconds now) const {
    if (delivery.jwt.empty()) return unauthorized("there is none, and a key is configured");
    auto outcome = verify(delivery.jwt);
    if (!outcome) return outcome.error();
    auto claims = nlohmann::json::parse(*outcome, nullptr, false);
    if (!claims.is_object()) return unauthorized("its claims are no JSON object");
    const auto& m = delivery.message;
    const auto& where = m.where;
    claim_check check(claims);
    check.text("imei", m.imei, true);
    check.text("momsn", std::to_string(m.momsn), true);
    check.time("transmit_time", m.session_time);
    check.text("data", to_hex(m.data), true);
    check.number("iridium_latitude", where ? std::optional(where->latitude_deg) : std::nullopt);
    check.number("iridium_longitude", where ? std::optional(where->longitude_deg) : std::nullopt);
    check.number("iridium_cep", where && where->cep_km != 0 ? std::optional(where->cep_km) : std::nullopt);
    // These two decide nothing here; a token need not sign them.
    check.text("serial", std::to_string(delivery.serial), false);
    check.text("device_type", delivery.device_type, false);
    if (auto at = check.instant("exp"); at && now >= *at + clock_tolerance)
        check.object("it has expired: compare this machine's clock");
    if (auto at = check.instant("nbf"); at && now + clock_tolerance < *at)
        check.object("it is not valid yet: compare this machine's clock");
    if (check.problem()) return unauthorized(*check.problem());
    return {};
}

ise::result<std::string> sign_jwt(std::string_view private_pem, std::string_view claims) {
    auto text = memory(private_pem);
    evp_key key(PEM_read_bio_PrivateKey(text.get(), nullptr, nullptr, nullptr));
    if (!key) return ise::failure(ise::errc::invalid_argument, "no private key in PEM");
    auto body = to_base64url(R"({"alg":"RS256","typ":"JWT"})") + "." + to_base64url(claims);
    digest_context context(EVP_MD_CTX_new());
    std::size_t size = 0;
    auto data = reinterpret_cast<const unsigned char*>(body.data());
    bool ready = context && EVP_DigestSignInit(context.get(), nullptr, EVP_sha256(), nullptr, key.get()) == 1 &&
                 EVP_DigestSign(context.get(), nullptr, &size, data, body.size()) == 1;
    std::string signature(size, '\0');
    if (!ready || EVP_DigestSign(context.get(), reinterpret_cast<unsigned char*>(signature.data()), &size, data,
                                 body.size()) != 1)
        return ise::failure(ise::errc::invalid_argument, "the private key cannot sign with RS256");
    signature.resize(size);
    return body + "." + to_base64url(signature);
}

} // namespace atirma::iridium
