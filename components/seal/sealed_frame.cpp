#include <components/seal/sealed_frame.hpp>

#include <components/boat/layout.hpp>

#include <fmt/format.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>

#include <algorithm>
#include <memory>

namespace atirma::seal {
namespace {

constexpr std::size_t to_boat_header = 2 + counter_size;
constexpr std::uint8_t sealed_bit = 0x80, lane_bit = 0x40;

using digest = std::array<std::byte, 32>;
using tag_bytes = std::array<std::byte, tag_size>;

digest hmac(ise::bytes_view key, ise::bytes_view data) {
    digest out;
    unsigned size = 0;
    if (!HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()),
              reinterpret_cast<const unsigned char*>(data.data()), data.size(),
              reinterpret_cast<unsigned char*>(out.data()), &size))
        throw ise::error(ise::errc::io_failed, "OpenSSL computes no HMAC-SHA-256");
    return out;
}

// A key for each boat, direction and purpose, so that no packet has a meaning elsewhere.
digest derived(const radio_key& key, std::string_view purpose) {
    auto label = fmt::format("A-Tirma radio 1|{}|{}|{}|{}", purpose, key.epoch, key.link, key.boat);
    return hmac(key.secret, ise::as_bytes(label));
}

tag_bytes tag_of(const radio_key& key, std::string_view purpose, ise::bytes_view data) {
    auto secret = derived(key, purpose);
    auto full = hmac(secret, data);
    tag_bytes out;
    std::copy_n(full.begin(), tag_size, out.begin());
    OPENSSL_cleanse(secret.data(), secret.size());
    return out;
}

std::string for_session(std::string_view purpose, session of) { return fmt::format("{}|{:016x}", purpose, of); }

bool equal(ise::bytes_view a, ise::bytes_view b) {
    return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

// AES-128 in counter mode. It starts at the tag and the counter of the packet: no two packets share it.
void crypt(const radio_key& key, session of, const tag_bytes& tag, ise::bytes_view header,
           std::span<std::byte> content) {
    std::array<std::byte, 16> start{};
    std::copy(tag.begin(), tag.end(), start.begin());
    std::copy(header.begin() + 1, header.end(), start.begin() + tag_size); // type and counter; then the block
    auto secret = derived(key, for_session("to the boat, encryption", of));
    std::unique_ptr<EVP_CIPHER_CTX, decltype(&EVP_CIPHER_CTX_free)> cipher(EVP_CIPHER_CTX_new(), EVP_CIPHER_CTX_free);
    auto* bytes = reinterpret_cast<unsigned char*>(content.data());
    int size = 0;
    bool good = cipher &&
                EVP_EncryptInit_ex(cipher.get(), EVP_aes_128_ctr(), nullptr,
                                   reinterpret_cast<const unsigned char*>(secret.data()),
                                   reinterpret_cast<const unsigned char*>(start.data())) == 1 &&
                EVP_EncryptUpdate(cipher.get(), bytes, &size, bytes, static_cast<int>(content.size())) == 1;
    OPENSSL_cleanse(secret.data(), secret.size());
    if (!good) throw ise::error(ise::errc::io_failed, "OpenSSL does not encrypt with AES-128-CTR");
}

ise::result<void> check_form(const radio_key& key, ise::bytes_view raw, std::size_t shortest) {
    if (!is_sealed(raw)) return ise::failure(ise::errc::refused, "the packet is not sealed");
    if (raw.size() < shortest)
        return ise::failure(ise::errc::malformed,
                            fmt::format("a sealed packet of {} bytes; the shortest has {}", raw.size(), shortest));
    auto epoch = epoch_of(raw);
    if (epoch != key.epoch)
        return ise::failure(ise::errc::refused,
                            fmt::format("the packet is sealed under key epoch {}, not {}", epoch, key.epoch));
    return {};
}

ise::failure wrong_tag() { return ise::failure(ise::errc::refused, "the tag of a sealed packet is wrong"); }

std::byte first_byte(const radio_key& key, bool secondary) {
    return static_cast<std::byte>(sealed_bit | (secondary ? lane_bit : 0) | key.epoch);
}

} // namespace

