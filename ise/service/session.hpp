#pragma once
#include <ise/call/incoming_calls.hpp>
#include <ise/call/outgoing_calls.hpp>
#include <ise/session/conversation.hpp>
#include <ise/subscription/incoming_subscriptions.hpp>
#include <ise/subscription/outgoing_subscriptions.hpp>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace ise {

class session;

/// Who made a session, and makes another one when it ends: its calls and subscriptions go on there.
class session_owner : public call_owner {
public:
    virtual void on_session_end(session& ended, const failure& cause) = 0;

protected:
    using call_owner::call_owner;
    ~session_owner() = default;
};

/// What the sessions of one component share.
struct session_context {
    service_runtime& runtime;
    pending_calls& calls;
    const call_directory& call_services;
    const publication_directory& publications;
    reply_windows& answered;
};

/// What two components say to each other over one connection, in both directions: the calls and subscriptions that
/// this side asked for, and those that it serves. Symmetric: who connected makes no difference.
class session final : public conversation {
public:
    /// `owner`: nobody where the peer made it. `on_over` is called once, last.
    session(const session_context& of, std::shared_ptr<net::connection> connection, std::weak_ptr<session_owner> owner,
            std::function<void(session&)> on_over);

    /// Begins to read.
    void start();

    outgoing_calls& calls() noexcept { return outgoing_calls_; }
    const incoming_calls& calls_in() const noexcept { return incoming_calls_; } ///< those of the peer
    outgoing_subscriptions& subscriptions() noexcept { return outgoing_subscriptions_; }

    /// The access policy, or who this side is for it, has changed: calls that are denied now are refused, subscriptions
    /// that are denied end, and so does the session of a peer that may not have its path any more.
    void review_access();
    /// Ends it: what the peer was let in by does not count any more.
    void revoke(failure why);

    /// Keeps something until the session ends, or `let_go`.
    void keep(std::shared_ptr<void> what) noexcept { kept_ = std::move(what); }
    void let_go() noexcept { kept_.reset(); }

    /// The services of the peer that this side has called over it, or is subscribed to; each once, by name.
    std::vector<std::string> used_services() const;
    /// Packets that are held for the peer's subscriptions, in bytes.
    std::size_t held_bytes() const noexcept {
        return incoming_subscriptions_ ? incoming_subscriptions_->held_bytes() : 0;
    }

private:
    result<void> on_frame(const net::carried_frame& received) override;
    result<void> on_unfinished() override { return messages_fit(); }
    void on_closed(const failure& cause) override;
    incoming_subscriptions& subscribers();

    const publication_directory& publications_;
    std::weak_ptr<session_owner> owner_;
    std::function<void(session&)> on_over_;
    std::shared_ptr<void> kept_;
    outgoing_calls outgoing_calls_;
    incoming_calls incoming_calls_;
    outgoing_subscriptions outgoing_subscriptions_;
    std::unique_ptr<incoming_subscriptions> incoming_subscriptions_; // once the peer has subscribed
};

} // namespace ise
