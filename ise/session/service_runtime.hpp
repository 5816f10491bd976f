#pragma once
#include <ise/core/environment.hpp>
#include <ise/core/log.hpp>
#include <ise/core/log_limiter.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/core/time.hpp>
#include <ise/net/heartbeats.hpp>
#include <ise/session/host_memory.hpp>
#include <ise/session/schema_cache.hpp>
#include <ise/session/service_options.hpp>
#include <ise/wire/messages.hpp>

#include <array>
#include <deque>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace ise {

namespace access {
class guard;
}

/// What happened on all sessions of a component since it began.
struct service_counts {
    std::uint64_t calls_served = 0;
    std::uint64_t calls_refused = 0;    ///< expired, unknown, mismatched or beyond a limit
    std::uint64_t calls_expired = 0;    ///< of these: their deadline came before a handler was free
    std::uint64_t calls_overloaded = 0; ///< of these: beyond a limit
    std::uint64_t packets_published = 0;
    std::uint64_t packets_dropped = 0; ///< by the policies of slow subscribers
    std::uint64_t packets_received = 0;
    std::uint64_t packets_lost = 0; ///< of subscriptions of this side: dropped on the way, at the provider or here
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
    return cause == errc::protocol_error || cause == errc::malformed || cause == errc::too_large ||
           cause == errc::overloaded;
}
inline constexpr std::size_t peer_troubles = 10; ///< how many kinds there are

/// What everything that serves one component shares: where it runs, who it is, its limits, its log and its counts. It
/// knows nothing of sessions, calls or subscriptions. Everything on the component's loop.
class service_runtime {
public:
    service_runtime(environment& env, loop& on, task_scope& scope, wire::identity self, service_options options,
                    logger log);
    service_runtime(const service_runtime&) = delete;
    service_runtime& operator=(const service_runtime&) = delete;

    environment& env() const noexcept { return env_; }
    loop& on() const noexcept { return on_; }
    task_scope& scope() const noexcept { return scope_; }
    const service_options& options() const noexcept { return options_; }
    const logger& log() const noexcept { return log_; }
    service_counts& counts() noexcept { return counts_; }
    /// What is known of packets: of this component's own, and what peers have told.
    schema_cache& schemas() noexcept { return schemas_; }
    /// Sessions that have to do with it keep it.
    const std::shared_ptr<host_memory>& hosts() const noexcept { return hosts_; }

    const wire::identity& self() const noexcept { return self_; }
    void set_epoch(std::uint64_t epoch) noexcept { self_.epoch = epoch; }
    /// What packets bear as the time of their publication: the wall clock, read once a turn.
    wall_time publication_time() {
        if (const auto turn = on_.now(); turn != stamped_in_) {
            stamped_in_ = turn;
            stamp_ = env_.wall();
        }
        return stamp_;
    }
    /// For people: its path in quotes, or "an unnamed component".
    std::string name_for_people() const;

    /// Logs what a peer caused; lines left out are counted in the next of that kind.
    void tell(peer_trouble kind, std::string_view what, std::string_view peer);

    /// Of all of its connections; for another thread, for as long as that likes.
    const std::shared_ptr<net::heartbeat_senders>& signs() const noexcept { return signs_; }

    /// A subscription that ended other than by its subscriber's wish, and was not made again since.
    struct ended_subscription {
        std::string service, provider, cause;
    };
    /// The last ones, oldest first.
    const std::deque<ended_subscription>& ended_subscriptions() const noexcept { return ended_subscriptions_; }
    void on_subscription_ended(const std::string& service, const std::string& provider, const failure& why);
    void on_subscribed(const std::string& service, const std::string& provider);

    /// The access policy; null: none, and everything is allowed.
    access::guard* access() const noexcept { return access_.get(); }
    /// The identity of this side's credentials; empty: none.
    const std::string& own_identity() const noexcept { return own_identity_; }
    /// The names under which it is found, as rules mean it: its path, then its roles.
    const std::vector<std::string>& titles() const noexcept { return titles_; }

    /// Nothing new begins.
    bool stopping() const noexcept { return stopping_; }

protected:
    ~service_runtime() = default;
    void use_access(std::shared_ptr<access::guard> policy, std::string own) {
        access_ = std::move(policy);
        own_identity_ = std::move(own);
    }
    void set_titles(std::vector<std::string> titles) { titles_ = std::move(titles); }
    /// False: it was stopping already.
    bool begin_stop() noexcept { return !std::exchange(stopping_, true); }

private:
    environment& env_;
    loop& on_;
    task_scope& scope_;
    wire::identity self_;
    service_options options_;
    logger log_;
    schema_cache schemas_;
    std::shared_ptr<host_memory> hosts_ = std::make_shared<host_memory>();
    service_counts counts_;
    std::shared_ptr<net::heartbeat_senders> signs_ = std::make_shared<net::heartbeat_senders>();
    std::array<log_limiter, peer_troubles> troubles_;
    std::deque<ended_subscription> ended_subscriptions_;
    time_point stamped_in_ = time_point::min(); // the turn in which stamp_ was read
    wall_time stamp_{};
    std::shared_ptr<access::guard> access_;
    std::string own_identity_;
    std::vector<std::string> titles_;
    bool stopping_ = false;
};

} // namespace ise
