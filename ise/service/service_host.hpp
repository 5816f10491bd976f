#pragma once
#include <ise/core/environment.hpp>
#include <ise/core/log.hpp>
#include <ise/core/log_limiter.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/net/fair_places.hpp>
#include <ise/net/handshake.hpp>
#include <ise/net/security.hpp>
#include <ise/net/udp/cookie.hpp>
#include <ise/service/dispatcher.hpp>
#include <ise/service/link.hpp>
#include <ise/service/reply_window.hpp>
#include <ise/service/schema_book.hpp>
#include <ise/service/service_options.hpp>
#include <ise/service/use_book.hpp>

#include <array>
#include <deque>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

namespace ise {

/// What happened on all sessions of a component since it began.
struct service_counts {
    std::uint64_t calls_served = 0;
    std::uint64_t calls_refused = 0;      ///< expired, unknown, mismatched or beyond a limit
    std::uint64_t calls_expired = 0;      ///< of these: their deadline came before a handler was free
    std::uint64_t calls_overloaded = 0;   ///< of these: beyond a limit
    std::uint64_t packets_published = 0;
    std::uint64_t packets_dropped = 0;    ///< by the policies of slow subscribers
    std::uint64_t sessions_accepted = 0;
    std::uint64_t sessions_rejected = 0;

    /// A call was not begun.
    void refused(errc why) noexcept {
        ++calls_refused;
        if (why == errc::timed_out) ++calls_expired;
        if (why == errc::overloaded) ++calls_overloaded;
    }
};

/// What a peer can cause as often as it likes: each kind is logged at a bounded rate.
enum class peer_trouble : std::uint8_t {
    accepting, ///< no descriptors left, or the like
    crowded,   ///< too many strangers at once
    rejected,  ///< a peer in good order that is not wanted here, or went
    handshake, ///< a stranger who does not greet as he should
    broken,    ///< a session ended because the peer broke a rule, or a limit
    mismatch,  ///< types that do not fit
    callback,  ///< the user's own code threw
    handler,   ///< the same, while it answered a call
    over,      ///< a subscription of ours ended other than by our wish
    excess,    ///< a peer in good order that asks for more than it may have
};
/// What a peer in good order does not cause.
constexpr bool broke_rules(errc cause) noexcept {
    return cause == errc::protocol_error || cause == errc::malformed || cause == errc::too_large || cause == errc::overloaded;
}
inline constexpr std::size_t peer_troubles = 10; ///< how many kinds there are

/// The services of one component: what it provides, whom it talks to. Everything on the component's loop.
/// Lifetime: `stop()` and join the scope before destroying it.
class service_host final {
public:
    service_host(environment& env, loop& on, task_scope& scope, wire::identity self, service_options options, logger log,
                 security credentials = security());
    ~service_host();

    environment& env() noexcept { return env_; }
    loop& on() noexcept { return on_; }
    task_scope& scope() noexcept { return scope_; }
    dispatcher& services() noexcept { return dispatcher_; }
    schema_book& schemas() noexcept { return schemas_; }
    call_desk& calls() noexcept { return calls_; }
    const service_options& options() const noexcept { return options_; }
    /// What is shown to peers, and demanded of them.
    const security& credentials() const noexcept { return credentials_; }
    const logger& log() const noexcept { return log_; }
    /// Logs what a peer caused; lines left out are counted in the next of that kind.
    void tell(peer_trouble kind, std::string_view what, std::string_view peer);
    service_counts& counts() noexcept { return counts_; }
    /// A subscription that ended other than by its subscriber's wish, and was not made again since.
    struct ended_subscription {
        std::string service, provider, cause;
    };
    /// The last ones, oldest first.
    const std::deque<ended_subscription>& ended_subscriptions() const noexcept { return ended_subscriptions_; }
    void on_subscription_ended(const std::string& service, const std::string& provider, const failure& why);
    void on_subscribed(const std::string& service, const std::string& provider);
    /// What it uses of others, and waits for.
    use_book& uses() noexcept { return uses_; }
    const use_book& uses() const noexcept { return uses_; }
    /// Those that live.
    template <class Look>
    void for_each_link(Look look) const {
        for (const auto& [name, known] : links_)
            if (auto held = known.lock()) look(std::as_const(*held));
    }
    /// Of all of its connections; for another thread, for as long as that likes.
    const std::shared_ptr<net::vital_signs_list>& signs() const noexcept { return signs_; }

    const wire::identity& self() const noexcept { return self_; }
    void set_epoch(std::uint64_t epoch) noexcept { self_.epoch = epoch; }

