#pragma once
#include <cstddef>
#include <map>
#include <set>
#include <string>

namespace ise {

namespace net {
class connection;
}

/// The sessions of a component whose peers do not read their replies, by host: a host gains no memory by many sessions.
class unread_replies {
public:
    /// Of one session, which are not counted.
    static constexpr std::size_t free_bytes = std::size_t{64} << 10;

    /// Bytes of all sessions of the host of `one`, which is one of them until it is forgotten.
    std::size_t with(net::connection& one);
    void forget(net::connection& one) noexcept;

private:
    std::map<std::string, std::set<net::connection*>, std::less<>> by_host_;
};

} // namespace ise
