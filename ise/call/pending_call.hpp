#pragma once
#include <ise/call/context.hpp>
#include <ise/call/service_meter.hpp>
#include <ise/core/error.hpp>
#include <ise/core/function_ref.hpp>
#include <ise/core/held.hpp>
#include <ise/core/loop.hpp>
#include <ise/session/carried_packet.hpp>
#include <ise/session/contract.hpp>

#include <functional>
#include <memory>
#include <source_location>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace ise {

class pending_calls;
class call_owner;
struct pending_call;

/// How a call ended: a failure, or the response (valid during the call only).
struct call_outcome {
    const failure* why = nullptr;
    incoming_packet* response = nullptr;
};

/// Who waits for a call, from `peer_channel::call` on: keeps the call's owner, lives until it is told that the call has
/// ended, and may give it up before.
class call_waiter {
public:
    call_waiter(const call_waiter&) = delete;
    call_waiter& operator=(const call_waiter&) = delete;

    /// Told once: takes the outcome over, and goes on behind what happens now (`loop::later`).
    virtual void end(loop& on, const call_outcome& outcome) = 0;
    /// Told in place of that when the loop has ended: there will be no outcome. May destroy *this.
    virtual void drop() noexcept = 0;

    /// Nothing before the call begins and after it has ended.
    void give_up();

protected:
    call_waiter() = default;
    ~call_waiter() = default;

private:
    friend class pending_calls;
    friend struct pending_call;
    pending_call* call_ = nullptr;
};

/// Where a call is.
enum class call_state : std::uint8_t {
    starting,  ///< not sent, and waits for nothing
    waiting,   ///< for a session; it was never sent
    sent,      ///< over a session, which may have brought it to its handler
    repeating, ///< waits for a session again: it may have run, and is sent once more by its number
};

/// Who has a call at present: its owner while it waits, the session over which it was sent.
class call_holder {
public:
    /// Nobody waits for it any more: forgets it, and says what is known of it. `why`: errc::timed_out or
    /// errc::cancelled.
    virtual failure let_go(pending_call& call, errc why) = 0;

protected:
    ~call_holder() = default;
};

/// One call from its beginning to its outcome. Pooled: steady calling allocates none of these.
struct pending_call final : suspended {
    explicit pending_call(pending_calls& of);

    pending_calls& desk;
    std::string_view service; ///< its maker keeps it until the call has ended
    const packet_types* types = nullptr;
    time_point deadline;
    trace_id trace;
    std::uint64_t caused_by = 0; ///< of the trace: the span in which the call was made; its own is `trace.parent`
    bool spans = false;          ///< this side makes a span of it
    time_point began{};          ///< the turn in which it was made
    std::source_location where;  ///< the `co_await` of it, if there is one
    const call_context* made_in = nullptr; ///< the handler that waits for it
    call_waiter* waiter = nullptr;         ///< null: it has ended
    timer alarm;

    call_state state = call_state::starting;
    call_holder* holder = nullptr;    ///< null while it is starting
    call_owner* owner = nullptr;      ///< where it goes on waiting
    std::uint64_t id = 0;             ///< on the session
    payload waiting;                  ///< the request, while there is no session, or where it may be sent again
    std::uint64_t number = 0;         ///< by which it is sent again, once it was sent where that is possible
    std::uint64_t sent_to = 0;        ///< the provider's life that may have executed it
    pending_call* previous = nullptr; ///< in the `pending_call_list` that it is in, if it is in one
    pending_call* next = nullptr;

    /// What is known of its execution if it ends now.
    execution executed() const noexcept {
        return state == call_state::sent || state == call_state::repeating ? execution::unknown
                                                                           : execution::not_executed;
    }
    void moves(call_state to, call_holder& now) noexcept {
        state = to;
        holder = &now;
    }

private:
    friend class pending_calls;
    void drop() noexcept override; // the loop ends: who waits is destroyed unresumed
};

/// Calls in the order in which they were added. None of its functions takes memory, or longer with more calls.
class pending_call_list {
public:
    bool empty() const noexcept { return !first_; }
    std::size_t size() const noexcept { return size_; }
    /// Null: there is none. `pending_call::next` is the one behind it.
    pending_call* first() const noexcept { return first_; }
    void push_back(pending_call& call) noexcept;
    pending_call& pop_front() noexcept;
    /// Does nothing where it is in no list.
    void remove(pending_call& call) noexcept;

private:
    pending_call* first_ = nullptr;
    pending_call* last_ = nullptr;
    std::size_t size_ = 0;
};

/// Who makes calls, and goes on with those that a lost session leaves.
class call_owner : public holdable {
public:
    /// The provider for people.
    virtual const std::string& name() const noexcept = 0;
    /// Whether a new session follows one that ended; calls continue over it where that is possible.
    bool reconnects() const noexcept { return reconnects_; }
    std::uint64_t next_number() noexcept { return next_number_++; }
    /// Takes back one of which no byte was written.
    virtual void requeue(pending_call& call, payload request) = 0;
    /// Takes back one that may have been executed, but can be sent again by its number.
    virtual void repeat(pending_call& call) = 0;
    /// A service is called over a session for the first time.
    virtual void on_first_call(std::string_view service, const packet_types& types) = 0;

protected:
    call_owner(std::uint64_t first_number, bool reconnects) noexcept
        : next_number_(first_number), reconnects_(reconnects) {}
    ~call_owner() = default;

private:
    std::uint64_t next_number_;
    bool reconnects_;
};

/// Makes, ends and recycles the calls of one component.
class pending_calls {
public:
    explicit pending_calls(loop& on) : on_(on) {}
    ~pending_calls();

    loop& on() noexcept { return on_; }
    /// A call of `owner`, for `waiter`.
    pending_call& open(call_owner& owner, call_waiter& waiter);
    /// Ends a call, once: its waiter gets the outcome, and the record is free again.
    void end(pending_call& call, const call_outcome& outcome);
    void fail(pending_call& call, const failure& why);
    /// The loop has ended: nothing completes it any more, whoever waits is unwound.
    void abandon(pending_call& call);

    /// Where the numbers of an owner's calls begin: no two owners of a component share any.
    std::uint64_t next_range() noexcept { return (++ranges_ << 40) + 1; }

    std::size_t open_calls() const noexcept { return all_.size() - free_.size(); }
    std::uint64_t late_replies = 0; ///< came after the call had ended otherwise
    std::uint64_t answered = 0;     ///< calls that ended with a response
    outcome_counts failures;        ///< the others
    /// Called with the end of a call that this side makes a span of; null: it ended with a response.
    std::function<void(const pending_call&, const failure* why)> on_span;

    /// Calls under way that handlers wait for, in no order.
    void each_awaited(function_ref<void(const pending_call&)> visit) const;

private:
    friend struct pending_call;
    friend class call_waiter;
    void give_up(pending_call& call, errc why);
    void end_late(call_waiter& waiter, const call_context& made_in, const failure& late);

    loop& on_;
    std::vector<std::unique_ptr<pending_call>> all_;
    std::vector<pending_call*> free_;
    std::uint64_t ranges_ = 0;
};

} // namespace ise
