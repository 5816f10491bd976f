#pragma once
/// The names of Asio that ISE's headers mention: including them costs no header of Asio.

namespace asio {
class any_io_executor;
class const_buffer;
class mutable_buffer;
} // namespace asio

namespace ise::detail {

/// The part of functions with a completion token or an executor that needs Asio; <ise/asio.hpp> defines it.
template <class Given>
struct asio_edge;

} // namespace ise::detail
