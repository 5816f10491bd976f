// `atirma keys` at the command line: what it makes, what it refuses, and that no output has a key.
#include "folder.hpp"

#include <support/catch.hpp>
#include <support/program.hpp>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <sys/stat.h>
#include <unistd.h>
#include <vector>

namespace radio_keys_test {

using cli_test::folder;
using cli_test::text_of;
using ise_test::Contains;

unsigned mode_of(const std::string& file) {
    struct stat found {};
    REQUIRE(::stat(file.c_str(), &found) == 0);
    return found.st_mode & 07777;
}
ise_test::ran keys(std::vector<std::string> words) {
    words.insert(words.begin(), {"atirma", "keys"});
    return ise_test::run_program(std::move(words));
}
std::string secret_of(const std::string& file) {
    auto text = text_of(file);
    auto at = text.find("key ");
    REQUIRE(at != text.npos);
    auto secret = text.substr(at + 4, 64);
    CHECK(secret.find_first_not_of("0123456789abcdef") == secret.npos);
    return secret;
}

TEST_CASE("atirma keys: new makes a key for its owner only, and show tells its fingerprint, never the key") {
    folder in;
    auto file = in.file("radio.key");
    ::umask(0);
    auto made = keys({"new", file, "--boat", "gaviota"});
    INFO(made.out << made.err);
    REQUIRE(made.exit_code == 0);
    CHECK(mode_of(file) == 0600);
    auto secret = secret_of(file);
    CHECK_THAT(made.out, Contains("boat gaviota, epoch 0, fingerprint "));
    auto shown = keys({"show", file});
    CHECK(shown.exit_code == 0);
    CHECK(made.out.find(shown.out) != made.out.npos);
    for (const auto& text : {made.out, made.err, shown.out, shown.err}) CHECK(text.find(secret) == text.npos);
    REQUIRE(keys({"new", in.file("other.key")}).exit_code == 0);
    CHECK(secret_of(in.file("other.key")) != secret);
    CHECK_THAT(keys({"show", in.file("other.key")}).out, Contains("boat atirma, epoch 0"));
    ::umask(022);
}

TEST_CASE("atirma keys: new replaces nothing and leaves nothing behind where it fails") {
    folder in;
    auto file = in.file("radio.key");
    REQUIRE(keys({"new", file}).exit_code == 0);
    auto before = text_of(file);
    auto again = keys({"new", file});
    CHECK(again.exit_code == 1);
    CHECK_THAT(again.err, Contains(file) && Contains("a key is never replaced"));
    CHECK(text_of(file) == before);
    auto nowhere = keys({"new", in.file("none/radio.key")});
    CHECK(nowhere.exit_code == 1);
    CHECK_THAT(nowhere.err, Contains(in.file("none/radio.key")) && Contains("No such file or directory"));
    for (const auto& boat : {std::string(), std::string(65, 'x'), std::string("two\nlines")}) {
        auto refused = keys({"new", in.file("bad.key"), "--boat=" + boat});
        CHECK(refused.exit_code != 0);
        CHECK_FALSE(refused.err.empty());
        CHECK_FALSE(std::filesystem::exists(in.file("bad.key")));
    }
    std::filesystem::create_symlink(in.file("target"), in.file("link.key"));
    CHECK(keys({"new", in.file("link.key")}).exit_code == 1);
    CHECK_FALSE(std::filesystem::exists(in.file("target")));
}

TEST_CASE("atirma keys: rekey makes a file with both keys, and finish leaves the next one") {
    folder in;
    auto file = in.file("radio.key"), both = in.file("radio.next"), recovered = in.file("radio.recovered");
    REQUIRE(keys({"new", file}).exit_code == 0);
    CHECK(mode_of(file + ".recovery") == 0600);
    auto before = text_of(file);
    auto made = keys({"rekey", file, both});
    INFO(made.out << made.err);
    REQUIRE(made.exit_code == 0);
    CHECK(mode_of(both) == 0600);
    CHECK(text_of(file) == before);
    CHECK(text_of(both).starts_with(before));
    CHECK_THAT(made.out, Contains("epoch 0") && Contains("next: boat atirma, epoch 1, fingerprint "));
    CHECK(keys({"show", both}).out == made.out);
    CHECK(made.out.find(secret_of(both)) == made.out.npos);
    auto twice = keys({"rekey", both, in.file("more")});
    CHECK(twice.exit_code == 1);
    CHECK_THAT(twice.err, Contains("atirma keys finish"));
    CHECK(keys({"rekey", file, both}).exit_code == 1); // it exists
    CHECK(keys({"rekey", file}).exit_code == 2);
    CHECK(keys({"finish"}).exit_code == 2);
    auto nothing = keys({"finish", file});
    CHECK(nothing.exit_code == 1);
    CHECK_THAT(nothing.err, Contains("one key only"));
    auto finished = keys({"finish", both});
    CHECK(finished.exit_code == 0);
    CHECK_THAT(finished.out, Contains("boat atirma, epoch 1") && !Contains("next"));
    CHECK(mode_of(both) == 0600);
    CHECK(made.out.find(finished.out.substr(finished.out.find("fingerprint"))) != made.out.npos);

    auto by_recovery = keys({"rekey", file, recovered, "--recovery", file + ".recovery"});
    REQUIRE(by_recovery.exit_code == 0);
    CHECK_THAT(by_recovery.out, Contains("the recovery key seals the change"));
    CHECK_THAT(text_of(recovered), Contains("\nrecovery "));
    REQUIRE(keys({"new", in.file("other.key"), "--boat", "other"}).exit_code == 0);
    auto wrong = keys({"rekey", file, in.file("wrong"), "--recovery", in.file("other.key.recovery")});
    CHECK(wrong.exit_code == 1);
    CHECK_THAT(wrong.err, Contains("of the boat other"));
    CHECK(keys({"rekey", file, in.file("wrong"), "--recovery", file}).exit_code == 1); // no recovery key
    CHECK_FALSE(std::filesystem::exists(in.file("wrong")));
}

TEST_CASE("atirma keys: each change by the recovery key has a higher number, also after a clock that was ahead") {
    folder in;
    auto file = in.file("radio.key"), recovery = file + ".recovery";
    REQUIRE(keys({"new", file}).exit_code == 0);
    // The number of the change in that file, from the packet: version, type, and 5 bytes, the lowest first.
    auto change = [&](const std::string& name) {
        auto made = keys({"rekey", file, in.file(name), "--recovery", recovery});
        INFO(made.err);
        REQUIRE(made.exit_code == 0);
        auto text = text_of(in.file(name));
        auto at = text.find("\nrecovery ");
        REQUIRE(at != text.npos);
        at += std::string_view("\nrecovery ").size() + 4;
        std::uint64_t number = 0;
        for (std::size_t byte = 5; byte-- > 0;)
            number = number << 8 | std::stoul(text.substr(at + 2 * byte, 2), nullptr, 16);
        return number;
    };
    auto first = change("one"), second = change("two"); // within a second
    CHECK(second > first);
    auto kept = text_of(recovery);
    auto line = "\ngeneration " + std::to_string(second) + "\n";
    REQUIRE_THAT(kept, Contains(line));
    CHECK(mode_of(recovery) == 0600);
    auto ahead = second + 1'000'000'000; // of a use with a clock that was some thirty years ahead
    kept.replace(kept.find(line), line.size(), "\ngeneration " + std::to_string(ahead) + "\n");
    std::ofstream(recovery) << kept;
    CHECK(change("three") == ahead + 1);
}

TEST_CASE("atirma keys: wrong arguments end with 2, files that are no key of their own with 1") {
    folder in;
    CHECK(keys({}).exit_code == 2);
    CHECK(keys({"new"}).exit_code == 2);
    CHECK(keys({"show"}).exit_code == 2);
    CHECK(keys({"burn", "x"}).exit_code == 2);
    CHECK(keys({"new", in.file("a"), in.file("b")}).exit_code == 2);
    CHECK(keys({"new", in.file("a"), "--bot", "x"}).exit_code == 2);
    CHECK(std::filesystem::is_empty(in.path));
    auto missing = keys({"show", in.file("radio.key")});
    CHECK(missing.exit_code == 1);
    CHECK_THAT(missing.err, Contains(in.file("radio.key")));
    REQUIRE(keys({"new", in.file("radio.key")}).exit_code == 0);
    auto secret = secret_of(in.file("radio.key"));
    REQUIRE(::chmod(in.file("radio.key").c_str(), 0644) == 0);
    auto open = keys({"show", in.file("radio.key")});
    CHECK(open.exit_code == 1);
    CHECK_THAT(open.err, Contains("others"));
    std::ofstream(in.file("none.key")) << "boat x\nepoch 0\nkey " << secret << "0\n";
    REQUIRE(::chmod(in.file("none.key").c_str(), 0600) == 0);
    auto none = keys({"show", in.file("none.key")});
    CHECK(none.exit_code == 1);
    CHECK_THAT(none.err, Contains("is not a radio key"));
    CHECK(none.err.find(secret) == none.err.npos);
}

} // namespace radio_keys_test
