#pragma once
#include <ise/net/connection.hpp>

namespace ise {
class shared_key;
}

namespace ise::net {

/// Decides who may come in: looks at a hello and gives the welcome, or the failure that the peer is told.
class gatekeeper {
public:
    /// What was verified of the caller; comes before `admit`.
    virtual void note([[maybe_unused]] const verified_peer& caller) {}
    virtual result<wire::welcome> admit(const wire::hello& caller) = 0;

protected:
    ~gatekeeper() = default;
};

/// Greets the listener at the other end of a fresh stream. With a `key`, which outlives the handshake, both sides prove
/// that they know it, unless the stream is a `sealed_stream`, whose ends have done so. Errors: errc::timed_out at
/// `deadline`, what the peer rejects with (errc::wrong_peer, version_mismatch, unauthorized, overloaded…),
/// errc::unauthorized where it did not prove the key, errc::peer_lost, protocol_error. Cancellation: terminal; the
/// stream is closed.
task<result<std::shared_ptr<connection>>> initiate(loop& on, std::unique_ptr<stream> transport, wire::hello mine,
                                                   time_point deadline, const shared_key* key = nullptr);

/// Answers one who connected; the gatekeeper is asked once he has proved the `key`. Errors as above; one that is not
/// admitted was told so. `gate` and `key` outlive it. Cancellation: terminal; the stream is closed.
task<result<std::shared_ptr<connection>>> respond(loop& on, std::unique_ptr<stream> transport, gatekeeper& gate,
                                                  time_point deadline, const shared_key* key = nullptr);

} // namespace ise::net
