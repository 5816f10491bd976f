// What `ise keys` reads: any text is a list of certificates, requests, lists and keys, or has something wrong with it;
// a request of another host is signed for what it asks, or refused.
// link: OpenSSL::Crypto
// source: apps/ise/pki.cpp apps/ise/exit_code.cpp apps/ise/text.cpp
#include <apps/ise/exit_code.hpp>
#include <apps/ise/pki.hpp>

#include <cstdint>
#include <cstdlib>
#include <string>

using namespace ise::cli;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    constexpr pki::moment now{std::chrono::seconds(1'800'000'000)};
    static const auto signer = pki::authority::make("robots", now, pki::days(3650));
    if (size == 0) return 0;
    const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
    try {
        if (data[0] % 2 == 0) {
            if (pki::describe(text, "file").empty()) std::abort();
            return 0;
        }
        auto all = pki::describe(signer.sign(text, now, pki::days(30)), "signed");
        if (all.size() != 1 || !all.front().trouble.empty() || pki::system_of(all.front().identity) != "robots")
            std::abort();
    } catch (const problem& why) {
        if (std::string(why.what()).empty()) std::abort();
    }
    return 0;
}
