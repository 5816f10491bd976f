// Components with a user and an identity of their own.
#include "host.hpp"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <pwd.h>
#include <sstream>
#include <unistd.h>

using namespace host_test;
using ise_test::Contains;
namespace fs = std::filesystem;

namespace {

std::string content(const fs::path& file) {
    std::ifstream from(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(from), {}};
}

std::string of_process(int pid, const char* file) { return content(fs::path("/proc") / std::to_string(pid) / file); }

// "Uid:\t0\t0\t0\t0\n": the four of them.
std::vector<unsigned> ids_of(int pid, const std::string& which) {
    auto text = of_process(pid, "status");
    auto at = text.find("\n" + which + ":");
    REQUIRE(at != text.npos);
    std::istringstream line(text.substr(at + which.size() + 2, text.find('\n', at + 1) - at - which.size() - 2));
    return {std::istream_iterator<unsigned>(line), {}};
}

// "USER=nobody" is a variable of its environment, whole.
bool has_variable(int pid, const std::string& whole) {
    auto all = std::string(1, '\0') + of_process(pid, "environ");
    return all.find(std::string(1, '\0') + whole + std::string(1, '\0')) != all.npos;
}

// Its programs can be reached by every user.
void open_to_all(const host& here) {
    auto link = here.programs() / "ise_trouble";
    auto program = fs::canonical(link);
    fs::remove(link);
    fs::copy_file(program, link);
    for (const auto& folder : {here.programs().parent_path(), here.programs()})
        fs::permissions(folder, fs::perms::group_exec | fs::perms::others_exec | fs::perms::others_read,
                        fs::perm_options::add);
}

std::string refusal(host& here, std::vector<std::string> more) {
    std::vector<std::string> words{"start", "trouble", "sea/no", "--timeout", "60s"};
    words.insert(words.end(), more.begin(), more.end());
    auto ran = here.ise(words);
    CHECK(ran.exit_code != 0);
    return ran.err;
}

} // namespace

TEST_CASE("a component runs as a user of its own: his groups and his home, and after a crash of the server again") {
    const auto* nobody = ::getpwnam("nobody");
    if (::geteuid() != 0 || !nobody) {
        WARN("skipped: only root can start a component as another user, and there must be a user 'nobody'");
        return;
    }
    const auto uid = nobody->pw_uid, gid = nobody->pw_gid;
    const std::string home = nobody->pw_dir;
    host here;
    open_to_all(here);
    here.open({"--allow-user", "nobody"});
    int pid = here.start("sea/one", {"--user", "nobody"})["process_id"];
    auto check = [&] {
        CHECK(ids_of(pid, "Uid") == std::vector<unsigned>(4, uid));
        CHECK(ids_of(pid, "Gid") == std::vector<unsigned>(4, gid));
        auto groups = ids_of(pid, "Groups");
        CHECK(std::ranges::find(groups, 0u) == groups.end());
        CHECK(has_variable(pid, "HOME=" + home));
        CHECK(has_variable(pid, "USER=nobody"));
        CHECK(has_variable(pid, "LOGNAME=nobody"));
        const char* ours = std::getenv("HOME");
        if (ours && home != ours) CHECK_FALSE(has_variable(pid, std::string("HOME=") + ours));
    };
    check();
    CHECK(here.state("sea/one")["user"] == "nobody");
    CHECK_THAT(here.ise({"ps"}).out, Contains(std::to_string(pid) + " as nobody"));
    CHECK(ids_of(here.start("sea/two")["process_id"], "Uid") ==
          std::vector<unsigned>(4, 0)); // without a user as before

    here.crash();
    here.open({"--allow-user", "nobody"});
    CHECK(here.state("sea/one")["process_id"] == pid);
    auto again = here.json_of({"restart", "sea/one", "--timeout", "60s"});
    CHECK(again["process_id"] != pid);
    pid = again["process_id"];
    check();
    CHECK(here.ise({"stop", "sea/one"}).exit_code == 0);
    CHECK_FALSE(lives(pid));
}

TEST_CASE("a user or an identity that a component may not have is refused, with what allows it") {
    host here;
    open_to_all(here);
    here.open({"--allow-user", "nobody"});
    CHECK_THAT(refusal(here, {"--user", "root"}), Contains("root") && Contains("--as-root"));
    CHECK_THAT(refusal(here, {"--user", "no-such-user"}), Contains("there is no user 'no-such-user' on this host"));
    CHECK_THAT(refusal(here, {"--user", "daemon"}), Contains("--allow-user daemon"));
    CHECK_THAT(refusal(here, {"--identity", "own"}), Contains("--identities FOLDER"));
    CHECK_THAT(refusal(here, {"--identity", "../own"}), Contains("'../own' is no name of an identity"));
    CHECK_THAT(refusal(here, {"--user", "nobody", "--process", "main"}), Contains("belong to a whole process"));
    if (::geteuid() == 0) {
        fs::permissions(here.programs().parent_path(), fs::perms::owner_all);
        CHECK_THAT(refusal(here, {"--user", "nobody"}), Contains("as user 'nobody': Permission denied"));
    }
}

TEST_CASE("a component with an identity of its own gets the folder of that name as its certificates") {
    host here;
    auto folder = here.programs().parent_path() / "identities";
    auto keys = [](std::vector<std::string> words) {
        words.insert(words.begin(), {"ise", "keys"});
        auto ran = ise_test::run_program(words);
        INFO(ran.err);
        REQUIRE(ran.exit_code == 0);
    };
    fs::create_directory(folder);
    fs::permissions(folder, fs::perms::owner_all);
    auto authority = (folder / "authority").string(), own = (folder / "own").string();
    keys({"ca", "sea", "--authority", authority});
    keys({"request", "ise://sea/own", "--host", "127.0.0.1", "--folder", own});
    keys({"issue", own, "--authority", authority});
    here.open({"--identities", folder.string()});
    auto started = here.start("sea/one", {"--identity", "own"});
    CHECK(started["identity"] == "own");
    CHECK(has_variable(started["process_id"], "ISE_TLS=" + own));
    CHECK(here.ise({"stop", "sea/one"}).exit_code == 0);
    auto ran = here.ise({"start", "trouble", "sea/two", "--identity", "other", "--timeout", "60s"});
    CHECK(ran.exit_code != 0);
    INFO(ran.err);
    CHECK_THAT(ran.err, Contains("identities/other"));
}
