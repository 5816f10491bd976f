// Files of certificates and of the shared key, and the certificate that a peer shows: whatever they hold, they make an
// identity or a reason why not. The first byte says what the rest is; of files the parts are divided by a zero byte.
// link: OpenSSL::Crypto
#include <ise/access/policy.hpp>
#include <ise/sim/world.hpp>
#include <ise/transport/shared_key.hpp>
#include <ise/transport/tls/identity.hpp>
#include <ise/transport/tls/subject.hpp>

#include <openssl/err.h>
#include <openssl/x509.h>

#include <cstdlib>
#include <memory>
#include <string>
#include <string_view>

namespace {

// As a peer's certificate comes: in DER.
void shown_by_peer(std::string_view raw) {
    const auto* at = reinterpret_cast<const unsigned char*>(raw.data());
    std::unique_ptr<X509, decltype(&X509_free)> shown(d2i_X509(nullptr, &at, static_cast<long>(raw.size())), X509_free);
    ERR_clear_error();
    if (!shown) return;
    auto about = ise::net::tls::subject_of(*shown);
    if (about && !about->identity.empty() && !ise::access::check_identity(about->identity)) std::abort();
    (void)ise::net::tls::listed_as(*X509_get_issuer_name(shown.get()), *X509_get0_serialNumber(shown.get()));
    ERR_clear_error();
}

void files(std::string_view all) {
    static ise::sim::world world(1);
    static auto& host = world.host("boat");
    static auto& process = host.start_process("boat");
    for (const char* file : {"tls/ca.pem", "tls/certificate.pem", "tls/key.pem"}) {
        auto end = all.find('\0');
        host.write_file(file, std::string(all.substr(0, end)));
        all.remove_prefix(end == all.npos ? all.size() : end + 1);
    }
    auto loaded = ise::net::tls::identity::load(process, "tls");
    if (loaded && !(*loaded)->context(process)) std::abort();
    if (!loaded && loaded.error().message().empty()) std::abort();
}

// An error does not quote the key: it is the same for another one of that length.
void shared_key(std::string_view text) {
    auto key = ise::shared_key::make(text, "file");
    if (key) return;
    std::string other(text);
    for (auto& one : other)
        if (std::string_view(" \t\r\n").find(one) == std::string_view::npos) one = 'x';
    auto of_other = ise::shared_key::make(other, "file");
    if (of_other || of_other.error().message() != key.error().message()) std::abort();
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0) return 0;
    std::string_view rest(reinterpret_cast<const char*>(data) + 1, size - 1);
    switch (data[0] % 3) {
        case 0: shown_by_peer(rest); break;
        case 1: files(rest); break;
        default: shared_key(rest);
    }
    return 0;
}
