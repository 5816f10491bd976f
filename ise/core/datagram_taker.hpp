#pragma once
#include <ise/core/stream.hpp>

namespace ise {

/// Takes the datagrams of a socket.
class datagram_taker {
public:
    /// In a turn of the loop; `came` is valid until it returns. The socket may be closed meanwhile.
    virtual void take(const datagram& came) = 0;
    /// Receiving failed with an error of the system; the socket goes on. In a turn of the loop.
    virtual void on_trouble(std::error_code problem) = 0;

protected:
    ~datagram_taker() = default;
};

/// A `datagram_socket` that hands over what comes, without a coroutine that waits for each datagram. Those of the
/// environments do.
class datagram_source {
public:
    /// From now on, until `close`, each datagram goes to `taker`, which may own the socket; `receive` is not called any
    /// more. What is there already comes in a later turn.
    virtual void use(std::weak_ptr<datagram_taker> taker) = 0;

protected:
    ~datagram_source() = default;
};

} // namespace ise
