#pragma once
#include <ise/core/function_ref.hpp>
#include <ise/core/endpoint.hpp>
#include <ise/core/task.hpp>
#include <ise/core/waiter.hpp>
#include <ise/service/back_off.hpp>
#include <ise/service/pending_call.hpp>
#include <ise/wire/messages.hpp>

#include <list>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ise {

class service_host;
class session;
class subscriber_core;

/// Where a component is reached, and which life of it.
struct location {
    std::string path;                 ///< empty: whoever listens there
    std::vector<endpoint> endpoints;  ///< nearest first
    std::uint64_t epoch = 0;          ///< 0: any
    std::uint64_t incarnation = 0;    ///< 0: any
};

/// Finds components by path. The name client is one; a fixed endpoint is another.
class resolver {
public:
    /// errc::no_such_name if nobody holds the path now, errc::name_server_lost if nobody can say.
    /// Cancellation: terminal.
    virtual task<result<location>> resolve(std::string path) = 0;
    /// The same, waiting until somebody holds it, at most until `deadline`.
    virtual task<result<location>> resolve_when_present(std::string path, time_point deadline) = 0;

protected:
    ~resolver() = default;
};

/// The way to one component, found by name or by address, or to the peer of one session. It makes a session when
/// something wants one, keeps what waits meanwhile, and heals: a session that ended is made anew, with back-off and
/// jitter, as long as calls wait or subscriptions live. Calls that were never written move to the next session.
class link : public std::enable_shared_from_this<link> {
public:
    /// To whoever holds `path`, or listens at `fixed`.
    link(service_host& host, std::string path, std::optional<endpoint> fixed);
    /// Back to the peer of a session that it made.
    link(service_host& host, const std::shared_ptr<session>& peer);
    ~link();

    /// Starts a call: `write_request` appends the request packet. Its outcome comes later, even on refusal.
    void submit(pending_call& call, function_ref<void(buffer&)> write_request);

    void attach(subscriber_core& subscriber);
    void detach(subscriber_core& subscriber) noexcept;

    /// Makes a session without a call; completes when it is there. errc::timed_out names the last obstacle.
    task<result<void>> connect(time_point deadline);

    /// Tries again sooner than the component's options say: for a provider that many depend on.
    void hurry(duration longest_pause, duration connect_time) noexcept;

    /// For people: the path, or the endpoint.
    const std::string& name() const noexcept { return name_; }
    const std::shared_ptr<session>& current() const noexcept { return session_; }
    service_host& host() noexcept { return host_; }

    // For sessions and the call desk.
    void on_session_end(session& ended, const failure& cause);
    void requeue(pending_call& call, bytes_view request);
    void forget(pending_call& call) noexcept;
    /// The component stops: what waits for a session has waited in vain.
    void stop();
    /// Whether it ends with the session it was made from.
    bool peer_only() const noexcept { return peer_only_; }
    /// Why there is no session, for the text of a call that waited in vain.
    const std::string& obstacle() const noexcept { return obstacle_; }
    std::size_t waiting_calls() const noexcept { return waiting_.size(); }
    std::size_t subscribers() const noexcept { return subscribers_.size(); }

private:
    bool wanted() const noexcept { return !waiting_.empty() || !subscribers_.empty() || connectors_ > 0; }
    void wake();
    static task<> maintain(std::shared_ptr<link> self);
    task<result<std::shared_ptr<session>>> establish();
    void adopt(std::shared_ptr<session> made);

    service_host& host_;
    std::string path_;
    std::optional<endpoint> fixed_;
    std::string name_;
    std::string obstacle_;
    std::shared_ptr<session> session_;
    std::list<pending_call*> waiting_;
    std::vector<subscriber_core*> subscribers_;
    std::vector<waiter<>*> arrivals_;
    back_off pause_;
    duration connect_time_;
    time_point since_{}; // the present session began
    int connectors_ = 0;
    bool maintaining_ = false;
    bool peer_only_ = false;
};

} // namespace ise
