#pragma once
#include <ise/core/environment.hpp>
#include <ise/core/log.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/net/handshake.hpp>
#include <ise/service/dispatcher.hpp>
#include <ise/service/link.hpp>
#include <ise/service/schema_book.hpp>

#include <map>
#include <memory>
#include <optional>
#include <string>

namespace ise {

/// What happened on all sessions of a component since it began.
struct service_counts {
    std::uint64_t calls_served = 0;
    std::uint64_t calls_refused = 0;      ///< expired, unknown, mismatched or beyond a limit
    std::uint64_t packets_published = 0;
    std::uint64_t packets_dropped = 0;    ///< by the policies of slow subscribers
    std::uint64_t sessions_accepted = 0;
    std::uint64_t sessions_rejected = 0;
};

struct service_options {
    wire::limits accepts;
    duration handshake_time = std::chrono::seconds(5);
    duration connect_time = std::chrono::seconds(5);
    duration first_back_off = std::chrono::milliseconds(50);
    duration longest_back_off = std::chrono::seconds(5);
    duration default_deadline = std::chrono::seconds(5); ///< of calls that give none
    duration linger = std::chrono::seconds(30);          ///< a vanished subscriber is kept for this long
    std::size_t max_sessions = 20'000;
    std::size_t max_handshakes = 256;                    ///< strangers at once
    std::uint32_t max_calls_per_session = 4096;          ///< served at once for one peer
    std::uint32_t max_subscriptions_per_session = 1024;
    std::size_t max_unsent_bytes = 64u << 20;            ///< of calls and replies on one session; more are overloaded
};

/// The services of one component: what it provides, whom it talks to. Everything on the component's loop.
/// Lifetime: `stop()` and join the scope before destroying it.
class service_host final : public net::gatekeeper {
public:
    service_host(environment& env, loop& on, task_scope& scope, wire::identity self, service_options options, logger log);
    ~service_host();

    environment& env() noexcept { return env_; }
    loop& on() noexcept { return on_; }
    task_scope& scope() noexcept { return scope_; }
    dispatcher& services() noexcept { return dispatcher_; }
    schema_book& schemas() noexcept { return schemas_; }
    call_desk& calls() noexcept { return calls_; }
    const service_options& options() const noexcept { return options_; }
    const logger& log() const noexcept { return log_; }
    service_counts& counts() noexcept { return counts_; }

    const wire::identity& self() const noexcept { return self_; }
    void set_epoch(std::uint64_t epoch) noexcept { self_.epoch = epoch; }

    /// Listens and accepts sessions. errc::address_in_use and others as environment::listen.
    result<endpoint> listen(const endpoint& at);
    /// Where it listens, with real ports.
    std::vector<endpoint> listening() const;

    /// The link to a path or an endpoint; one for all who talk to it.
    std::shared_ptr<link> link_to(const std::string& path);
    std::shared_ptr<link> link_to(const endpoint& at);
    void use_resolver(std::shared_ptr<ise::resolver> names) { resolver_ = std::move(names); }
    ise::resolver* resolver() noexcept { return resolver_.get(); }

    /// Runs a fresh connection as a session.
    std::shared_ptr<session> run(std::shared_ptr<net::connection> connection, std::weak_ptr<link> owner);
    void forget(session& ended);
    const std::map<session*, std::shared_ptr<session>>& sessions() const noexcept { return sessions_; }
    /// A hello of ours.
    wire::hello greeting() const;

    /// Says goodbye on every session, stops listening and serving. What was read is answered for at most `grace`.
    void stop(duration grace);
    bool stopping() const noexcept { return stopping_; }

    /// Ends every session and makes none until `go_on()`: what is provided changes hands. Peers come back by themselves.
    void pause(const failure& why, duration grace);
    void go_on() noexcept { paused_.reset(); }

private:
    result<wire::welcome> admit(const wire::hello& caller) override;
    task<> accept(std::shared_ptr<listener> from);
    task<> greet(std::unique_ptr<stream> stranger);

    environment& env_;
    loop& on_;
    task_scope& scope_;
    wire::identity self_;
    service_options options_;
    logger log_;
    schema_book schemas_;
    call_desk calls_;
    dispatcher dispatcher_;
    service_counts counts_;
    std::shared_ptr<ise::resolver> resolver_;
    std::vector<std::shared_ptr<listener>> listeners_;
    std::map<std::string, std::weak_ptr<link>> links_;
    std::map<session*, std::shared_ptr<session>> sessions_;
    std::size_t handshakes_ = 0;
    std::optional<failure> paused_;
    bool stopping_ = false;
};

} // namespace ise
