#pragma once
#include <ise/core/time.hpp>
#include <ise/service/resolver.hpp>
#include <ise/service/role_options.hpp>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace ise {

/// Which member of a role a link talks to: the decisions, without I/O. Times are passed in.
class role_choice {
public:
    explicit role_choice(role_options how) noexcept : how_(how) {}

    /// Who serves the role now, best first.
    void know(std::vector<location> members, time_point now);

    /// In which order they are tried for a session: the one whose session broke first, so that its subscriptions resume
    /// without a gap, unless it is in doubt; then by rank.
    std::vector<location> candidates() const;

    void took(const location& which);
    /// The taken one, if it is told of as a member no more: its lease is over, or it has left the role.
    std::optional<location> unlisted() const;
    /// The taken one lives and has left the role: whatever the policy, the handle moves as soon as it can.
    void left(const location& which);
    /// The session with the taken one has ended. `in_doubt`: it fell silent, or has lost its name.
    void lost(bool in_doubt);

    struct change {
        location to;
        time_point at; ///< not before
    };
    /// The member to which the handle should move: a better one where the options allow failback, any if the taken one
    /// has left the role. `bound`: only in the latter case.
    std::optional<change> better(bool bound = false) const;
    /// It was not reached: not again before it was there for the steady time from now on, and for a second.
    void put_off(const std::string& path, time_point now);

private:
    struct presence {
        std::uint64_t incarnation = 0;
        bool ready = false;
        time_point since;
        time_point not_before = time_point::min(); // it was not reached
    };
    static bool outranks(const location& a, const location& b) noexcept;

    role_options how_;
    std::vector<location> members_;
    std::map<std::string, presence> present_; // by path
    std::optional<location> taken_;
    std::string lost_; // the path of the last one, until another is taken
    bool in_doubt_ = false;
    bool left_ = false;
};

} // namespace ise
