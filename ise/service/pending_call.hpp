#pragma once
#include <ise/core/error.hpp>
#include <ise/core/loop.hpp>
#include <ise/service/call_completion.hpp>
#include <ise/service/carried_packet.hpp>
#include <ise/service/context.hpp>
#include <ise/service/contract.hpp>

#include <asio/cancellation_signal.hpp>

#include <memory>
#include <string>
#include <vector>

namespace ise {

class call_desk;
class session;
class link;

/// Keeps a link for a call. All calls on their way over it have one share of it together: a share for each would cost two
/// locked instructions a call.
struct let_go_of_link {
    void operator()(link* held) const noexcept;
};
using held_link = std::unique_ptr<link, let_go_of_link>;
held_link hold(const std::shared_ptr<link>& to);
held_link hold(std::shared_ptr<link>&& to);

/// One call from its beginning to its outcome. Pooled: steady calling allocates none of these.
struct pending_call final : suspended {
    explicit pending_call(call_desk& of);

    call_desk& desk;
    std::string service;
    const packet_types* types = nullptr;
    time_point deadline;
    trace_id trace;
    const call_context* made_in = nullptr; ///< the handler that waits for it
    call_completion done;
    timer alarm;
    asio::cancellation_slot slot;
    bool cancelling = false;

    held_link owner;                     ///< where it goes on waiting
    session* sent_on = nullptr;          ///< the session it was written to
    std::uint64_t id = 0;                ///< on that session
    kept_packet waiting;                 ///< the request, while there is no session, or where it may be sent again
    std::uint64_t number = 0;            ///< by which it is sent again, once it was sent where that is possible
    std::uint64_t sent_to = 0;           ///< the provider's life that may have executed it

private:
    void drop() noexcept override; // the loop ends: who waits is destroyed unresumed
};

/// Makes, ends and recycles the calls of one component.
class call_desk {
public:
    explicit call_desk(loop& on) : on_(on) {}
    ~call_desk();

    loop& on() noexcept { return on_; }
    pending_call& open();
    /// Ends a call, once: its completion runs with the outcome, and the record is free again.
    void end(pending_call& call, const call_outcome& outcome);
    void fail(pending_call& call, const failure& why);

    /// Binds the cancellation of whoever waits.
    void watch(pending_call& call, asio::cancellation_slot slot);

    std::size_t open_calls() const noexcept { return all_.size() - free_.size(); }
    std::uint64_t late_replies = 0; ///< came after the call had ended otherwise

private:
    friend struct pending_call;
    void expire(pending_call& call);
    void give_up(pending_call& call);

    loop& on_;
    std::vector<std::unique_ptr<pending_call>> all_;
    std::vector<pending_call*> free_;
};

} // namespace ise
