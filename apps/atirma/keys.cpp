#include "keys.hpp"

#include <components/seal/sealed_frame.hpp>

#include <ise/core/real/environment.hpp>

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <sys/random.h>
#include <unistd.h>

namespace atirma {
namespace {

int failed(const std::string& what) {
    fmt::print(stderr, "atirma keys: {}\n", what);
    return 1;
}

std::string because() { return std::strerror(errno); }

int show(const seal::radio_key& key) {
    fmt::print("boat {}, epoch {}, fingerprint {}\n", key.boat, key.epoch, seal::fingerprint(key));
    return 0;
}

} // namespace

int new_radio_key(const std::string& file, const std::string& boat) {
    seal::radio_key key;
    key.boat = boat;
    if (::getrandom(key.secret.data(), key.secret.size(), 0) != static_cast<ssize_t>(key.secret.size()))
        return failed("no random numbers: " + because());
    auto text = seal::format_key(key);
    if (auto good = seal::parse_key(text, file); !good) return failed("the boat's name has 1 to 64 bytes, in one line");
    int out = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (out < 0)
        return failed(fmt::format("cannot make {}: {}{}", file, because(),
                                  errno == EEXIST ? "; a key is never replaced, remove it first" : ""));
    bool good = ::write(out, text.data(), text.size()) == static_cast<ssize_t>(text.size()) && ::fsync(out) == 0;
    auto why = because();
    if (::close(out) != 0 || !good) {
        ::unlink(file.c_str());
        return failed(fmt::format("cannot write {}: {}", file, why));
    }
    return show(key);
}

int show_radio_key(const std::string& file) {
    auto text = ise::real_environment().read_secret(file, 4096);
    if (!text) return failed(text.error().message());
    auto key = seal::parse_key(*text, file);
    if (!key) return failed(key.error().message());
    return show(*key);
}

} // namespace atirma
