#pragma once
#include <ise/call/context.hpp>
#include <ise/call/incoming_call.hpp>
#include <ise/call/service_meter.hpp>
#include <ise/core/task.hpp>
#include <ise/core/waiter.hpp>
#include <ise/session/carried_packet.hpp>
#include <ise/session/contract.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace ise {

class service_runtime;
class call_service;
class waiting_calls;
struct waiting_call;

/// One coroutine that answers requests of one service, one after the other, and is kept for the next: starting a
/// coroutine for each call costs more than the call.
class call_worker {
public:
    call_worker(call_service& service, service_runtime& runtime);
    virtual ~call_worker();

    /// Cancels the handler that runs now.
    void give_up();

protected:
    friend class call_service;
    /// The loop of the coroutine: `next()`, handle, `answer…`, until it returns false.
    virtual task<> run() = 0;
    /// Takes a request for the next turn; may throw.
    virtual void load(incoming_packet& request) = 0;

    /// Waits for the next call; false: no more will come. Only the service ends this wait: to hear of a cancellation
    /// costs memory, at each call.
    class next_call final : public waiter<bool>::operation {
    public:
        explicit next_call(call_worker& worker) noexcept : operation(worker.wake_), worker_(worker) {}
        template <class Promise>
        void await_suspend(std::coroutine_handle<Promise> coroutine) {
            operation::await_suspend(coroutine);
            worker_.be_idle();
        }

    private:
        call_worker& worker_;
    };
    next_call next() noexcept { return next_call(*this); }
    /// Whether somebody still waits for it and it is not too late to begin; else it is over.
    bool may_begin();
    void answer(outgoing_packet response);
    void answer(const failure& why);
    const call_context& context() const noexcept { return context_; }

private:
    void be_idle();
    void note_waiting(const call_origin& from);
    void expire();

    call_service& service_;
    service_runtime& runtime_;
    waiter<bool> wake_;
    async_stack* coroutine_ = nullptr;
    timer deadline_;
    held<call_origin> from_;               // context_ borrows the name of who called
    bool wanted_ = false;                  // somebody waits for the answer
    time_point began_ = time_point::max(); // max: it is not measured
    std::shared_ptr<call_contexts> contexts_;
    call_context& context_;
    std::string waiting_; // context_ borrows it
    bool busy_ = false;
};

/// Limits of a provided service.
struct serve_options {
    /// Maximum number of concurrent handlers; further requests are queued. 1: exclusive. With 4 or more, one session
    /// may occupy at most 75 %.
    std::size_t concurrent = 256;
    /// Maximum number of queued requests. When the queue is full, the session with the most queued requests is refused
    /// (`overloaded`).
    std::size_t waiting = 1024;
    std::size_t waiting_bytes = std::size_t{64} << 20; ///< maximum size of all queued requests; as above
};

/// One provided request-response service; its typed part makes workers, or answers at once.
class call_service : public std::enable_shared_from_this<call_service> {
public:
    /// Served by workers.
    call_service(service_runtime& runtime, std::string name, const packet_types& types, serve_options options);
    /// Answers at once, by `serve_now`.
    call_service(service_runtime& runtime, std::string name, const packet_types& types);
    virtual ~call_service();

    const std::string& name() const noexcept { return name_; }
    const packet_types& types() const noexcept { return types_; }

    void serve(call_origin& from, const incoming_call& call, incoming_packet& request);
    /// Requests of a session that ended, or that the caller gave up.
    void withdraw(const call_origin& from, std::uint64_t id);
    void stop();
    bool stopped() const noexcept { return stopped_; }
    std::size_t running() const noexcept { return workers_.size() - idle_.size(); }
    std::size_t waiting() const noexcept;
    /// Whether a handler has begun with that request, and somebody waits for its answer.
    bool runs(const call_origin& from, std::uint64_t id) const noexcept;
    service_meter& meter() noexcept { return meter_; }

protected:
    /// Answers without a coroutine: for handlers that are plain functions.
    virtual void serve_now(call_origin&, const incoming_call&, incoming_packet&) {}
    /// For handlers that are coroutines.
    virtual std::unique_ptr<call_worker> make_worker() { return nullptr; }
    void describe(call_context& into, const call_origin& from, const incoming_call& call) const;
    /// Logs what a handler threw, at a bounded rate.
    void tell_failure(const call_origin& from, const failure& why);
    service_runtime& runtime() noexcept { return runtime_; }

private:
    friend class call_worker;
    bool begin(call_origin& from, const incoming_call& call, incoming_packet& request,
               time_point began); // false: no worker is idle
    void refuse_overloaded(const waiting_call& one, const failure& why);
    bool is_late(time_point deadline) const;
    void refuse_late(call_origin& to, std::uint64_t id);
    void add_worker();

    // One session never has every handler, where there are several: the others' calls go on.
    bool may_begin(const call_origin& from) const;

    service_runtime& runtime_;
    std::string name_;
    const packet_types& types_;
    serve_options options_;
    std::vector<std::unique_ptr<call_worker>> workers_;
    std::vector<call_worker*> idle_;
    std::unique_ptr<waiting_calls> waiting_;
    service_meter meter_;
    bool at_once_ = false;
    bool stopped_ = false;
};

/// Where request-response services are looked up.
class call_directory {
public:
    /// Null where there is none.
    virtual std::shared_ptr<call_service> find_calls(std::string_view name) const = 0;
    /// The failure for the caller if there is none.
    virtual failure no_calls(std::string_view name) const = 0;

protected:
    ~call_directory() = default;
};

} // namespace ise
