#include <ise/transport/udp/seal.hpp>

#include <ise/transport/shared_key.hpp>
#include <ise/transport/tls/proof.hpp>
#include <ise/transport/tls/psk.hpp>
#include <ise/wire/frame.hpp>
#include <ise/wire/sealed_datagram.hpp>

#include <openssl/core_names.h>
#include <openssl/crypto.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <openssl/params.h>
#include <openssl/ssl.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <new>
#include <string>
#include <string_view>
#include <vector>

namespace ise::net::udp {
namespace {

using bytes_32 = std::array<std::uint8_t, 32>;
using nonce = std::array<std::uint8_t, 12>;

constexpr std::size_t flight_head = 3; // of its body: the number of the flight, the part, the parts
constexpr std::size_t part_bytes = wire::datagram_bytes - wire::frame_header::size - flight_head;
constexpr std::string_view exporter_label = "EXPORTER-ISE1-datagrams";

template <auto Free>
struct freeing {
    template <class T>
    void operator()(T* what) const noexcept {
        Free(what);
    }
};
using tls_ptr = std::unique_ptr<SSL, freeing<SSL_free>>;
using cipher_ptr = std::unique_ptr<EVP_CIPHER_CTX, freeing<EVP_CIPHER_CTX_free>>;

unsigned char* raw(std::byte* from) noexcept { return reinterpret_cast<unsigned char*>(from); }
const unsigned char* raw(const std::byte* from) noexcept { return reinterpret_cast<const unsigned char*>(from); }

void must(bool went) {
    if (!went) throw error(errc::io_failed, "OpenSSL seals no datagrams here");
}

// HKDF-Expand of RFC 5869 with SHA-256, of one block.
bytes_32 expand(const bytes_32& secret, std::string_view label) {
    std::string info(label);
    info += '\x01';
    bytes_32 made{};
    unsigned size = 0;
    must(::HMAC(::EVP_sha256(), secret.data(), static_cast<int>(secret.size()),
                reinterpret_cast<const unsigned char*>(info.data()), info.size(), made.data(), &size) != nullptr &&
         size == made.size());
    return made;
}

// One key: of a direction and a generation, or of the signs of a direction.
class aead {
public:
    aead(const EVP_CIPHER* kind, const bytes_32& key, const bytes_32& base, bool seals)
        : context_(EVP_CIPHER_CTX_new()), seals_(seals),
          nonce_by_parameter_(EVP_CIPHER_get_mode(kind) == EVP_CIPH_GCM_MODE) {
        std::memcpy(base_.data(), base.data(), base_.size());
        must(context_ && EVP_CipherInit_ex(context_.get(), kind, nullptr, key.data(), nullptr, seals ? 1 : 0) == 1);
    }

