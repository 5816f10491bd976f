#pragma once
#include <ise/call/pending_call.hpp>
#include <ise/core/limits.hpp>
#include <ise/core/result.hpp>
#include <ise/session/conversation.hpp>
#include <ise/session/held_packets.hpp>

#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace ise {

/// The calls that this side makes over one session: their numbers, and whose response a reply is.
class outgoing_calls final : public call_holder {
public:
    outgoing_calls(conversation& over, pending_calls& calls)
        : over_(over), calls_(calls), held_{over.runtime().options().held_bytes()} {}

    /// Sends a request; false where too much is pending (the call is untouched). Throws what writing it throws, and
    /// errc::too_large where the peer would not take it.
    bool send(pending_call& call, outgoing_packet request);
    /// Those that are not answered yet.
    std::size_t pending() const noexcept { return pending_; }
    failure let_go(pending_call& call, errc why) override;

    result<void> on_reply(const net::carried_frame& received);
    result<void> on_error(const net::carried_frame& received);
    result<void> on_answers(const net::carried_frame& received);
    /// Calls that go on do so at `owner`, if they are its own; the others fail.
    void on_session_end(const failure& cause, call_owner* owner);

    /// Adds the names of the services that were called.
    void add_used(std::set<std::string>& names) const;

private:
    // A service as this side introduced it to the peer.
    struct introduced {
        explicit introduced(held_budget& room) : held(limit::held_replies, room) {}

        std::string name;
        const packet_types* types;
        std::uint64_t told;                // the peer's response, by its fingerprint
        std::unique_ptr<adapter> response; // where that differs from ours
        bool adapting = false;             // its schema was asked for; replies wait
        held_packets<std::uint64_t> held;  // by their calls
    };
    struct slot {
        pending_call* call = nullptr; // null: it is free
        std::uint32_t generation = 0;
        std::uint32_t service = 0; // of a free one: the free one behind it
    };

    std::uint32_t number_of(const pending_call& call);
    /// Null where nobody waits for it any more.
    slot* find_slot(std::uint64_t id) noexcept;
    pending_call& free_slot(slot& of);
    pending_call* take_slot(std::uint64_t id);
    void introduce(std::uint32_t number);
    void requeue(call_owner& owner, pending_call& call, incoming_packet request);
    void release(introduced& service, const failure* problem);

    conversation& over_;
    pending_calls& calls_;
    held_budget held_; // of all services
    std::vector<std::unique_ptr<introduced>> introduced_;
    std::vector<slot> slots_;
    std::uint32_t first_free_ = 0; // none where it is beyond all
    std::size_t pending_ = 0;
};

} // namespace ise
