#pragma once
#include <ise/core/environment.hpp>
#include <ise/core/result.hpp>

#include <memory>
#include <string>

namespace ise {

class shared_key;
namespace net::tls {
class identity;
}
namespace access {
class guard;
}

/// The files with the credentials of a node.
struct security_options {
    /// A file with the key that every node of the system has (`openssl rand -hex 32`). With it every session, over
    /// every transport, begins with a proof by both sides. Empty: ISE_KEY, else no key.
    std::string key_file;
    /// A folder with ca.pem (authorities, and their revocation lists), certificate.pem and key.pem, for `tls://`.
    /// Empty: ISE_TLS, else no certificates.
    std::string tls_folder;
    /// A file with the access policy (docs/access.md). Empty: ISE_ACCESS, else no policy, and nothing is refused.
    std::string access_file;
    /// A file that gets a line of JSON for each refusal and each change that the policy lets happen. Empty: ISE_AUDIT,
    /// else none.
    std::string audit_file;
    /// Refuses to listen beyond this host, except with a key or on `tls://`. Also set by ISE_DEMAND_CREDENTIALS=1.
    bool demanded = false;
};

/// The loaded credentials of a node, and whether it demands credentials of peers.
struct security {
    std::shared_ptr<const shared_key> key;   ///< null: no shared key
    std::shared_ptr<net::tls::identity> tls; ///< null: no tls:// endpoints
    bool demanded = false;                   ///< see security_options
    std::shared_ptr<access::guard> access;   ///< null: no access policy
    std::string own;                         ///< the identity that this node's credentials give it; empty: none

    /// Loads the files named in `given` and in the variables of `env`. Errors: errc::unauthorized (other users can read
    /// a secret, or change the policy), errc::io_failed, errc::invalid_argument, each with the file.
    static result<security> load(environment& env, security_options given = security_options());

    /// Whether sessions at `at` are authenticated.
    bool protects(const endpoint& at) const noexcept;
    /// errc::unauthorized if credentials are demanded and a listener at `at` would have none.
    result<void> may_listen(const endpoint& at) const;
};

} // namespace ise