    // In place; the tag goes to `tag`.
    void close(std::uint64_t number, bytes_view head, std::span<std::byte> content, std::byte* tag) {
        int size = 0;
        OSSL_PARAM wanted[] = {tag_at(tag), OSSL_PARAM_construct_end()};
        must(begin(number, head, nullptr) &&
             EVP_EncryptUpdate(context_.get(), raw(content.data()), &size, raw(content.data()),
                               static_cast<int>(content.size())) == 1 &&
             EVP_EncryptFinal_ex(context_.get(), raw(content.data()), &size) == 1 &&
             EVP_CIPHER_CTX_get_params(context_.get(), wanted) == 1);
    }
    // What was not sealed with this key, or was changed, is not opened.
    bool open(std::uint64_t number, bytes_view head, bytes_view content, bytes_view tag, std::byte* into) {
        int size = 0;
        bool good = begin(number, head, tag.data()) &&
                    EVP_DecryptUpdate(context_.get(), raw(into), &size, raw(content.data()),
                                      static_cast<int>(content.size())) == 1 &&
                    EVP_DecryptFinal_ex(context_.get(), raw(into), &size) == 1;
        if (!good) ERR_clear_error();
        return good;
    }

private:
    static OSSL_PARAM tag_at(const std::byte* tag) noexcept {
        return OSSL_PARAM_construct_octet_string(OSSL_CIPHER_PARAM_AEAD_TAG, const_cast<std::byte*>(tag),
                                                 wire::sealed::seal_bytes);
    }
    // The nonce as TLS 1.3 makes it: the number, big-endian, over the end of the base. `tag`: which is expected.
    bool begin(std::uint64_t number, bytes_view head, const std::byte* tag) {
        auto used = base_;
        for (std::size_t at = 0; at < 8; ++at)
            used[used.size() - 1 - at] ^= static_cast<std::uint8_t>(number >> (8 * at));
        std::array<OSSL_PARAM, 3> with;
        std::size_t count = 0;
        if (tag) with[count++] = tag_at(tag);
        int size = 0;
        if (nonce_by_parameter_) {
            // A whole nonce by this parameter (length -1, as EVP_CTRL_GCM_SET_IV_FIXED takes it) and the tag in one
            // call are a third of the cost of opening a small datagram less than EVP_CipherInit_ex, which asks for the
            // nonce's length each time. A nonce serves once: without a new one the cipher refuses the next datagram.
            with[count++] = OSSL_PARAM_construct_octet_string(OSSL_CIPHER_PARAM_AEAD_TLS1_IV_FIXED, used.data(),
                                                              static_cast<std::size_t>(-1));
            with[count] = OSSL_PARAM_construct_end();
            if (EVP_CIPHER_CTX_set_params(context_.get(), with.data()) != 1) return false;
        } else {
            with[count] = OSSL_PARAM_construct_end();
            if (EVP_CipherInit_ex2(context_.get(), nullptr, nullptr, used.data(), seals_ ? 1 : 0, with.data()) != 1)
                return false;
        }
        return EVP_CipherUpdate(context_.get(), nullptr, &size, raw(head.data()), static_cast<int>(head.size())) == 1;
    }

    cipher_ptr context_;
    nonce base_{};
    bool seals_, nonce_by_parameter_;
};

// The keys of a direction, generation after generation. None is computed backwards.
class keys {
public:
    keys(const EVP_CIPHER* kind, const bytes_32& secret, bool seals)
        : kind_(kind), secret_(secret), seals_(seals), now_(make()) {}
    ~keys() { OPENSSL_cleanse(secret_.data(), secret_.size()); }
    keys(const keys&) = delete;
    keys& operator=(const keys&) = delete;

    aead& now() { return *now_; }
    aead* former() { return former_.get(); }
    // Made once, be it guessed at ever so often.
    aead& next() {
        if (!next_) {
            next_secret_ = expand(secret_, "ISE1 next");
            auto kept = std::exchange(secret_, next_secret_);
            next_ = make();
            secret_ = kept;
        }
        return *next_;
    }
    void advance() {
        next();
        former_ = std::move(now_);
        now_ = std::move(next_);
        secret_ = next_secret_;
        ++generation_;
    }
    std::uint8_t phase() const noexcept { return generation_ & 1; }

private:
    std::unique_ptr<aead> make() const {
        return std::make_unique<aead>(kind_, expand(secret_, "ISE1 key"), expand(secret_, "ISE1 iv"), seals_);
    }

    const EVP_CIPHER* kind_;
    bytes_32 secret_, next_secret_{};
    bool seals_;
    std::unique_ptr<aead> former_, now_, next_;
    unsigned generation_ = 0;
};

class tls_seal final : public seal {
public:
    tls_seal(std::unique_ptr<tls::proof> with, bool calls, std::string host, key_life life)
        : with_(std::move(with)), calls_(calls), life_(life), expected_(calls ? 2 : 1) {
        shown_.host = std::move(host);
        if (!calls) return; // others are given memory when they have said something
        if (begin()) go_on(0);
    }

