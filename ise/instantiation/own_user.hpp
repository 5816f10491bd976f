#pragma once
#include <ise/instantiation/launch_rules.hpp>

#include <string>
#include <vector>

#include <sys/types.h>

namespace ise::instantiation {

/// A user of the operating system, for a process that becomes his.
struct os_user {
    std::string name, home;
    uid_t id = 0;
    gid_t group = 0;
    std::vector<gid_t> groups; ///< all that he is in
};

/// errc::invalid_argument: there is no such user.
result<os_user> find_user(const std::string& name);

/// Why no component may run as that user here; empty: it may. This process must be root for any other than its own.
std::string objection_to_user(const std::string& name, const launch_rules& rules);

/// What a step of `become` is: "setgroups"…
const char* name_of_step(int step) noexcept;
/// Makes this process that user's, for good: groups, group, user, and that there is no way back. For the child of a
/// fork: makes system calls only. 0, else the step that failed, with errno.
int become(const os_user& whom) noexcept;

} // namespace ise::instantiation
