#pragma once
#include <ise/component/parameter.hpp>
#include <ise/core/endpoint.hpp>

#include <string>
#include <vector>

namespace ise::instantiation {

/// What those who start components may choose, beside what a type declares. Errors: errc::invalid_argument says what is
/// allowed.
struct launch_rules {
    std::vector<std::string> listen_addresses{"127.0.0.1", "::1"}; ///< where components may listen: tcp, udp and tls
    std::vector<std::string>
        target_hosts; ///< whom parameters may let them connect to: "gateway.example", "10.0.0.7:7411"
    std::vector<std::string> path_folders; ///< parameters of the kind `path` lie below one of these
    std::size_t max_arguments = 256;
    bool has_certificates = false;  ///< what is started gets them: tls endpoints are possible
    std::string identities_folder;  ///< below it lie folders with certificates of components; empty: there are none
    std::vector<std::string> users; ///< as whom components may run, beside the server's own user
    bool as_root = false;           ///< whether they may run as root

    /// Whether a component may listen there.
    result<endpoint> may_listen(const std::string& text) const;
    /// Whether a component that listens on these endpoints may have a health probe at that address: one of them, or a
    /// host that parameters may name.
    result<void> may_probe(const endpoint& at, const std::vector<endpoint>& listen) const;
    /// Whether a parameter may have a value that `ise::check` let pass: by its kind, for all that names something
    /// outside the component. A URL in a text counts as one, and a file that a URL of PostgreSQL names as a path.
    result<void> may_be(const parameter& of, const std::string& value) const;
};

} // namespace ise::instantiation
