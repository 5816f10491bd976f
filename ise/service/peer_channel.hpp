#pragma once
#include <ise/core/endpoint.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/task.hpp>
#include <ise/core/waiter.hpp>
#include <ise/service/back_off.hpp>
#include <ise/service/resolver.hpp>
#include <ise/service/role_options.hpp>
#include <ise/service/session.hpp>
#include <ise/service/use_book.hpp>

#include <asio/any_io_executor.hpp>

#include <memory>
#include <optional>
#include <source_location>
#include <string>
#include <string_view>
#include <vector>

namespace ise {

class peer_sessions;
struct role_state;

/// What the links of one component share.
struct channel_context {
    service_runtime& runtime;
    pending_calls& calls;
    peer_sessions& sessions;
    use_book& uses;
    std::shared_ptr<resolver> names; ///< null: none was given
};

/// The way to one component, found by name or by address, or to the peer of one session. It makes a session when
/// something wants one, keeps what waits meanwhile, and heals: a session that ended is made anew, with back-off and
/// jitter, as long as calls wait or subscriptions live. Calls that were never written move to the next session.
///
/// A role is served by several: the link talks to the best of them that it reaches, goes on with the next one when that
/// is lost, and comes back to a better one as `role_options` say. It moves when the new session is there; calls that
/// were written to the one before end there, subscriptions go on with a gap of unknown length.
class peer_channel final : public std::enable_shared_from_this<peer_channel>,
                           public session_owner,
                           public call_holder,
                           public subscription_owner,
                           public use_target {
public:
    /// To whoever holds `path`, or to that component at one of `fixed`, where an empty path is whoever listens.
    /// Lifetime: `of` outlives it.
    peer_channel(channel_context& of, std::string path, std::vector<endpoint> fixed, role_options how = role_options());
    /// Back to the peer of a session that it made.
    peer_channel(channel_context& of, const std::shared_ptr<session>& peer);
    ~peer_channel();

    service_runtime& runtime() const noexcept override { return of_.runtime; }
    pending_calls& calls() const noexcept { return of_.calls; }
    /// For people: the path, or the endpoint.
    const std::string& name() const noexcept override { return name_; }
    std::string obstacle() const override;
    bool located() const noexcept override { return located_ && seekers_ == 0; }
    bool awaits(std::string_view service) const noexcept override;

    /// Starts a call (`detail::start_call`). Its outcome comes later, even on refusal.
    void call(service_key service, duration deadline, const asio::any_io_executor& waiting, call_waiter& waiter,
              outgoing_packet request, const std::source_location& where);
    /// Why it is not used on another thread than the component's.
    failure misplaced(service_key service) const;
    failure let_go(pending_call& call, errc why) override;
    void requeue(pending_call& call, payload request) override;
    void repeat(pending_call& call) override;
    void on_first_call(std::string_view service, const packet_types& types) override;

    void attach(subscriber_core& subscriber) override;
    void detach(subscriber_core& subscriber) noexcept override;
    bool reconnects() const noexcept override { return call_owner::reconnects(); }
    void on_established(const subscriber_core& subscriber) override;
    void on_missed(const subscriber_core& subscriber) override;

    /// Makes a session without a call; completes when it is there. errc::timed_out names the last obstacle.
    /// Cancellation: terminal, returns errc::cancelled.
    task<result<void>> connect(time_point deadline);

    /// Waits until somebody is found under its path, without a session; the resolver's failure at `deadline`.
    /// Cancellation: terminal.
    static task<result<void>> find(std::shared_ptr<peer_channel> self, time_point deadline);

    /// Tries again sooner than the component's options say: for a provider that many depend on.
    void hurry(duration max_pause, duration connect_time) noexcept;

    /// Of several endpoints: leaves the session, and tries the one after it. Nothing is done where there is one only.
    void try_next(const failure& why);

    const std::shared_ptr<session>& current() const noexcept { return session_; }
    /// The path of the component that it talks to now, of a role the member; empty without a session.
    std::string holder() const;
    void on_session_end(session& ended, const failure& cause) override;
    /// For the resolver: those who serve the role have changed.
    void on_members(const resolution& found);
    /// The component stops: what waits for a session has waited in vain.
    void stop();
    std::size_t waiting_calls() const noexcept { return waiting_.size(); }
    std::size_t subscribers() const noexcept { return subscribers_.size(); }

private:
    std::shared_ptr<void> share() override { return shared_from_this(); }
    /// Not where a session has ended and is still to be reported.
    bool connected() const noexcept;
    bool wanted() const noexcept { return !waiting_.empty() || !subscribers_.empty() || connectors_ > 0; }
    void wake();
    static task<> maintain(std::shared_ptr<peer_channel> self);
    /// Between two tries; a long pause ends early when there is somebody new to try.
    task<> wait_before_next_try(duration pause);
    task<result<std::shared_ptr<session>>> establish();
    /// Tries the endpoints of one component in turn, each for `patience`, together until `until`.
    task<result<std::shared_ptr<session>>> reach(location where, duration patience, time_point until);
    void adopt(std::shared_ptr<session> made);
    void send_waiting();

    void keep_waiting(pending_call& call, outgoing_packet request);
    void wait_for_session(pending_call& call, call_state how) noexcept;
    void fail_for_thrown(pending_call& call);
    void note_wait(std::string_view service, const packet_types* types);
    void note_miss(std::string_view service, const packet_types* types, std::string cause);

    // A role's.
    void take_members(const resolution& found);
    void forget_role() noexcept;
    void lose_member(session& ended, const failure& cause);
    bool runs_actions() const noexcept;
    void consider_moving();
    static task<> move(std::shared_ptr<peer_channel> self);
    static task<> ask_about(std::shared_ptr<peer_channel> self, location unlisted);
    void switch_to(std::shared_ptr<session> made, const location& member);
    static task<> retire(std::shared_ptr<session> old);

    channel_context& of_;
    std::string path_;
    std::vector<endpoint> fixed_; // the one that is tried first, or that the session is with, at the front
    std::string name_;
    std::string obstacle_;
    std::shared_ptr<session> session_;
    pending_call_list waiting_;
    std::vector<subscriber_core*> subscribers_;
    std::vector<waiter<>*> arrivals_;
    role_options how_;
    std::unique_ptr<role_state> role_; // once the path is known to be a role
    back_off pause_;
    duration connect_time_;
    duration spread_;
    time_point since_{};           // the present session began
    std::uint64_t tried_life_ = 0; // the incarnation that was tried last; 0: nobody held the name
    int connectors_ = 0;
    int seekers_ = 0;
    bool located_ = false;
    bool maintaining_ = false;
    bool moving_ = false;
};

} // namespace ise
