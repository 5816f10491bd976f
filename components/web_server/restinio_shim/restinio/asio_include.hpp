// Goes before RESTinio's header of the same name, in http_server.cpp only.
//
// RESTinio 0.6 uses three names that Asio deprecated, and ISE is built with ASIO_NO_DEPRECATED. Undefining that for
// one file is no way out: with ASIO_SEPARATE_COMPILATION it would call allocation and invocation hooks that Asio's
// own translation unit compiled as empty. So RESTinio's alias of Asio becomes a namespace that adds the names.
#pragma once
#define asio_ns plain_asio // the alias that RESTinio's own header makes
#include_next <restinio/asio_include.hpp>
#undef asio_ns

#include <string>

namespace restinio::asio_ns {
using namespace ::asio;

struct socket_base : ::asio::socket_base {
    static constexpr int max_connections = ::asio::socket_base::max_listen_connections;
};

template <class Pointer>
Pointer buffer_cast(const ::asio::const_buffer& buffer) noexcept {
    return static_cast<Pointer>(buffer.data());
}

namespace ip {
using namespace ::asio::ip;

class address : public ::asio::ip::address {
public:
    address() = default;
    address(const ::asio::ip::address& same) : ::asio::ip::address(same) {}
    static address from_string(const std::string& text) { return ::asio::ip::make_address(text); }
};
} // namespace ip

} // namespace restinio::asio_ns
