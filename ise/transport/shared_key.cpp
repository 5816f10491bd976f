#include <ise/transport/shared_key.hpp>

#include <ise/transport/tls/psk.hpp>

#include <fmt/format.h>

#include <openssl/crypto.h>
#include <openssl/hmac.h>

namespace ise {

result<std::shared_ptr<const shared_key>> shared_key::load(environment& env, const std::string& file, bool legacy) {
    auto text = env.read_secret(file, max_bytes + 64);
    if (!text) return text.error();
    auto made = make(*text, file, legacy);
    OPENSSL_cleanse(text->data(), text->size());
    return made;
}

result<std::shared_ptr<const shared_key>> shared_key::make(std::string_view text, std::string_view from, bool legacy) {
    constexpr std::string_view blanks = " \t\r\n";
    auto begin = text.find_first_not_of(blanks);
    auto secret =
        begin == text.npos ? std::string_view() : text.substr(begin, text.find_last_not_of(blanks) - begin + 1);
    if (secret.size() < min_bytes || secret.size() > max_bytes)
        return failure(
            errc::invalid_argument,
            fmt::format("the key in {} has {} bytes, and {} to {} are needed: openssl rand -hex 32 makes a good one",
                        from, secret.size(), min_bytes, max_bytes));
    std::shared_ptr<shared_key> made(new shared_key(secret));
    if (!legacy) {
        made->sealing_secret_ = made->prove("ISE1 sealed", {});
        auto context = net::tls::psk_context(made->sealing_secret_);
        if (!context) return context.error();
        made->sealing_ = std::move(*context);
    }
    return std::shared_ptr<const shared_key>(std::move(made));
}

shared_key::~shared_key() {
    OPENSSL_cleanse(secret_.data(), secret_.size());
    OPENSSL_cleanse(sealing_secret_.data(), sealing_secret_.size());
}

shared_key::digest shared_key::prove(std::string_view label, bytes_view transcript) const {
    std::string said(label);
    said += '\0';
    said.append(reinterpret_cast<const char*>(transcript.data()), transcript.size());
    digest made{};
    unsigned size = 0;
    ::HMAC(::EVP_sha256(), secret_.data(), static_cast<int>(secret_.size()),
           reinterpret_cast<const unsigned char*>(said.data()), said.size(), made.data(), &size);
    if (size != made.size()) throw error(errc::io_failed, "OpenSSL makes no HMAC-SHA-256 here");
    return made;
}

bool shared_key::equal(std::span<const std::uint8_t> wanted, std::span<const std::uint8_t> given) noexcept {
    return given.size() == wanted.size() && ::CRYPTO_memcmp(wanted.data(), given.data(), wanted.size()) == 0;
}

} // namespace ise
