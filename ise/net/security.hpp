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

/// Where the credentials of a node lie.
struct security_options {
    /// A file with the key that every node of the system has (`openssl rand -hex 32`). With it every session, over whichever
    /// transport, begins with a proof by both sides. Empty: ISE_KEY, else none.
    std::string key_file;
    /// A folder with ca.pem (authorities, and their revocation lists), certificate.pem and key.pem: what `tls://` takes.
    /// Empty: ISE_TLS, else none.
    std::string tls_folder;
    /// Listens beyond this host with a key or on `tls://` only. Also by ISE_DEMAND_CREDENTIALS=1.
    bool demanded = false;
};

/// The credentials of a node, loaded: what it shows, and what it demands of whoever it talks to.
struct security {
    std::shared_ptr<const shared_key> key;              ///< null: none is demanded, and none can be proved
    std::shared_ptr<net::tls::identity> tls;            ///< null: no tls:// endpoints
    bool demanded = false;                              ///< see security_options

    /// What `given` and the variables of `env` say. Errors: errc::unauthorized (a secret that others can read),
    /// errc::io_failed, errc::invalid_argument, each with the file.
    static result<security> load(environment& env, security_options given = security_options());

    /// Whether sessions that come to `at` have to prove something.
    bool protects(const endpoint& at) const noexcept;
    /// errc::unauthorized where credentials are demanded and a listener at `at` would have none.
    result<void> may_listen(const endpoint& at) const;
};

} // namespace ise
