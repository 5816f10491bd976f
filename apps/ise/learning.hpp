#pragma once
#include "survey.hpp"

#include <ise/access/policy.hpp>

#include <compare>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

namespace ise::cli {

/// Something that an access policy has to allow, as it was used.
struct learned {
    std::string who; ///< a verified identity; empty: nobody
    access::action what = access::action::call;
    std::string path;          ///< of the component; role: the role
    std::string item;          ///< call, subscribe: the service
    std::int32_t priority = 0; ///< role

    auto operator<=>(const learned&) const = default;
};

struct learned_outcome {
    std::map<learned, std::set<std::string>> needed; ///< with where it was seen, for people
    std::vector<std::string> unknown;                ///< uses of which something could not be seen, in order
    std::set<std::string> lookers;                   ///< identities of commands that looked at the system
};

/// What is used in a running system, gathered from looks at it. A component tells per session what it uses of its peer,
/// and the peer tells which identity it has verified there: both together are what an access policy decides about.
class learning {
public:
    /// `all`: everybody who is registered, and the name server under its path. `seen_here`: the identities of
    /// components as the sessions of the one who looks have verified them.
    void look(const std::vector<surveyed>& all, const std::map<std::string, std::set<std::string>>& seen_here);
    learned_outcome outcome() const;

    std::size_t looks() const noexcept { return looks_; }
    /// Registered ones that were seen at all.
    std::size_t components() const noexcept;

private:
    struct provided_service {
        std::uint8_t kind = 0;
        bool used = false; // by whomever: called, or subscribed to at a look
    };
    struct seen_component {
        bool registered = false, answered = false;
        std::pair<std::string, std::uint64_t> process; // its host and number
        std::map<std::string, provided_service> provides;
        std::map<std::string, std::uint8_t> requires_;
        std::map<std::string, std::int32_t> roles;
        std::map<std::string, std::set<std::string>> identities; // with the components that verified each
        std::set<std::string> at_name_server;                    // its identities there
        std::set<std::string> strangers;                         // identities of sessions with peers without a name
    };
    using use = std::tuple<std::string, std::string, std::string>; // user, provider, service

    void add_sessions(const surveyed& of, const std::map<std::string, const surveyed*>& by_path);
    std::set<std::string> registrars_of(const std::string& path) const;

    std::size_t looks_ = 0;
    std::map<std::string, seen_component> all_;
    std::map<use, std::set<std::string>> uses_;                 // with the user's identities at the provider
    std::set<std::pair<std::string, std::string>> within_;      // provider and service, used within a process
    std::map<std::string, std::set<std::string>> as_seen_here_; // identities by path
    std::set<std::string> lookers_;
};

/// What is told at the beginning of the file.
struct learned_head {
    std::string at;     ///< "2026-05-01T12:00:03Z"
    std::string length; ///< "10 min"
    std::size_t looks = 0, components = 0;
};

/// The smallest access.toml that allows what was seen; the same text for the same outcome. What cannot be written as a
/// pattern that means only itself is told in a comment.
std::string policy_text(const learned_outcome& of, const learned_head& head);

/// Whether a text can be part of a pattern, and means only itself.
bool fits_pattern(std::string_view text);

/// Why a text is not the policy of that outcome; empty: it can be used and allows everything that is needed.
std::string objection_to_policy(const std::string& text, const learned_outcome& of);

} // namespace ise::cli
