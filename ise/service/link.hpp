#pragma once
#include <ise/core/endpoint.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/task.hpp>
#include <ise/core/waiter.hpp>
#include <ise/service/back_off.hpp>
#include <ise/service/pending_call.hpp>
#include <ise/service/resolver.hpp>
#include <ise/service/role_choice.hpp>
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

/// The way to one component, found by name or by address, or to the peer of one session. It makes a session when
/// something wants one, keeps what waits meanwhile, and heals: a session that ended is made anew, with back-off and
/// jitter, as long as calls wait or subscriptions live. Calls that were never written move to the next session.
///
/// A role is served by several: the link talks to the best of them that it reaches, goes on with the next one when that is
/// lost, and comes back to a better one as `role_options` say. It moves when the new session is there; calls that were
/// written to the one before end there, subscriptions go on with a gap of unknown length.
class link : public std::enable_shared_from_this<link> {
public:
    /// To whoever holds `path`, or to that component at `fixed`, where an empty path is whoever listens.
    link(service_host& host, std::string path, std::optional<endpoint> fixed, role_options how = role_options());
    /// Back to the peer of a session that it made.
    link(service_host& host, const std::shared_ptr<session>& peer);
    ~link();

    /// Starts a call. Its outcome comes later, even on refusal.
    void submit(pending_call& call, outgoing_packet request);

    void attach(subscriber_core& subscriber);
    void detach(subscriber_core& subscriber) noexcept;

    /// Makes a session without a call; completes when it is there. errc::timed_out names the last obstacle.
    task<result<void>> connect(time_point deadline);

    /// Tries again sooner than the component's options say: for a provider that many depend on.
    void hurry(duration longest_pause, duration connect_time) noexcept;

    /// For people: the path, or the endpoint.
    const std::string& name() const noexcept { return name_; }
    const std::shared_ptr<session>& current() const noexcept { return session_; }
    /// The path of the component that it talks to now, of a role the member; empty without a session.
    std::string holder() const;
    service_host& host() noexcept { return host_; }

    // For sessions and the call desk.
    void on_session_end(session& ended, const failure& cause);
    void requeue(pending_call& call, kept_packet request);
    /// One that may have been executed, but can be sent again by its number.
    void repeat(pending_call& call);
    std::uint64_t next_call_number() noexcept { return next_call_number_++; }
    void forget(pending_call& call) noexcept;
    /// For the resolver: those who serve the role have changed.
    void on_members(const resolution& found);
    /// The component stops: what waits for a session has waited in vain.
    void stop();
    /// Whether it ends with the session it was made from.
    bool peer_only() const noexcept { return peer_only_; }
    /// Why there is no session, for the text of a call that waited in vain.
    std::string obstacle() const;
    std::size_t waiting_calls() const noexcept { return waiting_.size(); }
    std::size_t subscribers() const noexcept { return subscribers_.size(); }

private:
    friend struct let_go_of_link;
    friend held_link hold(const std::shared_ptr<link>& to);
    friend held_link hold(std::shared_ptr<link>&& to);
    bool wanted() const noexcept { return !waiting_.empty() || !subscribers_.empty() || connectors_ > 0; }
    void wake();
    static task<> maintain(std::shared_ptr<link> self);
    /// Between two tries; a long pause ends early when there is somebody new to try.
    task<> wait_before_next_try(duration pause);
    task<result<std::shared_ptr<session>>> establish();
    /// Tries the endpoints of one component in turn, each for `patience`, together until `until`.
    task<result<std::shared_ptr<session>>> reach(location where, duration patience, time_point until);
    void adopt(std::shared_ptr<session> made);
    void send_waiting();

    // A role's (link_role.cpp).
    struct role_state;
    void take_members(const resolution& found);
    void forget_role() noexcept;
    void consider_moving();
    static task<> move(std::shared_ptr<link> self);
    static task<> ask_about(std::shared_ptr<link> self, location unlisted);
    void switch_to(std::shared_ptr<session> made, const location& member);
    static task<> retire(std::shared_ptr<session> old);

    service_host& host_;
    std::string path_;
    std::optional<endpoint> fixed_;
    std::string name_;
    std::string obstacle_;
    std::shared_ptr<session> session_;
    std::list<pending_call*> waiting_;
    std::uint64_t next_call_number_;
    std::vector<subscriber_core*> subscribers_;
    std::vector<waiter<>*> arrivals_;
    role_options how_;
    std::unique_ptr<role_state> role_; // once the path is known to be a role
    back_off pause_;
    duration connect_time_;
    duration spread_;
    time_point since_{}; // the present session began
    std::uint64_t tried_life_ = 0; // the incarnation that was tried last; 0: nobody held the name
    int connectors_ = 0;
    std::size_t calls_ = 0; // that hold it
    std::shared_ptr<link> self_; // while there are any
    bool maintaining_ = false;
    bool moving_ = false;
    bool peer_only_ = false;
};

} // namespace ise