    /// Listens and accepts sessions. errc::address_in_use and others as environment::listen, errc::unauthorized where credentials
    /// are demanded and there are none for `at`.
    result<endpoint> listen(const endpoint& at);
    /// Where it listens, with real ports.
    std::vector<endpoint> listening() const;
    /// Further endpoints that peers may have dialled: those of tunnels and address translations that lead here. With a shared
    /// key, sessions that were dialled elsewhere are refused as relayed.
    void advertise(std::vector<endpoint> through) { advertised_ = std::move(through); }

    /// The link to a path or an endpoint; one for all who talk to it, and to a role in the same way.
    std::shared_ptr<link> link_to(const std::string& path, role_options how = role_options());
    /// `path`: of the component that is to answer there; empty: whoever listens.
    std::shared_ptr<link> link_to(const endpoint& at, const std::string& path = std::string());
    void use_resolver(std::shared_ptr<ise::resolver> names) { resolver_ = std::move(names); }
    ise::resolver* resolver() noexcept { return resolver_.get(); }

    /// Where the numbers of a link's calls begin: no two links of this component share any.
    std::uint64_t next_call_range() noexcept { return (++call_ranges_ << 40) + 1; }
    /// What was answered to clients that may ask again.
    ise::reply_windows& reply_windows() noexcept { return reply_windows_; }

    /// Runs a fresh connection as a session.
    std::shared_ptr<session> run(std::shared_ptr<net::connection> connection, std::weak_ptr<link> owner);
    void forget(session& ended);
    const std::map<session*, std::shared_ptr<session>>& sessions() const noexcept { return sessions_; }
    /// A hello of ours to whoever listens.
    wire::hello greeting() const;
    /// A hello of ours to who is meant to listen at `at`; `connected` is that as a numeric address, where it has one.
    wire::hello greeting_to(const location& whom, const endpoint& at, const std::string& connected);

    /// Says goodbye on every session, stops listening and serving. What was read is answered for at most `grace`.
    void stop(duration grace);
    bool stopping() const noexcept { return stopping_; }

    /// Completes once no session is left, or at `limit`. Cancellation: nothing is lost.
    task<> sessions_ended(time_point limit);

    /// Ends every session and makes none until `go_on()`: what is provided changes hands. Peers come back by themselves.
    void pause(const failure& why, duration grace);
    void go_on() noexcept { paused_.reset(); }

private:
    std::uint64_t reply_key_for(const location& whom, const endpoint& at);
    class door; // for one stranger
    struct session_places { // null: it needs none
        std::unique_ptr<net::fair_places::place> socket, session;
    };
    /// `into`: the places of the session that is to be made.
    result<wire::welcome> admit(const wire::hello& caller, const std::string& peer, protocol over, session_places& into);
    /// A place among `all` for one more session of that peer.
    result<std::unique_ptr<net::fair_places::place>> place_for(const std::string& peer, net::fair_places& all) const;
    std::string session_limit(const net::fair_places& all) const;
    /// It keeps them for as long as it lives, or until another host needs one.
    void keep_places(const std::shared_ptr<session>& of, const std::string& peer, session_places held);
    task<> accept(std::shared_ptr<listener> from);
    using handshake_place = std::shared_ptr<net::fair_places::place>;
    task<> greet(std::unique_ptr<stream> stranger, endpoint reached, handshake_place place);

    environment& env_;
    loop& on_;
    task_scope& scope_;
    wire::identity self_;
    service_options options_;
    logger log_;
    schema_book schemas_;
    std::shared_ptr<ise::resolver> resolver_; // before the calls, whose links speak to it when they go
    use_book uses_;
    call_desk calls_;
    dispatcher dispatcher_;
    service_counts counts_;
    std::shared_ptr<net::vital_signs_list> signs_ = std::make_shared<net::vital_signs_list>();
    std::vector<std::shared_ptr<listener>> listeners_;
    std::map<std::string, std::weak_ptr<link>> links_;
    std::map<session*, std::shared_ptr<session>> sessions_;
    net::fair_places places_;                 // of sessions that other processes made
    std::optional<net::fair_places> sockets_; // of those that have a descriptor each; once it listens for such
    std::map<session*, session_places> held_places_;
    std::vector<waiter<>*> awaiting_sessions_end_;
    net::fair_places handshakes_;
    std::size_t greeting_ = 0; // coroutines: those that lost their place and are on their way out included
    std::array<log_limiter, peer_troubles> troubles_;
    std::vector<endpoint> advertised_;
    std::deque<ended_subscription> ended_subscriptions_;
    std::uint64_t call_ranges_ = 0;
    std::optional<net::udp::secret> reply_secret_; // once a session over udp was made
    ise::reply_windows reply_windows_;
    std::optional<failure> paused_;
    bool stopping_ = false;
    security credentials_;
};

} // namespace ise
