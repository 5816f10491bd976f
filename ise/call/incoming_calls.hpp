#pragma once
#include <ise/call/call_service.hpp>
#include <ise/call/reply_cache.hpp>
#include <ise/core/limits.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/result.hpp>
#include <ise/session/conversation.hpp>
#include <ise/session/held_packets.hpp>
#include <ise/wire/frame.hpp>
#include <ise/wire/messages.hpp>

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ise {

/// The requests that come over one session: which service they mean, and whether its packets fit.
class incoming_calls final : public call_origin {
public:
    incoming_calls(conversation& over, const call_directory& services, reply_windows& answered)
        : call_origin(over.peer_name(), over.verified()), over_(over), services_(services),
          answered_(answered), held_{over.runtime().options().held_bytes()} {}

    result<void> on_introduce(const net::carried_frame& received);
    result<void> on_request(const net::carried_frame& received);
    void on_cancel(std::uint64_t id);
    void on_session_end();
    /// The access policy has changed: what is denied now is refused from here on, and what was denied may be served.
    void review();

    /// Answers a request.
    void reply(std::uint64_t id, outgoing_packet response) override;
    void refuse(std::uint64_t id, const failure& why) override;
    std::string caller_name() const override { return over_.caller_name(); }
    /// Sends an answer that was made before, or for another session: a whole frame, whose id is replaced.
    void send_answer(std::uint64_t id, bytes_view frame);

    /// Nobody waits for a numbered call any more: within the linger somebody may come back for it, then it is
    /// cancelled.
    void orphan(std::uint64_t id);

    std::size_t running() const noexcept { return running_count_; }
    /// The requests that are not answered yet. `runs`: a handler has begun.
    void each(function_ref<void(const std::string& service, std::uint64_t id, bool runs)> visit) const;

private:
    std::shared_ptr<void> share() override { return over_.shared_from_this(); }
    enum class state : std::uint8_t { ready, comparing, refused };
    struct binding {
        explicit binding(held_budget& room) : held(limit::held_requests, room) {}

        std::string name;
        std::vector<std::uint64_t> introduced; // the caller's packets
        std::uint64_t response_told = 0;       // whose layout the caller expects
        std::shared_ptr<call_service> service; // null: there was none yet
        state now = state::refused;
        failure why{errc::no_such_service, {}};
        bool served = false; // there may be replies
        std::unique_ptr<adapter> request;
        std::unique_ptr<failure> denied; // by the access policy
        bool denial_noted = false;       // in the audit log, for the next request
        bool audited = false;
        held_packets<incoming_call> held; // while it is comparing
    };
    struct running_call {
        binding* of = nullptr;
        std::uint64_t id = 0;
        std::uint64_t number = 0;
        bool elsewhere = false;     // it runs for an earlier session; its answer comes here
        binding* held_by = nullptr; // it does not run yet: the schemas of this service are compared
        time_point orphaned_until = time_point::max();
        std::uint64_t span = 0; // of this side; 0: none
        trace_id trace;         // where there is a span: of the caller
        time_point began{};     // where there is a span: the turn in which the request was read

        void begins(binding& service, const incoming_call& call) noexcept {
            of = &service;
            id = call.id;
            number = call.number;
            elsewhere = false;
            orphaned_until = time_point::max();
            span = 0;
        }
    };

    void bind(std::uint32_t number);
    void compare(std::uint32_t number);
    bool may_serve(std::uint32_t number, const incoming_call& call, incoming_packet& request);
    void turn_away(const incoming_call& call, failure why);
    void deny(binding& of, const incoming_call& call);
    void consult(binding& of, bool note);
    /// Null where no such call runs.
    running_call& place_of(std::uint64_t id);
    running_call* find(std::uint64_t id) noexcept;
    void forget(std::uint64_t id) noexcept;
    void serve(binding& of, incoming_call& call, incoming_packet& request);
    bool seen_before(binding& of, const incoming_call& call);
    // For those who look at calls: recorders and the tracer. Without, a call costs two looks more.
    static bool is_observed(const running_call& which) noexcept;
    void observe(running_call& which, incoming_call& call, incoming_packet& request);
    void observe_end(std::uint64_t id, errc outcome, std::string_view message, const outgoing_packet* response);
    bool awaited(const running_call& call);
    void end_orphans();
    void answer_numbered(std::uint64_t number, bytes_view frame);
    /// What the peer was answered, over this session and those before.
    reply_cache& replies();
    reply_cache::place here(std::uint64_t id);

    conversation& over_;
    const call_directory& services_;
    reply_windows& answered_;
    std::shared_ptr<reply_cache> replies_;           // once it has numbered a call
    std::weak_ptr<incoming_calls> self_;             // the same
    held_budget held_;                               // of all bindings
    std::vector<std::unique_ptr<binding>> bindings_; // by the caller's number
    std::vector<running_call> running_;              // by the call's slot
    std::size_t running_count_ = 0;
    std::unique_ptr<timer> orphans_; // once there are some
};

} // namespace ise