    bool take_flight(bytes_view body) override;
    std::span<const bytes> flight() const noexcept override { return flight_; }
    bool begun() const noexcept override { return taken_ != 0; }
    bool sealed() const noexcept override { return out_.has_value(); }
    const std::optional<failure>& trouble() const noexcept override { return trouble_; }
    const tls::subject* shown() const noexcept override { return sealed() ? &shown_.about : nullptr; }
    failure stranger(std::string_view begin) const override { return with_->stranger(begin); }
    void close(buffer& datagram, std::uint64_t acked, time_point now) override;
    std::optional<bytes_view> open(bytes_view datagram) override;
    void put_sign(buffer& out, std::uint64_t to) override;
    bool take_sign(bytes_view datagram) override;

private:
    bool begin();
    void go_on(std::uint8_t after);
    void say(std::uint8_t number, bytes_view records);
    bool collect(std::uint8_t number, std::uint8_t part, std::uint8_t parts, bytes_view records);
    void hear_refusal();
    void derive();

    std::unique_ptr<tls::proof> with_; // outlives tls_
    tls::shown_certificate shown_;     // the same
    bool calls_;
    key_life life_;
    tls_ptr tls_; // during the handshake; of the side that calls, until the other one has shown that it is over there
    std::vector<bytes> flight_;
    std::vector<bytes> parts_; // that came of the flight that is expected
    std::size_t parts_came_ = 0;
    std::uint8_t expected_, taken_ = 0;
    std::optional<failure> trouble_;

