#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/bytes.hpp>
#include <ise/core/error.hpp>
#include <ise/core/time.hpp>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace ise {
class environment;
class shared_key;
namespace net::tls {
class identity;
struct subject;
} // namespace net::tls
} // namespace ise

namespace ise::net::udp {

/// When a side takes its next keys.
struct key_life {
    std::uint64_t datagrams = std::uint64_t{1} << 22; ///< far below what AES-GCM allows
    duration time = std::chrono::hours(1);
};

/// Seals the datagrams of one channel (FORMAT.md, section 18): first a handshake of TLS 1.3, by the shared key or by
/// certificates, then every datagram by keys of its exporter. Without I/O and without a clock.
class seal {
public:
    /// Datagrams of one flight: more than the longest chain of certificates takes.
    static constexpr std::size_t max_parts = 32;

    /// `calls`: of the side that opened the channel. `with` seals.
    static std::unique_ptr<seal> make(std::shared_ptr<const shared_key> with, bool calls, key_life keys = key_life());
    /// By certificates. `host`: that was dialled; empty: of the side that was called. Lifetime: `env` outlives it.
    static std::unique_ptr<seal> make(std::shared_ptr<tls::identity> with, environment& env, std::string host,
                                      key_life keys = key_life());
    virtual ~seal() = default;

    /// Takes a part of a flight of the peer, the body of a datagram; true: `flight()` is to be sent (again).
    virtual bool take_flight(bytes_view body) = 0;
    /// The last flight of this side, the bodies of its datagrams; empty: there is none.
    virtual std::span<const bytes> flight() const noexcept = 0;
    /// A flight of the peer came.
    virtual bool begun() const noexcept = 0;
    /// The peer has proved who it is, and there are keys for datagrams. Of the side that calls, with certificates: the
    /// other one may still refuse its own.
    virtual bool sealed() const noexcept = 0;
    /// Why there is no session.
    virtual const std::optional<failure>& trouble() const noexcept = 0;
    /// Whom the peer's certificate is about; null: it has shown none.
    virtual const tls::subject* shown() const noexcept = 0;
    /// Why a peer is refused whose stream begins so, without a seal.
    virtual failure stranger(std::string_view begin) const = 0;

    /// Seals a whole data datagram in place, which has room for the seal behind its number. `acked`: after the largest
    /// number of ours that the peer acknowledged. `sealed()` is required here and below.
    virtual void close(buffer& datagram, std::uint64_t acked, time_point now) = 0;
    /// The body of a data datagram, its number and its chunks, given all of it as it came; nothing where it is not from
    /// the peer. Valid until the next call.
    virtual std::optional<bytes_view> open(bytes_view datagram) = 0;

    /// A sign of life. Called from one thread at a time.
    virtual void put_sign(buffer& out, std::uint64_t to) = 0;
    /// Whether it is a new one of the peer, given all of it.
    virtual bool take_sign(bytes_view datagram) = 0;
};

} // namespace ise::net::udp
