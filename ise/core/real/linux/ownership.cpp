#include <ise/core/real/ownership.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <climits>
#include <cstdio>
#include <deque>
#include <vector>

#include <grp.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

namespace ise {
namespace {

constexpr int max_links = 40;

// Empty: it has none.
std::string name_of_user(uid_t user) {
    std::vector<char> room(16384);
    passwd entry{};
    passwd* found = nullptr;
    if (::getpwuid_r(user, &entry, room.data(), room.size(), &found) != 0 || !found) return {};
    return found->pw_name;
}

std::string user_text(uid_t user) {
    auto name = name_of_user(user);
    return name.empty() ? fmt::format("user {}", user) : fmt::format("{} (user {})", name, user);
}

// Root's, or the one that a user has for himself (of his name), where a umask of 002 is usual.
bool is_own_group(gid_t group) {
    if (group == 0) return true;
    std::vector<char> user_room(16384), group_room(65536);
    passwd user{};
    passwd* me = nullptr;
    ::group entry{};
    ::group* its = nullptr;
    if (::getpwuid_r(::geteuid(), &user, user_room.data(), user_room.size(), &me) != 0 || !me || me->pw_gid != group)
        return false;
    if (::getgrgid_r(group, &entry, group_room.data(), group_room.size(), &its) != 0 || !its) return false;
    return std::string_view(me->pw_name) == its->gr_name;
}

// Within a user namespace the owner of what was there before is shown as nobody.
uid_t owner_unknown_here() {
    constexpr uid_t nobody_is = static_cast<uid_t>(-1);
    auto first_number = [](const char* file, int place) {
        std::array<unsigned, 3> numbers{};
        auto* from = std::fopen(file, "re");
        if (!from) return nobody_is;
        int got = std::fscanf(from, "%u %u %u", &numbers[0], &numbers[1], &numbers[2]);
        std::fclose(from);
        return got > place ? numbers[static_cast<std::size_t>(place)] : nobody_is;
    };
    bool maps_all = first_number("/proc/self/uid_map", 2) == static_cast<uid_t>(-1);
    return maps_all ? nobody_is : first_number("/proc/sys/kernel/overflowuid", 0);
}

/// Follows a path step by step.
class own_path {
public:
    explicit own_path(std::string path) : wanted_(std::move(path)) {}

    result<void> check() {
        auto start = wanted_;
        if (!start.starts_with('/')) {
            std::array<char, PATH_MAX> here{};
            if (!::getcwd(here.data(), here.size())) return trouble(".");
            start = fmt::format("{}/{}", here.data(), start);
        }
        put_before(start);
        for (;;) {
            auto may = left_.empty() ? is_own(true) : is_own(false);
            if (!may || left_.empty()) return may;
            auto moved = step();
            if (!moved) return moved;
        }
    }

private:
    result<void> step() {
        auto part = std::move(left_.front());
        left_.pop_front();
        if (part == "..") {
            at_ = at_.substr(0, at_.rfind('/'));
            return {};
        }
        auto next = at_ + "/" + part;
        struct stat about {};
        if (::lstat(next.c_str(), &about) != 0) return trouble(next);
        if (!S_ISLNK(about.st_mode)) {
            at_ = std::move(next);
            return {};
        }
        if (!is_trusted(about.st_uid, false))
            return refused(
                fmt::format("the link {} belongs to {}, who can point it anywhere", next, user_text(about.st_uid)),
                next);
        std::array<char, PATH_MAX> target{};
        auto length = ::readlink(next.c_str(), target.data(), target.size() - 1);
        if (length < 0) return trouble(next);
        if (++links_ > max_links) {
            errno = ELOOP;
            return trouble(next);
        }
        if (target.front() == '/') at_.clear();
        put_before(target.data());
        return {};
    }

    void put_before(std::string_view path) {
        std::vector<std::string> parts;
        while (!path.empty()) {
            auto part = path.substr(0, path.find('/'));
            path.remove_prefix(std::min(path.size(), part.size() + 1));
            if (!part.empty() && part != ".") parts.emplace_back(part);
        }
        left_.insert(left_.begin(), parts.begin(), parts.end());
    }

    bool is_trusted(uid_t owner, bool itself) const {
        return owner == 0 || owner == ::geteuid() || (!itself && owner == unknown_);
    }

    /// What was reached so far: what was asked for `itself`, or a folder above it.
    result<void> is_own(bool itself) const {
        auto here = at_.empty() ? std::string("/") : at_;
        struct stat about {};
        if (::lstat(here.c_str(), &about) != 0) return trouble(here);
        // Others cannot replace what is ours there.
        bool sticky = !itself && S_ISDIR(about.st_mode) && (about.st_mode & S_ISVTX) != 0;
        if (!is_trusted(about.st_uid, itself))
            return refused(fmt::format("{} belongs to {}, who can replace {}", here, user_text(about.st_uid),
                                       S_ISDIR(about.st_mode) ? "what lies in it" : "it"),
                           here);
        if ((about.st_mode & S_IWOTH) != 0 && !sticky)
            return refused(
                fmt::format("all users can write to {} (mode {:o}): chmod o-w {}", here, about.st_mode & 07777, here),
                {});
        // Root knows whom it gave a group.
        bool group_writes = (about.st_mode & S_IWGRP) != 0 && !sticky && about.st_uid != 0;
        if (group_writes && !is_own_group(about.st_gid))
            return refused(
                fmt::format("its group can write to {} (mode {:o}): chmod g-w {}", here, about.st_mode & 07777, here),
                {});
        return {};
    }

    failure refused(std::string why, const std::string& foreign) const {
        if (!foreign.empty()) why += ": use one of your own, or let root chown it";
        return {errc::unauthorized, fmt::format("{} is not safe from other users: {}", wanted_, why)};
    }
    failure trouble(const std::string& where) const {
        return {errc::io_failed,
                fmt::format("cannot look at {}: {}", where, std::error_code(errno, std::system_category()).message())};
    }

    std::string wanted_;
    std::string at_; // without a slash at its end; empty: the root
    std::deque<std::string> left_;
    int links_ = 0;
    uid_t unknown_ = owner_unknown_here();
};

} // namespace

result<void> check_own_path(const std::string& path) { return own_path(path).check(); }

result<void> check_own_file(const std::string& file, std::string_view doing) {
    auto slash = file.rfind('/');
    auto folder = slash == file.npos ? std::string(".") : slash == 0 ? std::string("/") : file.substr(0, slash);
    auto own = check_own_path(::access(file.c_str(), F_OK) == 0 ? file : folder);
    if (own) return own;
    return failure(own.error().code(), fmt::format("cannot {} {}: {}", doing, file, own.error().message()));
}

bool is_own_user(std::optional<std::uint32_t> user) noexcept { return user == ::geteuid(); }

std::string process_user() {
    auto name = name_of_user(::geteuid());
    return name.empty() ? fmt::format("{}", ::geteuid()) : name;
}

} // namespace ise
