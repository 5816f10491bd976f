#pragma once
#include <ise/core/endpoint.hpp>
#include <ise/core/error.hpp>
#include <ise/core/result.hpp>
#include <ise/transport/tls/subject.hpp>

#include <memory>
#include <optional>
#include <string>
#include <string_view>

struct ssl_st; // of OpenSSL
struct ssl_ctx_st;

namespace ise {
class environment;
class shared_key;
} // namespace ise

namespace ise::net::tls {

class identity;

/// What one end has learnt of the other's certificate. Lifetime: as long as the session of OpenSSL that was prepared
/// with it.
struct shown_certificate {
    std::string host;                 ///< that was dialled; empty: this side was called
    std::string authorities;          ///< the file with those that are believed here
    subject about;                    ///< the peer's, once its certificate was verified
    std::optional<failure> objection; ///< why it was not
};

/// How the ends of a session prove who they are.
class proof {
public:
    virtual ~proof() = default;

    /// What sessions are made with. Errors: as identity::context.
    virtual result<std::shared_ptr<ssl_ctx_st>> context() const = 0;
    /// Readies one end; the peer's certificate goes to `to`. False: OpenSSL has noted why not.
    virtual bool prepare(ssl_st* session, shown_certificate& to) const = 0;
    /// The handshake is over: why it proves nothing all the same.
    virtual std::optional<failure> missing(ssl_st*) const { return std::nullopt; }
    /// What the first failure that OpenSSL has noted means. Clears the notes. `scheme`: of endpoints with certificates
    /// over the same carrier, "tls" or "udp+tls".
    virtual failure noted(std::string_view scheme) const = 0;
    /// Why a peer is refused that begins a session so, by a frame without TLS.
    virtual failure stranger(std::string_view begin) const = 0;
    /// Whether such a peer is answered by a frame over a stream; otherwise by TLS. After `begin_bytes`.
    virtual bool answers_strangers() const { return false; }
    virtual std::string_view what_began() const = 0;
    /// The endpoint of this side, given that of the stream below.
    virtual std::optional<endpoint> local(std::optional<endpoint> below) const = 0;
};

/// Lifetime: `env` outlives it.
std::unique_ptr<proof> by_certificate(std::shared_ptr<identity> with, environment& env);
std::unique_ptr<proof> by_key(std::shared_ptr<const shared_key> with);

} // namespace ise::net::tls
