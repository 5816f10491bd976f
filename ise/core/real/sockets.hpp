#pragma once
#include <ise/core/environment.hpp>
#include <ise/core/loop.hpp>

// The real transports behind the interfaces of core/stream.hpp; private to core/real.
namespace ise::real {

/// Tries all addresses of the host in turn. errc::unreachable says why each failed. Cancellation: terminal, returns
/// errc::cancelled and leaves nothing open.
task<result<std::unique_ptr<stream>>> connect_tcp(loop& on, endpoint to);
task<result<std::unique_ptr<stream>>> connect_local(loop& on, endpoint to); ///< the same with a local socket
/// Why a connection was not made; what this process itself lacks comes with what to do.
failure connect_failure(const endpoint& to, const std::error_code& why);
result<std::unique_ptr<listener>> listen_tcp(loop& on, const endpoint& at);
result<std::unique_ptr<listener>> listen_local(loop& on, const endpoint& at);
result<std::unique_ptr<datagram_socket>> open_udp(loop& on, const endpoint& at);
result<std::unique_ptr<stream>> open_serial(loop& on, const serial_options& options);
result<pseudo_terminal> open_pseudo_terminal(loop& on, const std::string& link);

} // namespace ise::real
