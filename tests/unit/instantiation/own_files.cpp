// Files and folders that others could have put there: what is believed, run and written through.
#include <ise/core/real/environment.hpp>
#include <ise/core/real/ownership.hpp>
#include <ise/instantiation/real_machine.hpp>

#include <support/catch.hpp>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

namespace own_files_test {

using ise_test::Contains;
using namespace ise::instantiation;
namespace fs = std::filesystem;

namespace {

constexpr uid_t somebody = 54321; // nobody else's

/// A folder of this user's own, in the system's temporary one: sticky, and everybody's.
struct own_folder {
    own_folder() {
        auto pattern = (fs::temp_directory_path() / "ise-own-XXXXXX").string();
        if (!::mkdtemp(pattern.data())) throw std::runtime_error("no temporary folder");
        path = pattern;
    }
    ~own_folder() {
        std::error_code ignored;
        fs::remove_all(path, ignored);
    }
    std::string folder(const std::string& name, mode_t mode = 0755) const {
        auto made = path / name;
        fs::create_directories(made);
        ::chmod(made.c_str(), mode);
        return made.string();
    }
    std::string file(const std::string& name, mode_t mode = 0600,
                     const std::string& content = "0123456789012345678901234567890123456789") const {
        auto made = path / name;
        std::ofstream(made) << content;
        ::chmod(made.c_str(), mode);
        return made.string();
    }
    fs::path path;
};

std::string content_of(const std::string& file) {
    std::ifstream from(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(from), {}};
}

template <class T>
std::string why_not(const ise::result<T>& of) {
    if (of) return "it was allowed";
    CHECK(of.error().code() == ise::errc::unauthorized);
    return of.error().message();
}

bool is_root() { return ::geteuid() == 0; }

} // namespace

TEST_CASE("what a user and root have of their own is theirs") {
    own_folder here;
    CHECK(why_not(ise::check_own_path(here.folder("a/b"))) == "it was allowed");
    CHECK(why_not(ise::check_own_path(here.file("a/key"))) == "it was allowed");
    CHECK(why_not(ise::check_own_path("/usr/bin")) == "it was allowed");
    CHECK(why_not(ise::check_own_path("/bin/sh")) == "it was allowed"); // over links of root's
    fs::create_symlink(here.path / "a", here.path / "to-a");
    CHECK(why_not(ise::check_own_path((here.path / "to-a/../to-a/./b").string())) == "it was allowed");
    auto missing = ise::check_own_path((here.path / "nothing").string());
    REQUIRE(!missing);
    CHECK(missing.error().code() == ise::errc::io_failed);
    fs::create_symlink(here.path / "circle", here.path / "circle");
    CHECK_FALSE(ise::check_own_path((here.path / "circle").string()));
}

TEST_CASE("where others can write nothing is ours") {
    own_folder here;
    CHECK_THAT(why_not(ise::check_own_path(here.folder("open", 0777))),
               Contains("all users can write to") && Contains("chmod o-w"));
    CHECK_THAT(why_not(ise::check_own_path(here.folder("open/inner"))), Contains("all users can write to"));
    auto sticky = here.folder("sticky", 01777);
    CHECK_THAT(why_not(ise::check_own_path(sticky)), Contains("all users can write to"));
    CHECK(why_not(ise::check_own_path(here.folder("sticky/inner"))) ==
          "it was allowed"); // nobody else can move it away
    CHECK_THAT(why_not(ise::check_own_path(here.file("open-file", 0666))), Contains("all users can write to"));
}

TEST_CASE("what belongs to another user is not believed, run or written to") {
    if (!is_root()) return ise_test::skip("giving a folder to another user takes root");
    own_folder here;
    auto his = here.folder("his");
    auto program = here.file("his/boat", 0755, "#!/bin/sh\necho stolen\n");
    auto folder = here.folder("mine");
    fs::create_symlink(program, fs::path(folder) / "boat");
    REQUIRE(::chown(his.c_str(), somebody, somebody) == 0);
    CHECK_THAT(why_not(ise::check_own_path(his)), Contains("belongs to user 54321, who can replace what lies in it"));
    CHECK_THAT(why_not(ise::check_own_path(program)), Contains("belongs to user 54321"));

    real_machine host;
    CHECK_THAT(why_not(host.programs(his)), Contains("is not safe from other users"));
    auto found = host.programs(folder);
    REQUIRE(found);
    REQUIRE(found->size() == 1);
    CHECK_THAT(found->front().objection, Contains("belongs to user 54321"));
    CHECK_THAT(why_not(host.take_folder(his)), Contains("is not safe from other users"));
    CHECK_THAT(why_not(host.take_folder(his + "/state")), Contains("is not safe from other users"));

    ise::real_environment env;
    auto key = here.file("key", 0600), authority = here.file("ca.pem", 0644);
    CHECK(env.read_secret(key, 1000));
    CHECK(env.read_trusted(authority, 1000));
    for (const auto& one : {key, authority}) REQUIRE(::chown(one.c_str(), somebody, somebody) == 0);
    CHECK_THAT(why_not(env.read_secret(key, 1000)), Contains("belongs to user 54321"));
    CHECK_THAT(why_not(env.read_trusted(authority, 1000)), Contains("belongs to user 54321"));
}

TEST_CASE("a link of another user is not followed") {
    if (!is_root()) return ise_test::skip("giving a link to another user takes root");
    own_folder here;
    auto sticky = here.folder("sticky", 01777);
    auto link = sticky + "/programs";
    fs::create_symlink(here.folder("mine"), link);
    CHECK(why_not(ise::check_own_path(link)) == "it was allowed");
    REQUIRE(::lchown(link.c_str(), somebody, somebody) == 0);
    CHECK_THAT(why_not(ise::check_own_path(link)), Contains("the link") && Contains("belongs to user 54321"));
}

TEST_CASE("the group of others may not write, root's and one's own may") {
    if (!is_root()) return ise_test::skip("giving a folder to another group takes root");
    own_folder here;
    auto shared = here.folder("shared", 0775);
    CHECK(why_not(ise::check_own_path(shared)) == "it was allowed"); // of root's group
    REQUIRE(::chmod(here.path.c_str(), 0755) == 0);
    REQUIRE(::chown(shared.c_str(), somebody, somebody) == 0);
    auto child = ::fork();
    REQUIRE(child >= 0);
    if (child == 0) { // as somebody who has no account, and so no group of his own
        if (::setgid(somebody) != 0 || ::setuid(somebody) != 0) ::_exit(2);
        auto result = ise::check_own_path(shared);
        ::_exit(!result && result.error().message().find("its group can write") != std::string::npos ? 0
                : result                                                                             ? 3
                                                                                                     : 4);
    }
    int status = 0;
    REQUIRE(::waitpid(child, &status, 0) == child);
    CHECK(WIFEXITED(status));
    CHECK(WEXITSTATUS(status) == 0);
}

TEST_CASE("a link that lies where a file is to be written is not written through") {
    own_folder here;
    auto victim = here.file("precious", 0600, "mine");
    auto state = (here.path / "state.json").string();
    fs::create_symlink(victim, state + ".new");
    real_machine host;
    REQUIRE(host.replace_file(state, "state"));
    CHECK(content_of(victim) == "mine");
    CHECK(content_of(state) == "state");
    CHECK_FALSE(fs::is_symlink(state));
    auto folder = here.folder("server", 0700);
    fs::create_symlink(victim, folder + "/lock");
    CHECK_FALSE(host.take_folder(folder));
}

TEST_CASE("a program is another when it was built again, not when it was copied") {
    own_folder here;
    real_machine host;
    auto copy = (here.path / "boat").string();
    fs::copy_file("/proc/self/exe", copy);
    CHECK(host.version_of(copy) == host.version_of("/proc/self/exe"));
    auto script = here.file("script", 0755, "#!/bin/sh\n");
    auto before = host.version_of(script);
    CHECK_FALSE(before.empty());
    here.file("script", 0755, "#!/bin/sh\necho\n");
    CHECK(host.version_of(script) != before);
    CHECK(host.version_of((here.path / "nothing").string()).empty());
    here.file("cut", 0755, std::string("\177ELF\2\1\1\0", 8)); // no whole header
    CHECK_FALSE(host.version_of((here.path / "cut").string()).empty());
}

} // namespace own_files_test
