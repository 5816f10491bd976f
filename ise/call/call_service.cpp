#include <ise/call/call_service.hpp>

#include <ise/call/waiting_calls.hpp>
#include <ise/session/service_runtime.hpp>

#include <asio/any_io_executor.hpp>
#include <fmt/format.h>

#include <algorithm>

namespace ise {

call_worker::call_worker(call_service& service, service_runtime& runtime)
    : service_(service), runtime_(runtime), wake_(runtime.on(), uninterrupted),
      deadline_(runtime.on(), [this] { expire(); }), contexts_(call_contexts::of(runtime.on())),
      context_(contexts_->take()) {}

call_worker::~call_worker() { contexts_->give_back(context_); }

// A call that leads back to the handler that made it can only be among those that came while it ran.
void call_worker::note_waiting(const call_origin& from) {
    if (!busy_ || !context_.waiting.empty()) return;
    waiting_ = from.caller_name();
    context_.waiting = waiting_;
}

// Those that came with it in the same turn may have taken long.
[[gnu::hot]] bool call_worker::may_begin() {
    if (!wanted_) return false;
    if (service_.is_late(context_.deadline)) {
        wanted_ = false;
        service_.refuse_late(*from_, context_.id);
        return false;
    }
    if (detail::present_trace) detail::present_trace->handles_call(context_.trace);
    return true;
}

// The caller has been told, and so is the handler; its own outcome comes too late.
void call_worker::expire() {
    if (!std::exchange(wanted_, false)) return;
    auto cycle = suspected_cycle(context_);
    auto text = fmt::format("'{}' did not finish before its deadline{}", service_.name(), cycle);
    if (!cycle.empty()) runtime_.tell(peer_trouble::handler, text, from_->caller_name());
    from_->refuse(context_.id, failure(errc::timed_out, std::move(text), execution::unknown));
    give_up();
}

void call_worker::give_up() {
    if (busy_ && coroutine_) coroutine_->cancel();
}

[[gnu::hot]] void call_worker::answer(outgoing_packet response) {
    if (std::exchange(wanted_, false)) from_->reply(context_.id, response);
}

void call_worker::answer(const failure& why) {
    service_.tell_failure(*from_, why);
    if (std::exchange(wanted_, false)) from_->refuse(context_.id, why);
}

call_service::call_service(service_runtime& runtime, std::string name, const packet_types& types, serve_options options)
    : runtime_(runtime), name_(std::move(name)), types_(types), options_(options),
      waiting_(std::make_unique<waiting_calls>()) {}

call_service::call_service(service_runtime& runtime, std::string name, const packet_types& types)
    : call_service(runtime, std::move(name), types, {}) {
    at_once_ = true;
}

call_service::~call_service() = default;

std::size_t call_service::waiting() const noexcept { return waiting_->size(); }

[[gnu::hot]] void call_service::serve(call_origin& from, const incoming_call& call, incoming_packet& request) {
    if (stopped_) {
        from.refuse(call.id, failure(errc::cancelled, fmt::format("'{}' is not provided any more", name_)));
        return;
    }
    if (at_once_ && is_late(call.deadline)) return refuse_late(from, call.id); // a worker looks when it begins
    request.adapt = call.adapt;
    const bool measured = meter_.samples(runtime_.on().now());
    auto began = measured ? runtime_.env().now() : time_point::max();
    try {
        if (at_once_) {
            const detail::trace_scope works_for({call.trace, true});
            serve_now(from, call, request);
            meter_.begins();
            if (measured) meter_.handled(runtime_.env().now() - began);
            return;
        }
        if (may_begin(from) && begin(from, call, request, began)) {
            meter_.begins();
            return;
        }
    } catch (const error& thrown) {
        from.refuse(call.id, thrown.why());
        return;
    } catch (const std::exception& thrown) {
        from.refuse(call.id, failure(errc::handler_failed, thrown.what(), execution::unknown));
        return;
    }
    // A new worker takes the request from the queue as soon as its coroutine has come up.
    bool more_workers = workers_.size() < options_.concurrent && may_begin(from);
    if (options_.concurrent == 1 && !workers_.empty()) workers_.front()->note_waiting(from);
    waiting_->push({held<call_origin>(from), call, request.keep(), measured ? began : runtime_.env().now()});
    while (auto beyond = waiting_->overflow(options_.waiting, options_.waiting_bytes))
        refuse_overloaded(
            *beyond,
            failure(errc::overloaded, fmt::format("'{}' has {} requests of {} bytes waiting (waiting, waiting_bytes)",
                                                  name_, waiting_->size(), waiting_->bytes_held())));
    if (more_workers) add_worker();
}

bool call_service::runs(const call_origin& from, std::uint64_t id) const noexcept {
    return std::ranges::any_of(workers_, [&](const auto& worker) {
        return worker->wanted_ && worker->context_.id == id && worker->from_.get() == &from;
    });
}

void call_service::tell_failure(const call_origin& from, const failure& why) {
    if (why.code() == errc::handler_failed)
        runtime_.tell(peer_trouble::handler, fmt::format("a handler of '{}' failed: {}", name_, why.message()),
                      from.caller_name());
}

bool call_service::is_late(time_point deadline) const { return deadline <= runtime_.on().fresh_now(); }

void call_service::refuse_late(call_origin& to, std::uint64_t id) {
    meter_.refused_expired();
    runtime_.counts().refused(errc::timed_out);
    to.refuse(id, failure(errc::timed_out, fmt::format("'{}' was too busy to begin in time", name_)));
}

void call_service::refuse_overloaded(const waiting_call& one, const failure& why) {
    meter_.refused_overloaded();
    runtime_.counts().refused(why.code());
    one.from->refuse(one.call.id, why);
}

[[gnu::hot]] bool call_service::may_begin(const call_origin& from) const {
    auto most = options_.concurrent < 4 ? options_.concurrent : options_.concurrent - options_.concurrent / 4;
    if (running() < most) return true;
    auto theirs = std::ranges::count_if(workers_, [&](const auto& worker) { return worker->from_.get() == &from; });
    return static_cast<std::size_t>(theirs) < most;
}

[[gnu::hot]] bool call_service::begin(call_origin& from, const incoming_call& call, incoming_packet& request,
                                      time_point began) {
    if (idle_.empty()) return false;
    auto& worker = *idle_.back();
    worker.load(request);
    idle_.pop_back();
    worker.from_ = held<call_origin>(from);
    worker.began_ = began;
    worker.busy_ = worker.wanted_ = true;
    describe(worker.context_, from, call);
    worker.deadline_.arm(call.deadline);
    worker.wake_.resume(true);
    return true;
}

void call_service::add_worker() {
    workers_.push_back(make_worker());
    auto& worker = *workers_.back();
    auto body = [](std::shared_ptr<call_service> keep, call_worker& who) -> task<> {
        // Also where the loop ends under a handler: the session that called must not hold itself through its call.
        struct leaving {
            call_service& of;
            call_worker& who;
            ~leaving() {
                who.coroutine_ = nullptr;
                if (!of.runtime_.on().abandoned()) return;
                auto calls = of.waiting_->take_all();
                who.wanted_ = false;
                who.from_.reset();
            }
        } guard{*keep, who};
        co_await who.run();
    };
    auto executor = with_context(runtime_.on().get_executor(), &worker.context_);
    worker.coroutine_ =
        runtime_.scope().spawn("handler of " + name_, body(shared_from_this(), worker), std::move(executor));
    if (worker.coroutine_) return;
    workers_.pop_back();
    for (auto& entry : waiting_->take_all())
        entry.from->refuse(entry.call.id, failure(errc::cancelled, "the component stops"));
}

[[gnu::hot]] void call_worker::be_idle() {
    auto& of = service_;
    deadline_.disarm();
    if (began_ != time_point::max()) of.meter_.handled(runtime_.env().now() - std::exchange(began_, time_point::max()));
    context_ = call_context(); // what goes on at this executor has no part in the call
    from_.reset();
    busy_ = false;
    if (of.stopped_ || runtime_.scope().stopping()) {
        wake_.resume(false);
        return;
    }
    of.idle_.push_back(this);
    while (!of.waiting_->empty()) {
        auto found = of.waiting_->pop([&of](const call_origin& from) { return of.may_begin(from); });
        if (!found) return;
        auto& next = *found;
        auto now = runtime_.env().now(); // the turn may have lasted
        if (of.is_late(next.call.deadline)) {
            of.refuse_late(*next.from, next.call.id);
            continue;
        }
        try {
            incoming_packet request(next.request);
            request.adapt = next.call.adapt;
            of.begin(*next.from, next.call, request, now);
            of.meter_.begins(now - next.since);
            return;
        } catch (const error& thrown) {
            next.from->refuse(next.call.id, thrown.why());
        } catch (const std::exception& thrown) {
            next.from->refuse(next.call.id, failure(errc::handler_failed, thrown.what(), execution::unknown));
        }
    }
}

// The caller is gone: nobody is answered any more.
void call_service::withdraw(const call_origin& from, std::uint64_t id) {
    waiting_->withdraw(from, id);
    for (auto& worker : workers_) {
        if (!worker->wanted_ || worker->from_.get() != &from || worker->context_.id != id) continue;
        worker->wanted_ = false;
        worker->deadline_.disarm();
        worker->give_up();
        return;
    }
}

void call_service::stop() {
    stopped_ = true;
    for (auto& entry : waiting_->take_all())
        entry.from->refuse(entry.call.id,
                           failure(errc::cancelled, fmt::format("'{}' is not provided any more", name_)));
    for (auto* worker : std::exchange(idle_, {})) worker->wake_.resume(false);
    // Those who wait for a handler that runs are told now, before the sessions say goodbye.
    for (auto& worker : workers_) {
        worker->deadline_.disarm();
        if (std::exchange(worker->wanted_, false))
            worker->from_->refuse(
                worker->context_.id,
                failure(errc::cancelled, fmt::format("'{}' was stopped while it ran", name_), execution::unknown));
        worker->give_up();
    }
}

void call_service::describe(call_context& into, const call_origin& from, const incoming_call& call) const {
    into.service = name_;
    into.caller = from.caller();
    into.verified = &from.verified();
    into.who = into.verified->who;
    into.deadline = call.deadline;
    into.trace = call.trace;
    into.id = call.id;
    into.waiting = {};
}

} // namespace ise
