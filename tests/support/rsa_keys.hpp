#pragma once
#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rsa.h>

#include <string>

namespace ise_test {

/// A new pair of RSA keys, in PEM.
struct rsa_keys {
    std::string secret, open;

    rsa_keys() {
        EVP_PKEY* key = EVP_RSA_gen(2048);
        auto text = [](auto write) {
            BIO* memory = BIO_new(BIO_s_mem());
            write(memory);
            char* data = nullptr;
            auto size = BIO_get_mem_data(memory, &data);
            std::string out(data, static_cast<std::size_t>(size));
            BIO_free_all(memory);
            return out;
        };
        secret = text([&](BIO* to) { PEM_write_bio_PrivateKey(to, key, nullptr, nullptr, 0, nullptr, nullptr); });
        open = text([&](BIO* to) { PEM_write_bio_PUBKEY(to, key); });
        EVP_PKEY_free(key);
    }
};

} // namespace ise_test
