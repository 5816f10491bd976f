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

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0) return 0;
    std::string_view rest(reinterpret_cast<const char*>(data) + 1, size - 1);
    switch (data[0] % 3) {
        case 0: shown_by_peer(rest); break;
        case 1: files(rest); break;
        default: {
            auto key = ise::shared_key::make(rest, "file");
            if (!key && key.error().message().find(rest.substr(0, 32)) != std::string::npos && rest.size() > 31)
                std::abort(); // an error does not quote the key
        }
    }
    return 0;
}
