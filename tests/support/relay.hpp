#pragma once
#include <ise/core/environment.hpp>

#include <memory>

namespace ise_test {

/// A router between the requester and the provider, on a loop of the test: it passes on what comes, and is where the
/// faults of the way are made. Bytes for streams, datagrams for udp, in the real world and in the virtual one alike.
class relay {
public:
    /// Who calls `at` is passed on to `to`; of both only host and port, or path, count.
    static std::unique_ptr<relay> make(ise::environment& env, std::unique_ptr<ise::loop_host> host,
                                       const ise::endpoint& at, const ise::endpoint& to);
    virtual ~relay() = default;

    /// What the requester is to call.
    virtual ise::endpoint where() const = 0;

    /// Nothing passes and nobody is told: streams stall, datagrams vanish.
    virtual void hold() = 0;
    /// What stalled goes on.
    virtual void go_on() = 0;
    /// Of the conversations that are there nothing passes ever again, and nobody is told; others are not touched.
    virtual void swallow() = 0;
    /// It knows nothing any more of who talks to whom: streams break, datagrams go on from another address.
    virtual void forget() = 0;
    /// From now on datagrams are lost, doubled and overtaken by the next one, each in its turn. Of streams nothing is.
    virtual void roughen() = 0;

    /// Ends it; it may go once `ended()`.
    virtual void stop() = 0;
    virtual bool ended() const = 0;
};

} // namespace ise_test
