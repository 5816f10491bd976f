#pragma once
#include "odd/odd.hpp"
#include "sides.hpp"
#include "transports.hpp"

#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/local_sockets.hpp>
#include <support/party.hpp>

namespace conformance {

using ise_test::party;
using ise_test::start;
using ise_test::started;

/// What may happen to a session, by a script.
enum class fault {
    cut,       ///< the requester drops it
    reset,     ///< the provider does
    forgotten, ///< a router on the way knows nothing of it any more: streams break, datagrams come from elsewhere
    outage,    ///< nothing passes for less than it takes to miss the peer
    partition, ///< nothing passes until both sides have missed each other
    half_open, ///< of this session nothing passes ever again, and nobody is told; new ones are made
};
const char* name_of(fault what) noexcept;
/// Those that can be made over a transport. Within a process nothing lies between the two.
std::vector<fault> faults_over(const column& transport);

/// Changes the options of both components.
using tuning = std::function<void(ise::service_options&)>;

/// A provider "boat" that listens, and a requester "shore".
class pair {
public:
    explicit pair(world& over, const tuning& tune = {});
    ~pair();

    /// The provider listens, and the requester knows where; through a relay where faults of the way are to come.
    void open();
    void open_through_relay();

    /// Fails where it does not come to that.
    void run_until(const std::function<bool()>& done);
    template <class T>
    T run(ise::task<T> body) {
        auto state = start(shore.on, std::move(body));
        run_until([&] { return state->done; });
        if constexpr (std::is_void_v<T>) {
            state->get();
        } else {
            return std::move(state->get());
        }
    }

    /// The session as the requester has it, cut without a word.
    void cut();
    /// Makes a fault, and returns when it is over: the session has ended on both sides, unless it is one that may go
    /// on.
    void strike(fault what);
    /// The requester is out of reach from now on, or not any more.
    void part(bool apart) { over.part(*between, apart); }
    /// The provider is gone without a word; its next life, which provides nothing yet.
    side& next_life();
    /// And is reached where the one before was.
    void listen_again();

    world& over;
    const column& has = over.has;

private:
    side make(ise::environment& env, const char* path) const;
    ise::service_options options_;
    std::vector<ise::endpoint> advertised_;

public:
    side boat, shore;
    std::unique_ptr<side> reborn;
    std::unique_ptr<relay> between;
    ise::endpoint where; ///< of the provider
    ise::remote there;   ///< the provider, as the requester has it
};

/// The feature of this build or system that a transport lacks; empty: none.
template <class World>
std::string lacking() {
    constexpr auto among = []<class... Others>(std::type_identity<Others>...) {
        return (std::is_same_v<World, Others> || ...);
    };
    using std::type_identity;
    constexpr bool secret = among(type_identity<tls>(), type_identity<sealed_tcp>(), type_identity<sealed_local>(),
                                  type_identity<sealed_shm>(), type_identity<sealed_udp>(),
                                  type_identity<certified_udp>(), type_identity<virtual_tls>(),
                                  type_identity<virtual_sealed_udp>(), type_identity<virtual_certified_udp>());
    constexpr bool of_files =
        among(type_identity<local>(), type_identity<shm>(), type_identity<sealed_local>(), type_identity<sealed_shm>());
    if (secret && !ISE_CONFORMANCE_OPENSSL) return "this ISE was built without OpenSSL";
    if (of_files && !ise_test::has_local_sockets()) return "this system has no local sockets";
    return {};
}

/// Runs a check over a transport.
template <class World>
void over(const std::function<void(pair&)>& check, const tuning& tune = {}) {
    if (auto lacks = lacking<World>(); !lacks.empty()) return ise_test::skip(lacks);
    World where;
    pair at(where, tune);
    check(at);
}

} // namespace conformance

#define OVER_EVERY_TRANSPORT                                                                                   \
    tcp, tcp6, tls, udp, udp6, local, shm, sealed_tcp, sealed_local, sealed_shm, in_process, odd, virtual_tcp, \
        virtual_tls, virtual_udp, sealed_udp, virtual_sealed_udp, certified_udp, virtual_certified_udp, virtual_odd
#define OVER_DATAGRAMS udp, udp6, virtual_udp, sealed_udp, virtual_sealed_udp, certified_udp, virtual_certified_udp