    std::optional<keys> out_, in_;
    std::optional<aead> sign_out_, sign_in_;
    std::uint64_t out_since_ = 0;        // the first number of the present keys
    std::optional<time_point> out_from_; // when they were used first
    std::uint64_t in_since_ = 0;
    std::uint64_t signs_sent_ = 0, signs_taken_ = 0;
    bytes opened_;
};

// False: there is trouble.
bool tls_seal::begin() {
    auto context = with_->context();
    if (!context) {
        trouble_ = context.error();
        auto record = tls::record_of(tls::refusal::unable);
        if (!calls_) say(2, record);
        return false;
    }
    tls_.reset(SSL_new(context->get()));
    auto* in = BIO_new(BIO_s_mem());
    auto* out = BIO_new(BIO_s_mem());
    if (!tls_ || !in || !out) throw std::bad_alloc();
    BIO_set_mem_eof_return(in, -1);
    BIO_set_mem_eof_return(out, -1);
    SSL_set_bio(tls_.get(), in, out);
    if (calls_) SSL_set_connect_state(tls_.get());
    else SSL_set_accept_state(tls_.get());
    SSL_clear_options(tls_.get(), SSL_OP_ENABLE_MIDDLEBOX_COMPAT); // nobody else's port is used
    if (tls::use_sealing_ciphers(tls_.get()) && with_->prepare(tls_.get(), shown_)) return true;
    trouble_ = with_->noted("udp+tls");
    tls_.reset();
    return false;
}

// The next flight of this side, cut for datagrams.
void tls_seal::say(std::uint8_t number, bytes_view records) {
    auto parts = (records.size() + part_bytes - 1) / part_bytes;
    if (parts > max_parts) {
        if (!trouble_)
            trouble_.emplace(errc::too_large, "the certificates of this side are too long for a handshake over udp");
        return;
    }
    flight_.assign(parts, {});
    for (std::size_t part = 0; part < parts; ++part) {
        auto content = records.subspan(part * part_bytes);
        content = content.first(std::min(content.size(), part_bytes));
        auto& to = flight_[part];
        to.reserve(flight_head + content.size());
        to = {std::byte{number}, static_cast<std::byte>(part), static_cast<std::byte>(parts)};
        to.insert(to.end(), content.begin(), content.end());
    }
}

// The handshake, as far as it goes; the flight that it makes follows the one with this number.
void tls_seal::go_on(std::uint8_t after) {
    ERR_clear_error();
    int went = SSL_do_handshake(tls_.get());
    bool done = went == 1;
    if (!done && SSL_get_error(tls_.get(), went) != SSL_ERROR_WANT_READ) {
        auto noted = with_->noted("udp+tls");
        trouble_ = shown_.objection ? *shown_.objection : std::move(noted);
    }
    if (done) trouble_ = with_->missing(tls_.get());
    auto* out = SSL_get_wbio(tls_.get());
    if (auto waiting = BIO_ctrl_pending(out); waiting > 0) {
        bytes records(waiting);
        BIO_read(out, records.data(), static_cast<int>(waiting));
        say(static_cast<std::uint8_t>(after + 1), records);
    }
    if (done && !trouble_) derive();
    if (trouble_ || (done && !calls_)) tls_.reset();
}

// True: the flight is whole.
bool tls_seal::collect(std::uint8_t number, std::uint8_t part, std::uint8_t parts, bytes_view records) {
    if (parts_.empty()) parts_.resize(parts);
    if (parts_.size() != parts || !parts_[part].empty()) return false;
    parts_[part].assign(records.begin(), records.end());
    if (++parts_came_ < parts) return false;
    taken_ = number;
    expected_ = static_cast<std::uint8_t>(number + 2);
    return true;
}

bool tls_seal::take_flight(bytes_view body) {
    if (body.size() <= flight_head) return false;
    auto number = static_cast<std::uint8_t>(body[0]), part = static_cast<std::uint8_t>(body[1]),
         parts = static_cast<std::uint8_t>(body[2]);
    if (part >= parts || parts > max_parts) return false;
    // Said again because the answer was lost. Who is called answers no more once it has the last.
    if (taken_ != 0 && number == taken_) return part + 1 == parts && (calls_ || !sealed());
    if (trouble_ || number != expected_ || (sealed() && !tls_)) return false;
    if (!collect(number, part, parts, body.subspan(flight_head))) return false;
    auto came = std::exchange(parts_, {});
    parts_came_ = 0;
    if (!tls_ && !begin()) return !flight_.empty();
    for (const auto& one : came) BIO_write(SSL_get_rbio(tls_.get()), one.data(), static_cast<int>(one.size()));
    if (sealed()) {
        hear_refusal();
        return false;
    }
    auto before = flight_;
    go_on(number);
    return flight_ != before;
}

// Of the side that calls, which has shown its certificate: by the keys of the other side TLS proves that an alert is
// its own. Anything else is nobody's, or says nothing.
void tls_seal::hear_refusal() {
    ERR_clear_error();
    std::byte nothing{};
    std::size_t count = 0;
    int went = SSL_read_ex(tls_.get(), &nothing, 1, &count);
    if (SSL_get_error(tls_.get(), went) == SSL_ERROR_WANT_READ) return;
    if (ERR_GET_REASON(ERR_peek_error()) >= SSL_AD_REASON_OFFSET) trouble_ = with_->noted("udp+tls");
    ERR_clear_error();
    tls_.reset();
}

void tls_seal::derive() {
    std::array<std::uint8_t, 64> both{};
    must(SSL_export_keying_material(tls_.get(), both.data(), both.size(), exporter_label.data(), exporter_label.size(),
                                    nullptr, 0, 0) == 1);
    constexpr unsigned chacha20_poly1305_sha256 = 0x1303;
    auto suite = SSL_CIPHER_get_protocol_id(SSL_get_current_cipher(tls_.get()));
    const auto* kind = suite == chacha20_poly1305_sha256 ? EVP_chacha20_poly1305() : EVP_aes_128_gcm();
    bytes_32 of_caller{}, of_called{};
    std::memcpy(of_caller.data(), both.data(), of_caller.size());
    std::memcpy(of_called.data(), both.data() + of_caller.size(), of_called.size());
    const auto& mine = calls_ ? of_caller : of_called;
    const auto& theirs = calls_ ? of_called : of_caller;
    sign_out_.emplace(kind, expand(mine, "ISE1 sign key"), expand(mine, "ISE1 sign iv"), true);
    sign_in_.emplace(kind, expand(theirs, "ISE1 sign key"), expand(theirs, "ISE1 sign iv"), false);
    in_.emplace(kind, theirs, false);
    out_.emplace(kind, mine, true);
    OPENSSL_cleanse(both.data(), both.size());
}

void tls_seal::close(buffer& datagram, std::uint64_t acked, time_point now) {
    auto number = detail::load_little<std::uint64_t>(datagram.data() + wire::frame_header::size);
    if (!out_from_) out_from_ = now;
    bool old = number - out_since_ >= life_.datagrams || now - *out_from_ >= life_.time;
    // The peer must have the present keys before it can get the next ones.
    if (old && acked > out_since_) {
        out_->advance();
        out_since_ = number;
        out_from_ = now;
    }
    auto header = wire::read_header(datagram.data());
    header.type = static_cast<wire::frame_type>(wire::sealed::data);
    header.flags = out_->phase();
    wire::store_header(datagram.data(), header);
    auto* at = datagram.data();
    out_->now().close(number, bytes_view(at, wire::data_head_bytes),
                      std::span(at + wire::sealed::head_bytes, datagram.size() - wire::sealed::head_bytes),
                      at + wire::data_head_bytes);
}

std::optional<bytes_view> tls_seal::open(bytes_view datagram) {
    if (datagram.size() < wire::sealed::head_bytes) return {};
    auto number = detail::load_little<std::uint64_t>(datagram.data() + wire::frame_header::size);
    auto head = datagram.first(wire::data_head_bytes);
    auto tag = datagram.subspan(wire::data_head_bytes, wire::sealed::seal_bytes);
    auto content = datagram.subspan(wire::sealed::head_bytes);
    opened_.resize(sizeof number + content.size());
    std::memcpy(opened_.data(), datagram.data() + wire::frame_header::size, sizeof number);
    auto fits = [&](aead& with) { return with.open(number, head, content, tag, opened_.data() + sizeof number); };
    if ((wire::read_header(datagram.data()).flags & 1) == in_->phase()) {
        if (!fits(in_->now())) return {};
    } else if (in_->former() && number < in_since_) { // overtaken by the first of the present keys
        if (!fits(*in_->former())) return {};
    } else {
        if (!fits(in_->next())) return {};
        in_->advance();
        in_since_ = number;
    }
    if (calls_ && tls_) tls_.reset(); // the other side's handshake is over, too
    return bytes_view(opened_);
}

void tls_seal::put_sign(buffer& out, std::uint64_t to) {
    std::array<std::byte, sizeof(std::uint64_t) + wire::sealed::seal_bytes> body{};
    auto number = ++signs_sent_;
    detail::store_little(body.data(), number);
    auto start = out.size();
    wire::put_datagram(out, wire::sealed::sign, to, body);
    sign_out_->close(number, bytes_view(out.data() + start, wire::data_head_bytes), {},
                     out.data() + start + wire::data_head_bytes);
}

bool tls_seal::take_sign(bytes_view datagram) {
    if (datagram.size() != wire::sealed::head_bytes) return false;
    auto number = detail::load_little<std::uint64_t>(datagram.data() + wire::frame_header::size);
    std::byte nothing{};
    if (number <= signs_taken_ || !sign_in_->open(number, datagram.first(wire::data_head_bytes), {},
                                                  datagram.subspan(wire::data_head_bytes), &nothing))
        return false;
    signs_taken_ = number;
    return true;
}

} // namespace

std::unique_ptr<seal> seal::make(std::shared_ptr<const shared_key> with, bool calls, key_life life) {
    return std::make_unique<tls_seal>(tls::by_key(std::move(with)), calls, std::string(), life);
}

std::unique_ptr<seal> seal::make(std::shared_ptr<tls::identity> with, environment& env, std::string host,
                                 key_life life) {
    const bool calls = !host.empty();
    return std::make_unique<tls_seal>(tls::by_certificate(std::move(with), env), calls, std::move(host), life);
}

} // namespace ise::net::udp
