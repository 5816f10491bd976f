// Which user of the operating system a component may be started as.
#include <ise/instantiation/launch_rules.hpp>
#include <ise/instantiation/own_user.hpp>
#include <support/catch.hpp>

#include <pwd.h>
#include <sys/wait.h>
#include <unistd.h>

#include <string>

namespace own_user_test {

using namespace ise::instantiation;
using ise_test::Contains;

namespace {

launch_rules allowing(const std::string& user) {
    launch_rules made;
    made.users = {user};
    return made;
}

// The objection of a process of this user, as which it runs for good.
std::string objection_as(const passwd& whom, const std::string& name, const launch_rules& rules) {
    int ends[2];
    REQUIRE(::pipe(ends) == 0);
    const auto child = ::fork();
    REQUIRE(child >= 0);
    if (child == 0) {
        auto text = ::setgid(whom.pw_gid) == 0 && ::setuid(whom.pw_uid) == 0 ? objection_to_user(name, rules)
                                                                             : std::string("it is still root");
        ::_exit(::write(ends[1], text.data(), text.size()) == static_cast<ssize_t>(text.size()) ? 0 : 1);
    }
    ::close(ends[1]);
    std::string text(4096, '\0');
    auto count = ::read(ends[0], text.data(), text.size());
    text.resize(count > 0 ? static_cast<std::size_t>(count) : 0);
    ::close(ends[0]);
    int status = 1;
    REQUIRE(::waitpid(child, &status, 0) == child);
    CHECK(status == 0);
    return text;
}

} // namespace

TEST_CASE("a user that no rule allows, that there is not, or that is root is refused with what allows it") {
    CHECK_THAT(objection_to_user("root", {}), Contains("--as-root"));
    CHECK_THAT(objection_to_user("root", allowing("root")), Contains("--as-root"));
    CHECK_THAT(objection_to_user("no-such-user", {}), Contains("there is no user 'no-such-user'"));
    CHECK_THAT(objection_to_user("daemon", {}), Contains("--allow-user daemon"));
}

TEST_CASE("a server that is root starts components as others, one that is not only as itself") {
    const auto* found = ::getpwnam("nobody");
    if (::geteuid() != 0 || !found) {
        WARN("skipped: only root becomes another user, and there must be a user 'nobody'");
        return;
    }
    const auto nobody = *found;
    CHECK(objection_to_user("nobody", allowing("nobody")).empty());
    CHECK(objection_to_user("daemon", allowing("daemon")).empty());
    CHECK(objection_as(nobody, "nobody", allowing("nobody")).empty());
    CHECK(objection_as(nobody, "daemon", allowing("daemon")) ==
          "the instantiation server is not root, and starts no component as user 'daemon'");
}

} // namespace own_user_test
