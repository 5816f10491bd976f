#pragma once
#include <ise/access/pattern.hpp>
#include <ise/core/result.hpp>
#include <ise/core/verified_peer.hpp>

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace ise::access {

/// What somebody may want.
enum class action : std::uint8_t {
    call,      ///< a request-response service of a component
    subscribe, ///< a subscription service of a component
    read,      ///< what a component tells of itself: services, sessions, load, parameters, output
    name,      ///< to be found under a path
    role,      ///< to serve a role, with a priority
    set,       ///< a parameter of a component
    start,     ///< a component of a type, on a host, under a path
    stop,      ///< a component on a host
    look_up,   ///< of the name server: for whoever any rule allows anything
};
inline constexpr std::size_t actions = 9; ///< how many there are

/// "call", "subscribe"…, as in the file and on the command line.
std::string_view name_of(action what) noexcept;
/// errc::invalid_argument names those that there are.
result<action> parse_action(std::string_view text);

/// What is wanted. Borrowed: lives as long as the call that it is passed to.
struct request {
    action what = action::call;
    /// call, subscribe, read, set: the component's path and its roles. name, start, stop: the path. role: the role.
    std::span<const std::string> targets;
    std::string_view item;     ///< call, subscribe: the service; set: the parameter, empty: any of them
    std::string_view host;     ///< start, stop: "shore"
    std::string_view type;     ///< start, stop: of the component; empty: any of them
    std::int32_t priority = 0; ///< role
    std::string_view identity; ///< start: of the component itself; empty: that of its host
    std::string_view user;     ///< start: of the operating system; empty: that of the instantiation server
    bool any_path = false;     ///< start, stop, set: whether any path would be allowed
};

/// "call atirma/communication:telecommand", as `ise access why` takes it.
std::string text_of(const request& what);

/// What a policy says to a request.
struct verdict {
    bool allowed = false;
    bool denied = false;    ///< by a rule; else no rule allows it
    std::uint32_t line = 0; ///< of the rule that decided, in the file; 0: none
};

/// A pattern of identities.
struct subject {
    pattern of;
    bool nobody = false; ///< those without an identity, whom no wildcard means
};

/// `PATH:ITEM`.
struct target {
    pattern path, item;
    std::uint32_t line = 0;
};
struct place {
    pattern path;
    std::uint32_t line = 0;
};
struct role_grant {
    pattern role;
    std::optional<std::int32_t> max_priority;
    std::uint32_t line = 0;
};
struct host_grant {
    pattern host;
    bool start = false, stop = false;
    std::optional<pattern> type, path;
    std::optional<pattern> identity, user; ///< without them an [[allow]] means none of its own, a [[deny]] any
    std::uint32_t line = 0;
};

/// An [[allow]] or [[deny]] of the file.
struct rule {
    bool allows = true;
    std::uint32_t line = 0;
    std::vector<subject> who;
    std::vector<target> call, subscribe, set;
    std::vector<place> read, name;
    std::vector<role_grant> roles;
    std::vector<host_grant> hosts;

    bool means(std::string_view identity) const noexcept;
};

class policy;

/// A policy as it is for one identity: which rules are about it is looked up once. Keeps the policy.
class view {
public:
    view(std::shared_ptr<const policy> of, std::string_view identity);

    verdict decide(const request& what) const noexcept;
    const std::shared_ptr<const policy>& of() const noexcept { return of_; }

private:
    std::shared_ptr<const policy> of_;
    std::vector<const rule*> allow_, deny_;
};

/// What is wrong with a file, or odd about it.
struct remark {
    std::uint32_t line = 0, column = 0; ///< 0: of the whole file
    std::string text;
};

/// An access policy: the content of access.toml (docs/access.md). Nothing is allowed that no rule allows, and what a
/// rule denies no other allows. Immutable.
class policy {
public:
    static constexpr std::size_t max_bytes = 1u << 20;
    static constexpr std::size_t max_rules = 4096;

    /// Null, with what is wrong in `problems`; each has a line.
    static std::shared_ptr<const policy> parse(const std::string& text, const std::string& file,
                                               std::vector<remark>& problems);

    const std::string& file() const noexcept { return file_; }
    /// Of the content, sixteen hexadecimal digits.
    const std::string& hash() const noexcept { return hash_; }
    /// The system whose shared key is meant by `ise://SYSTEM/key`.
    const std::string& system() const noexcept { return system_; }
    const std::vector<rule>& rules() const noexcept { return rules_; }
    /// The identity of a user of this host; empty: none of its own.
    std::string_view identity_of_user(std::uint32_t user) const noexcept;
    /// Whether each use of this service belongs into the audit log.
    bool audited(std::span<const std::string> targets, std::string_view service) const noexcept;
    verdict decide(std::string_view identity, const request& what) const;

private:
    friend class policy_reader;

    std::string file_, hash_, system_;
    std::vector<rule> rules_;
    std::map<std::uint32_t, std::string> users_;
    std::vector<target> audited_;
};

/// Which request the use of a service is: those of ISE itself ("ise.…") have rules of their own.
request request_for(bool subscription, std::span<const std::string> targets, std::string_view service) noexcept;

/// The identity that what was verified comes to. `own`: that of this side's own credentials, which is that of its
/// process; `by`: null where there is no policy.
std::string identity_of(const verified_peer& peer, const std::string& own, const policy* by);

/// The identity for people: "nobody" where there is none.
std::string_view shown(std::string_view identity) noexcept;

/// errc::invalid_argument where a text is not an identity of a certificate: `ise://SYSTEM/NAME`.
result<void> check_identity(std::string_view text);

} // namespace ise::access
