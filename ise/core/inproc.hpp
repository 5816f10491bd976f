#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/result.hpp>
#include <ise/core/stream.hpp>

#include <map>
#include <memory>
#include <mutex>
#include <string>

namespace ise {

class inproc_acceptor;

/// The in-process names of one process: `inproc://name`. One for each environment; thread-safe. It may be
/// destroyed before the listeners and streams that it made.
class inproc_registry {
public:
    inproc_registry();
    ~inproc_registry();

    /// Connections that wait for `accept`; more are refused.
    static constexpr std::size_t backlog = 128;

    /// Called on `on`, where the listener and what it accepts are used.
    /// Errors: errc::address_in_use, errc::invalid_argument (an empty name).
    result<std::unique_ptr<listener>> listen(loop& on, const std::string& name);

    /// Called on `on`, where the stream is used; connected at once, bytes may be written before the other side
    /// has accepted. Errors: errc::unreachable (nobody listens), errc::overloaded (the backlog is full).
    result<std::unique_ptr<stream>> connect(loop& on, const std::string& name);

private:
    friend class inproc_acceptor;
    struct table {
        std::mutex mutex;
        std::map<std::string, std::weak_ptr<inproc_acceptor>> names;
    };
    std::shared_ptr<table> table_;
};

} // namespace ise
