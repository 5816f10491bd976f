#pragma once
#include <ise/core/error.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/result.hpp>
#include <ise/core/stream.hpp>
#include <ise/transport/tls/identity.hpp>

#include <memory>

namespace ise {
class shared_key;
}

namespace ise::net::tls {

/// A stream in TLS over another one. It is of the memory BIOs of OpenSSL and not asio::ssl::stream, which can neither
/// write what goes at once without losing the rest, nor lie over a stream of the virtual world. Its verdict says why
/// there is no session, where credentials or TLS itself are the reason: of either side, or of what the peer said.
///
/// Of the side that was called: shakes hands in its first read.
std::unique_ptr<stream> answer(loop& on, std::unique_ptr<stream> below, std::shared_ptr<identity> with);

/// Of the side that calls `to`: shakes hands at once. Errors as transport::connect. Cancellation: terminal; the stream
/// is closed.
task<result<std::unique_ptr<stream>>> greet(loop& on, std::unique_ptr<stream> below, std::shared_ptr<identity> with,
                                            endpoint to);

/// The same with a shared key that seals, in the place of certificates: the streams are `sealed_stream`s, and keep the
/// name of their peer. A side that was called answers who comes without TLS by a reject (FORMAT.md, section 17).
std::unique_ptr<stream> answer(loop& on, std::unique_ptr<stream> below, std::shared_ptr<const shared_key> with);
/// Of the side that calls. Errors as transport::connect. Cancellation: terminal; the stream is closed.
task<result<std::unique_ptr<stream>>> greet(loop& on, std::unique_ptr<stream> below,
                                            std::shared_ptr<const shared_key> with, endpoint to);

} // namespace ise::net::tls
