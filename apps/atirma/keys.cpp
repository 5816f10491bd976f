#include "keys.hpp"

#include <components/seal/key_file.hpp>
#include <components/seal/rekey.hpp>

#include <ise/core/real/environment.hpp>
#include <ise/core/real/own_file.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>
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

constexpr std::size_t max_key_file = 4096;

void print(const char* what, const seal::radio_key& key) {
    fmt::print("{}boat {}, epoch {}, fingerprint {}\n", what, key.boat, key.epoch, seal::fingerprint(key));
}

int show(const seal::radio_keys& keys) {
    print("", keys.now);
    if (keys.next) print("next: ", *keys.next);
    if (!keys.recovery.empty()) fmt::print("the recovery key seals the change\n");
    return 0;
}

bool draw(seal::radio_key& into) {
    return ::getrandom(into.secret.data(), into.secret.size(), 0) == static_cast<ssize_t>(into.secret.size());
}

// A new file for its owner only. Why not; empty: it is on disk.
std::string write_new(const std::string& file, const std::string& text) {
    int out = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (out < 0)
        return fmt::format("cannot make {}: {}{}", file, because(),
                           errno == EEXIST ? "; a key is never replaced, remove it first" : "");
    bool good = ::write(out, text.data(), text.size()) == static_cast<ssize_t>(text.size()) && ::fsync(out) == 0;
    auto why = because();
    if (::close(out) == 0 && good) {
        [[maybe_unused]] auto unsynced = ise::sync_folder_of(file);
        return {};
    }
    ::unlink(file.c_str());
    return fmt::format("cannot write {}: {}", file, why);
}

ise::result<seal::radio_keys> read(const std::string& file) {
    auto text = ise::real_environment().read_secret(file, max_key_file);
    if (!text) return text.error();
    return seal::parse_keys(*text, file);
}

} // namespace

int new_radio_key(const std::string& file, const std::string& boat) {
    seal::radio_key key;
    seal::recovery_key recovery;
    key.boat = recovery.key.boat = boat;
    if (!draw(key) || !draw(recovery.key)) return failed("no random numbers: " + because());
    auto text = seal::format_key(key);
    if (auto good = seal::parse_keys(text, file); !good || good->now.boat != boat)
        return failed("the boat's name has 1 to 64 bytes, in one line");
    if (auto why = write_new(file, text); !why.empty()) return failed(why);
    auto recovery_file = file + ".recovery";
    if (auto why = write_new(recovery_file, seal::format_recovery_key(recovery)); !why.empty()) {
        ::unlink(file.c_str());
        return failed(why);
    }
    print("", key);
    fmt::print("{} changes the key if this one is stolen: copy both files to the boat, and keep that one off the "
               "shore's machines\n",
               recovery_file);
    return 0;
}

int show_radio_key(const std::string& file) {
    auto keys = read(file);
    return keys ? show(*keys) : failed(keys.error().message());
}

int next_radio_key(const std::string& file, const std::string& made, const std::string& recovery) {
    auto keys = read(file);
    if (!keys) return failed(keys.error().message());
    if (keys->next)
        return failed(fmt::format("{} is being changed to epoch {}: when the boat uses that on every link, run atirma "
                                  "keys finish {}",
                                  file, keys->next->epoch, file));
    keys->next = keys->now;
    keys->next->epoch = static_cast<std::uint8_t>((keys->now.epoch + 1) % (seal::max_epoch + 1));
    if (!draw(*keys->next)) return failed("no random numbers: " + because());
    if (!recovery.empty()) {
        auto text = ise::real_environment().read_secret(recovery, max_key_file);
        if (!text) return failed(text.error().message());
        auto by = seal::parse_recovery_key(*text, recovery);
        if (!by) return failed(by.error().message());
        if (by->key.boat != keys->now.boat)
            return failed(
                fmt::format("{} is of the boat {}, and {} of {}", recovery, by->key.boat, file, keys->now.boat));
        // The boat accepts rising numbers only. The last one is kept, so that one use with a clock that was ahead does
        // not make the next ones too low; the time serves a copy of the file that was not used last.
        by->generation = std::max(by->generation + 1, static_cast<std::uint64_t>(std::time(nullptr)));
        keys->recovery = seal::seal_recovery(by->key, by->generation, *keys->next);
        if (auto replaced = ise::replace_own_file(recovery, seal::format_recovery_key(*by)); !replaced)
            return failed(fmt::format("{}; it keeps the number of its last use", replaced.error().message()));
    }
    if (auto why = write_new(made, seal::format_keys(*keys)); !why.empty()) return failed(why);
    return show(*keys);
}

int finish_radio_key(const std::string& file) {
    auto keys = read(file);
    if (!keys) return failed(keys.error().message());
    if (!keys->next) return failed(fmt::format("{} has one key only: nothing is to be finished", file));
    seal::radio_keys then;
    then.now = *keys->next;
    if (auto replaced = ise::replace_own_file(file, seal::format_keys(then)); !replaced)
        return failed(replaced.error().message());
    return show(then);
}

} // namespace atirma
