// environment-boundary: users of the operating system
#include <ise/instantiation/own_user.hpp>

#include <ise/instantiation/words.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <grp.h>
#include <pwd.h>
#include <unistd.h>

namespace ise::instantiation {

result<os_user> find_user(const std::string& name) {
    passwd entry{};
    passwd* found = nullptr;
    std::vector<char> room(16384);
    int problem = ERANGE;
    while ((problem = ::getpwnam_r(name.c_str(), &entry, room.data(), room.size(), &found)) == ERANGE &&
           room.size() < (std::size_t{1} << 20))
        room.resize(2 * room.size());
    if (!found) return failure(errc::invalid_argument, fmt::format("there is no user '{}' on this host", shown(name)));
    os_user made;
    made.name = found->pw_name;
    made.home = found->pw_dir;
    made.id = found->pw_uid;
    made.group = found->pw_gid;
    int count = 64;
    made.groups.resize(static_cast<std::size_t>(count));
    if (::getgrouplist(found->pw_name, made.group, made.groups.data(), &count) < 0) {
        made.groups.resize(static_cast<std::size_t>(std::max(count, 1)));
        if (::getgrouplist(found->pw_name, made.group, made.groups.data(), &count) < 0)
            return failure(errc::invalid_argument, fmt::format("the groups of user '{}' cannot be found", shown(name)));
    }
    made.groups.resize(static_cast<std::size_t>(count));
    return made;
}

std::string objection_to_user(const std::string& name, const launch_rules& rules) {
    auto whom = find_user(name);
    if (!whom) return whom.error().message();
    if (whom->id == 0 && !rules.as_root)
        return fmt::format("no component is started as '{}', who is root, unless the instantiation server was started "
                           "with --as-root",
                           name);
    if (whom->id != 0 && std::ranges::find(rules.users, name) == rules.users.end())
        return fmt::format("no component may run as user '{0}' here: the instantiation server allows it with "
                           "--allow-user {0}",
                           name);
    if (whom->id != ::geteuid() && ::geteuid() != 0)
        return fmt::format("the instantiation server is not root, and starts no component as user '{}'", name);
    return {};
}

const char* name_of_step(int step) noexcept {
    constexpr std::array<const char*, 5> names = {"", "setgroups", "setresgid", "setresuid", "giving root up"};
    return names[static_cast<std::size_t>(step) % names.size()];
}

int become(const os_user& whom) noexcept {
    if (whom.id == ::geteuid() && whom.id == ::getuid() && whom.id != 0) return 0; // it is already
    if (::setgroups(whom.groups.size(), whom.groups.data()) != 0) return 1;
    if (::setresgid(whom.group, whom.group, whom.group) != 0) return 2;
    if (::setresuid(whom.id, whom.id, whom.id) != 0) return 3;
    bool is = ::getuid() == whom.id && ::geteuid() == whom.id && ::getgid() == whom.group && ::getegid() == whom.group;
    bool back = whom.id != 0 && ::setuid(0) == 0;
    if (is && !back) return 0;
    errno = EPERM;
    return 4;
}

} // namespace ise::instantiation