bool is_sealed(ise::bytes_view raw) noexcept {
    return !raw.empty() && (std::to_integer<std::uint8_t>(raw[0]) & sealed_bit) != 0;
}

std::uint8_t epoch_of(ise::bytes_view raw) noexcept {
    return raw.empty() ? std::uint8_t{0} : static_cast<std::uint8_t>(std::to_integer<std::uint8_t>(raw[0]) & max_epoch);
}

bool is_notice(ise::bytes_view raw) noexcept {
    return is_sealed(raw) && raw.size() > 1 && raw[1] == static_cast<std::byte>(notice_type);
}

ise::bytes seal_to_boat(const radio_key& key, session of, const to_boat_frame& frame) {
    ise::bytes out{first_byte(key, frame.lane == lane::secondary), static_cast<std::byte>(frame.type)};
    for (std::size_t i = 0; i < counter_size; ++i)
        out.push_back(static_cast<std::byte>(frame.counter >> (8 * i) & 0xFF));
    out.insert(out.end(), frame.content.begin(), frame.content.end());
    auto tag = tag_of(key, for_session("to the boat, tag", of), out);
    std::span all(out);
    crypt(key, of, tag, all.first(to_boat_header), all.subspan(to_boat_header));
    out.insert(out.end(), tag.begin(), tag.end());
    return out;
}

ise::result<to_boat_frame> open_to_boat(const radio_key& key, session of, ise::bytes_view raw) {
    if (auto good = check_form(key, raw, to_boat_header + tag_size); !good) return good.error();
    tag_bytes tag;
    std::copy(raw.end() - tag_size, raw.end(), tag.begin());
    ise::bytes opened(raw.begin(), raw.end() - tag_size);
    std::span all(opened);
    crypt(key, of, tag, all.first(to_boat_header), all.subspan(to_boat_header));
    if (!equal(tag_of(key, for_session("to the boat, tag", of), opened), tag)) return wrong_tag();
    to_boat_frame made;
    made.lane = (std::to_integer<std::uint8_t>(raw[0]) & lane_bit) != 0 ? lane::secondary : lane::primary;
    made.type = std::to_integer<std::uint8_t>(raw[1]);
    for (std::size_t i = 0; i < counter_size; ++i)
        made.counter |= std::to_integer<std::uint64_t>(raw[2 + i]) << (8 * i);
    made.content.assign(opened.begin() + to_boat_header, opened.end());
    return made;
}

ise::bytes seal_from_boat(const radio_key& key, ise::bytes_view plain) {
    ise::bytes out(plain.begin(), plain.end() - static_cast<std::ptrdiff_t>(layout::checksum_size));
    out[0] = first_byte(key, false);
    auto tag = tag_of(key, "from the boat, tag", out);
    out.insert(out.end(), tag.begin(), tag.end());
    return out;
}

ise::result<ise::bytes> open_from_boat(const radio_key& key, ise::bytes_view raw) {
    if (auto good = check_form(key, raw, layout::header_size + tag_size); !good) return good.error();
    ise::bytes out(raw.begin(), raw.end() - tag_size);
    if (!equal(tag_of(key, "from the boat, tag", out), raw.last(tag_size))) return wrong_tag();
    out[0] = static_cast<std::byte>(layout::version);
    auto checksum = layout::crc16(out);
    out.push_back(static_cast<std::byte>(checksum & 0xFF));
    out.push_back(static_cast<std::byte>(checksum >> 8));
    return out;
}

std::string fingerprint(const radio_key& key) {
    auto of_file = key;
    of_file.link.clear();
    auto of = derived(of_file, "fingerprint");
    std::string text;
    for (std::size_t i = 0; i < 4; ++i) text += fmt::format("{:02x}", std::to_integer<unsigned>(of[i]));
    return text;
}

} // namespace atirma::seal
