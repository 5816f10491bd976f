#pragma once
#include <ise/core/task_scope.hpp>
#include <ise/core/waiter.hpp>
#include <ise/service/carried_packet.hpp>
#include <ise/service/context.hpp>
#include <ise/service/contract.hpp>
#include <ise/service/service_meter.hpp>
#include <ise/service/waiting_calls.hpp>
#include <ise/wire/frame.hpp>
#include <ise/wire/messages.hpp>

#include <deque>
#include <memory>
#include <string>
#include <vector>

namespace ise {

class session;
class service_host;
class call_service;

/// One coroutine that answers requests of one service, one after the other, and is kept for the next: starting a
/// coroutine for each call costs more than the call.
class call_worker {
public:
    call_worker(call_service& service, service_host& host);
    virtual ~call_worker() = default;

    /// Cancels the handler that runs now.
    void give_up();

protected:
    friend class call_service;
    /// The loop of the coroutine: `next()`, handle, `answer…`, until it returns false.
    virtual task<> run() = 0;
    /// Takes a request for the next turn; may throw.
    virtual void load(incoming_packet& request) = 0;

    /// Waits for the next call; false: no more will come. Only the service ends this wait: to hear of a cancellation costs
    /// memory, at each call.
    task<bool> next();
    void answer(outgoing_packet response);
    void answer(const failure& why);
    const call_context& context() const noexcept { return context_; }

private:
    void begin(incoming_call call, time_point began);
    bool finish();
    void expire();

    call_service& service_;
    service_host& host_;
    waiter<bool> wake_;
    asio::cancellation_signal* cancel_ = nullptr; // of its coroutine
    timer deadline_;
    incoming_call call_; // context_ borrows the name of who called
    bool wanted_ = false; // somebody waits for the answer
    time_point began_ = time_point::max(); // max: it is not measured
    call_context context_;
    bool busy_ = false;
};

/// How a service is served.
struct serve_options {
    std::size_t concurrent = 256; ///< handlers at once; more wait. 1: exclusive. From 4 on, one session has three quarters at most
    std::size_t waiting = 1024;   ///< requests that may wait; beyond, the session that has most of them is refused as overloaded
    std::size_t waiting_bytes = std::size_t{64} << 20; ///< of these requests together; the same
};

/// One provided request-response service; its typed part makes workers, or answers at once.
class call_service : public std::enable_shared_from_this<call_service> {
public:
    call_service(service_host& host, std::string name, const packet_types& types, serve_options options);
    virtual ~call_service();

    const std::string& name() const noexcept { return name_; }
    const packet_types& types() const noexcept { return types_; }

    void serve(session& from, incoming_call call, incoming_packet request);
    static void reply(session& to, const incoming_call& call, outgoing_packet response);
    static void refuse(session& to, const incoming_call& call, const failure& why);
    /// Requests of a session that ended, or that the caller gave up.
    void withdraw(const session& from, std::uint64_t id);
    void stop();
    std::size_t running() const noexcept { return workers_.size() - idle_.size(); }
    std::size_t waiting() const noexcept { return waiting_.size(); }
    service_meter& meter() noexcept { return meter_; }

protected:
    /// Answers at once, without a coroutine: for handlers that are plain functions. False: a worker is needed.
    virtual bool serve_now(session& from, const incoming_call& call, incoming_packet& request) = 0;
    virtual std::unique_ptr<call_worker> make_worker() = 0;
    call_context context_of_call(const session& from, const incoming_call& call) const;
    service_host& host() noexcept { return host_; }

private:
    friend class call_worker;
    void idle(call_worker& worker);
    bool begin(incoming_call& call, incoming_packet& request, time_point began); // false: no worker is idle
    void refuse_overloaded(session& to, const incoming_call& call, const failure& why);
    void add_worker();

    // One session never has every handler, where there are several: the others' calls go on.
    bool may_begin(const session& from) const;

    service_host& host_;
    std::string name_;
    const packet_types& types_;
    serve_options options_;
    std::vector<std::unique_ptr<call_worker>> workers_;
    std::vector<call_worker*> idle_;
    waiting_calls waiting_;
    service_meter meter_;
    bool stopped_ = false;
};

/// Why a peer's introduction of a service cannot be taken, by the limit's name; the session ends over it.
std::optional<failure> objection_to(const wire::introduction& told);

/// The requests that come over one session: which service they mean, and whether its packets fit.
class incoming_calls {
public:
    explicit incoming_calls(session& owner) : session_(owner) {}

    result<void> on_introduce(const wire::frame& received);
    result<void> on_request(const wire::frame& received);
    void on_cancel(std::uint64_t id);
    void on_session_end();

    /// Answers a request.
    void reply(std::uint64_t id, outgoing_packet response);
    void refuse(std::uint64_t id, const failure& why);
    /// Sends an answer that was made before, or for another session: a whole frame, whose id is replaced.
    void send_answer(std::uint64_t id, bytes_view frame);

    std::size_t running() const noexcept { return running_count_; }

private:
    enum class state : std::uint8_t { ready, comparing, refused };
    struct request_head {
        std::uint64_t id = 0;
        time_point deadline{};
        trace_id trace;
        std::uint64_t number = 0; // outlives the session; 0: none
        bool again = false;       // may have been sent before
    };
    struct held_request {
        request_head head;
        kept_packet request;
    };
    struct binding {
        std::string name;
        std::shared_ptr<call_service> service;
        state now = state::ready;
        failure why{errc::no_such_service, {}};
        std::unique_ptr<adapter> request;
        std::vector<held_request> held;
    };
    struct running_call {
        binding* of = nullptr;
        std::uint64_t id = 0;
        std::uint64_t number = 0;
        bool elsewhere = false; // it runs for an earlier session; its answer comes here
    };

    void bind(binding& made, const std::vector<std::uint64_t>& fingerprints);
    void compare(std::uint32_t number, std::vector<std::uint64_t> fingerprints);
    void forget(std::uint64_t id) noexcept;
    void serve(binding& of, const request_head& head, incoming_packet request);
    bool seen_before(binding& of, const request_head& head);
    void occupy(binding& of, const request_head& head, bool elsewhere);
    void answer_numbered(std::uint64_t number, bytes_view frame);

    session& session_;
    std::vector<std::unique_ptr<binding>> bindings_; // by the caller's number
    std::vector<running_call> running_;              // by the call's slot
    std::size_t running_count_ = 0;
    std::size_t held_ = 0; // requests, of all bindings
    std::size_t held_bytes_ = 0;
};

} // namespace ise
