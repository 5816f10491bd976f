#pragma once
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <string>

namespace ise {

namespace net {
class connection;
}

/// Memory that the sessions of a component hold for their peers, by host: a host gains none by opening many sessions,
/// whatever name each gives itself.
class host_memory {
public:
    /// A session that holds no more is not counted.
    static constexpr std::size_t free_bytes = std::size_t{64} << 10;

    struct held {
        std::uint64_t unread_replies = 0;      ///< that wait to be sent
        std::uint64_t unfinished_messages = 0; ///< of which a part has come
    };
    /// By all sessions of the host of `one`, which is one of them until it is forgotten.
    held with(net::connection& one);
    void forget(net::connection& one) noexcept;

private:
    std::map<std::string, std::set<net::connection*>, std::less<>> by_host_;
};

} // namespace ise
