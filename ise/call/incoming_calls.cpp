#include <ise/call/call_tap.hpp>
#include <ise/call/incoming_calls.hpp>

#include <ise/packet/codec.hpp>
#include <ise/packet/compatibility.hpp>
#include <ise/session/tracer.hpp>
#include <ise/wire/body.hpp>
#include <ise/wire/reason.hpp>

#include <fmt/format.h>

#include <utility>

namespace ise {
namespace {

std::uint32_t slot_of(std::uint64_t id) noexcept { return static_cast<std::uint32_t>(id); }

// Where the answers of numbered calls are encoded, before they are kept: one for all on a loop.
struct answer_room {
    static constexpr std::size_t max_kept = 4096;
    buffer frame;

    buffer& cleared() {
        if (frame.capacity() > max_kept) frame = buffer();
        frame.clear();
        return frame;
    }
};

call_taps& taps_of(service_runtime& runtime) { return runtime.on().common<call_taps>(); }

// Notes the beginning of a call for whoever records it.
void tap(const incoming_calls& at, service_runtime& runtime, const std::string& service, const incoming_call& call,
         std::string caller, incoming_packet& request) {
    auto& taps = taps_of(runtime);
    if (!taps.watches(runtime) || service.starts_with("ise.")) return;
    tapped_call made;
    made.service = service;
    made.caller = std::move(caller);
    made.asked_at = runtime.env().wall();
    const auto now = runtime.on().now();
    if (call.deadline != time_point::max()) made.deadline = call.deadline - now;
    try {
        auto raw = request.bytes();
        made.request.assign(raw.begin(), raw.end());
    } catch (const std::exception&) { // the handler's decoder says why; there is nothing to record
        return;
    }
    taps.begin(&at, call.id, std::move(made), now);
}

void tap_end(const incoming_calls& at, service_runtime& runtime, std::uint64_t id, std::string outcome,
             std::string message, const outgoing_packet* response) {
    if (!taps_of(runtime).watches(runtime)) return;
    buffer raw;
    if (response) {
        try {
            response->write(raw);
        } catch (const std::exception& thrown) {
            outcome = name_of(errc::handler_failed);
            message = thrown.what();
        }
    }
    taps_of(runtime).end(&at, id, runtime, runtime.on().now(), std::move(outcome), std::move(message), raw.to_bytes());
}

} // namespace

result<void> incoming_calls::on_introduce(const net::carried_frame& received) {
    auto introduced = wire::read_body<wire::introduction>(received.body);
    if (!introduced) return introduced.error();
    if (received.header.id != bindings_.size())
        return failure(errc::protocol_error, "a service was introduced with a number out of turn");
    if (bindings_.size() >= limit::introduced_services)
        return failure(errc::overloaded, fmt::format("more than {} services were introduced (introduced_services)",
                                                     limit::introduced_services));
    if (auto wrong = objection_to(*introduced)) return *wrong;
    auto made = std::make_unique<binding>(held_);
    made->name = std::move(introduced->service);
    made->introduced = std::move(introduced->fingerprints);
    if (made->introduced.size() > role::response) made->response_told = made->introduced[role::response];
    bindings_.push_back(std::move(made));
    consult(*bindings_.back(), true);
    if (!bindings_.back()->denied) bind(static_cast<std::uint32_t>(bindings_.size() - 1));
    return {};
}

// Asks the access policy, once for the session and the service; whoever may not use a service is not told whether it is
// there.
void incoming_calls::consult(binding& of, bool note) {
    if (!over_.runtime().access()) return;
    of.denied.reset();
    of.denial_noted = note;
    if (auto wrong = over_.objection_to_use(service_kind::request_response, of.name, note))
        of.denied = std::make_unique<failure>(std::move(*wrong));
    of.audited = !of.denied && over_.audited(of.name);
}

// The first refusal was noted when the service was introduced.
void incoming_calls::deny(binding& of, const incoming_call& call) {
    if (std::exchange(of.denial_noted, false) == false)
        (void)over_.objection_to_use(service_kind::request_response, of.name, true);
    turn_away(call, *of.denied);
}

void incoming_calls::review() {
    for (auto& one : bindings_) {
        one->denial_noted = false;
        consult(*one, false);
    }
}

[[gnu::hot]] reply_cache& incoming_calls::replies() {
    if (!replies_) {
        // What was answered to one identity is not shown to another, whatever it says of itself.
        replies_ =
            answered_.of(over_.peer().reply_key, over_.peer().incarnation, over_.on().now(), over_.verified().who);
        self_ = std::shared_ptr<incoming_calls>(over_.shared_from_this(), this);
    }
    return *replies_;
}

reply_cache::place incoming_calls::here(std::uint64_t id) {
    reply_cache::place made;
    made.over = self_;
    made.id = id;
    return made;
}

[[gnu::hot]] result<void> incoming_calls::on_request(const net::carried_frame& received) {
    auto malformed = [](std::string_view what) {
        return failure(errc::protocol_error, fmt::format("a request came {}", what));
    };
    const auto flags = received.header.flags;
    auto parsed = wire::request_head::read(flags, received.body);
    if (!parsed) return malformed("with half a head");
    const bytes_view packet = received.body.subspan(wire::request_head::size(flags));
    const bool until = parsed->until && over_.wire().tells_clock();
    if (parsed->time_ns < 0 && !until) return malformed("with a negative time");
    if (parsed->service >= bindings_.size()) return malformed("for a service that was not introduced");
    const bool numbered = flags & wire::flag::numbered;
    if (numbered && (!over_.wire().lossy() || over_.peer().incarnation == 0))
        return malformed("with a number that makes no sense");
    const auto id = received.header.id;
    incoming_call call;
    call.id = id;
    if (parsed->trace != 0) [[unlikely]]
        call.trace = {parsed->trace, parsed->parent, over_.wire().tells_traces() ? parsed->high : 0};
    call.number = parsed->number;
    call.again = numbered && (flags & wire::flag::again);
    auto& runtime = over_.runtime();
    if (slot_of(id) >= runtime.options().max_calls_per_session) {
        turn_away(call, failure(errc::overloaded,
                                fmt::format("more than {} calls of one session at once (max_calls_per_session)",
                                            runtime.options().max_calls_per_session)));
        return {};
    }
    if (slot_of(id) < running_.size() && (running_[slot_of(id)].of || running_[slot_of(id)].held_by))
        return malformed("with the number of a call that is not answered yet");
    if (over_.replies_wait()) [[unlikely]] {
        if (auto why = over_.replies_not_taken(execution::not_executed)) {
            if (auto good = over_.takes_answers(); !good) return good;
            turn_away(call, std::move(*why));
            return {};
        }
    }

    call.deadline =
        until ? time_point(duration(parsed->time_ns)) : saturating_add(over_.on().now(), duration(parsed->time_ns));
    auto& of = *bindings_[parsed->service];
    incoming_packet request(packet, received.object);
    const bool usual = !of.denied && of.now == state::ready && !of.service->stopped();
    if (usual || may_serve(parsed->service, call, request)) [[likely]]
        serve(of, call, request);
    return {};
}

// The slow path: the service is denied, not provided, or its packets are not known to fit. False where the request
// cannot be served now: it has been answered, or is held.
bool incoming_calls::may_serve(std::uint32_t number, const incoming_call& call, incoming_packet& request) {
    auto& of = *bindings_[number];
    if (of.denied) {
        deny(of, call);
        return false;
    }
    const bool provided = of.service && !of.service->stopped();
    if (!provided && of.now != state::comparing) bind(number);
    if (of.now == state::ready) return true;
    if (of.now == state::refused) {
        turn_away(call, of.why);
    } else if (of.held.hold(call, request)) {
        auto& place = place_of(call.id);
        place.held_by = &of;
        place.id = call.id;
    } else {
        turn_away(call, failure(errc::overloaded,
                                fmt::format("{} requests wait for the schemas of '{}' (held_requests, session_bytes)",
                                            of.held.size(), of.name)));
    }
    return false;
}

// Looks for the service that is provided now; requests that began in a former one stay there.
void incoming_calls::bind(std::uint32_t number) {
    auto& of = *bindings_[number];
    auto service = services_.find_calls(of.name);
    if (service && service == of.service) return; // the component stops
    auto refuse_all = [&of](failure why) {
        of.now = state::refused;
        of.why = std::move(why);
    };
    if (!service) return refuse_all(services_.no_calls(of.name));
    const auto& ours = service->types().fingerprints;
    const bool alike = of.introduced.size() == ours.size();
    const bool tells = alike && ours[role::response] != of.response_told;
    if (tells && of.served && over_.wire().out().big_calls_wait())
        return refuse_all(
            failure(errc::overloaded,
                    fmt::format("'{}' is provided anew with another response, and a large reply is still being sent",
                                of.name)));
    of.service = std::move(service);
    of.request.reset();
    if (!alike)
        return refuse_all(failure(errc::type_mismatch, fmt::format("'{}' has {} packets here, {} at the caller",
                                                                   of.name, ours.size(), of.introduced.size())));
    if (tells) {
        // Behind the replies of a former service, ahead of its own.
        wire::provider_packets result;
        result.fingerprints = ours;
        over_.send(wire::frame_type::answers, 0, number, [&](buffer& body) { encode(result, body); });
        of.response_told = ours[role::response];
    }
    of.now = state::comparing;
    if (of.introduced != ours) return compare(number);
    of.now = state::ready;
    of.served = true;
}

void incoming_calls::compare(std::uint32_t number) {
    auto decide = [this, number](std::optional<failure> problem) {
        auto& of = *bindings_[number];
        of.now = problem ? state::refused : state::ready;
        if (problem) {
            over_.runtime().tell(peer_trouble::mismatch, problem->message(), over_.caller_name());
            of.why = std::move(*problem);
        } else {
            of.served = true;
        }
        of.held.release([&](incoming_call& call, incoming_packet request) {
            place_of(call.id).held_by = nullptr;
            if (may_serve(number, call, request)) serve(of, call, request);
        });
    };
    auto result = [this, number, decide](const std::vector<schema>& theirs) {
        auto& of = *bindings_[number];
        const auto& ours = of.service->types();
        std::string diff;
        if (auto wrong = incompatibility(ours.schemas[role::request], theirs[role::request]))
            diff += fmt::format("request: {}", *wrong);
        if (auto wrong = incompatibility(theirs[role::response], ours.schemas[role::response]))
            diff += fmt::format("{}response: {}", diff.empty() ? "" : "\n", *wrong);
        if (!diff.empty())
            return decide(failure(errc::type_mismatch,
                                  fmt::format("the packets of '{}' differ incompatibly:\n{}", of.name, diff)));
        if (theirs[role::request].fingerprint() != ours.fingerprints[role::request])
            of.request = std::make_unique<adapter>(theirs[role::request], ours.schemas[role::request]);
        decide(std::nullopt);
    };
    over_.schemas().need(bindings_[number]->introduced, result, [decide](const failure& why) { decide(why); });
}

// Before it is looked up what became of it, if it may have come before.
void incoming_calls::turn_away(const incoming_call& call, failure why) {
    over_.runtime().counts().refused(why.code());
    refuse(call.id, call.again ? failure(why.code(), why.message(), execution::unknown) : why);
}

[[gnu::hot]] void incoming_calls::serve(binding& of, incoming_call& call, incoming_packet& request) {
    auto& runtime = over_.runtime();
    if (call.deadline <= runtime.on().now()) {
        of.service->meter().refused_expired();
        of.service->meter().failed(errc::timed_out);
        turn_away(call, failure(errc::timed_out,
                                fmt::format(
                                    "'{}' was asked too late: its deadline, less the uncertainty of a round trip, had "
                                    "passed before the request was read",
                                    of.name)));
        return;
    }
    auto& running = place_of(call.id);
    running.begins(of, call);
    ++running_count_;
    if (call.number != 0 && seen_before(of, call)) return;
    if (of.audited) over_.note_use(service_kind::request_response, of.name);
    call.adapt = of.request.get();
    ++runtime.counts().calls_served;
    if (call_taps::any() || call.trace) [[unlikely]]
        observe(running, call, request);
    of.service->serve(*this, call, request);
}

void incoming_calls::observe(running_call& which, incoming_call& call, incoming_packet& request) {
    auto& runtime = over_.runtime();
    if (auto* traces = runtime.options().traces.get(); traces && call.trace.trace != 0) {
        which.trace = call.trace;
        which.span = call.trace.parent = traces->next_id(); // calls of the handler are caused by this span
        which.began = runtime.on().now();
    }
    if (!call_taps::any()) return;
    request.adapt = call.adapt;
    tap(*this, runtime, which.of->name, call, over_.caller_name(), request);
}

void incoming_calls::observe_end(std::uint64_t id, errc outcome, std::string_view message,
                                 const outgoing_packet* response) {
    auto& runtime = over_.runtime();
    if (auto* running = find(id); running && running->span != 0)
        runtime.options().traces->ended(running->trace, std::exchange(running->span, 0), span::side::server, outcome,
                                        running->began, runtime.env().now() - running->began, running->of->name,
                                        runtime.self().path, over_.peer_name());
    if (call_taps::any())
        tap_end(*this, runtime, id, outcome == errc{} ? "ok" : std::string(name_of(outcome)), std::string(message),
                response);
}

// A call that the client makes again after its session was lost: it runs once, and its answer goes to where it asked
// last.
[[gnu::hot]] bool incoming_calls::seen_before(binding& of, const incoming_call& call) {
    auto& window = replies();
    switch (window.look(call.number, call.again)) {
        case reply_cache::state::fresh:
            window.begin(call.number, here(call.id), call.deadline, over_.on().now());
            return false;
        case reply_cache::state::running:
            window.redirect(call.number, here(call.id));
            running_[slot_of(call.id)].elsewhere = true;
            return true;
        case reply_cache::state::answered: send_answer(call.id, *window.answer(call.number)); return true;
        case reply_cache::state::forgotten: break;
    }
    forget(call.id); // it is answered here only
    over_.runtime().counts().refused(errc::peer_lost);
    refuse(
        call.id,
        failure(errc::peer_lost,
                fmt::format(
                    "'{}' may have been executed before the session was lost; it was not resent within its linger, or "
                    "its answer is no longer kept (max_replies, max_reply_bytes, max_kept_bytes, idle_caller_life)",
                    of.name),
                execution::unknown));
    return true;
}

// The caller has gone on: it gets no answer.
void incoming_calls::on_cancel(std::uint64_t id) {
    if (const auto* found = find(id)) {
        auto running = *found;
        auto service = running.of->service;
        if (is_observed(running)) [[unlikely]]
            observe_end(id, errc::cancelled, "its caller gave it up", nullptr);
        forget(id);
        if (running.elsewhere) {
            auto origin = replies().origin(running.number);
            auto over = origin ? origin->over.lock() : nullptr;
            if (over) over->on_cancel(origin->id);
            return;
        }
        service->meter().failed(errc::cancelled);
        if (running.number != 0) replies().give_up(running.number);
        service->withdraw(*this, id);
        return;
    }
    const auto slot = slot_of(id);
    if (slot >= running_.size() || running_[slot].id != id || !running_[slot].held_by) return;
    auto& of = *std::exchange(running_[slot].held_by, nullptr);
    of.held.drop([id](const incoming_call& call) { return call.id == id; });
}

bool incoming_calls::is_observed(const running_call& which) noexcept { return call_taps::any() || which.span != 0; }

[[gnu::hot]] incoming_calls::running_call& incoming_calls::place_of(std::uint64_t id) {
    const auto slot = slot_of(id);
    if (slot >= running_.size()) running_.resize(slot + 1);
    return running_[slot];
}

[[gnu::hot]] incoming_calls::running_call* incoming_calls::find(std::uint64_t id) noexcept {
    auto slot = slot_of(id);
    return slot < running_.size() && running_[slot].id == id && running_[slot].of ? &running_[slot] : nullptr;
}

void incoming_calls::forget(std::uint64_t id) noexcept {
    auto* running = find(id);
    if (!running) return;
    running->of = nullptr;
    --running_count_;
}

void incoming_calls::orphan(std::uint64_t id) {
    auto* running = find(id);
    if (!running) return;
    auto& runtime = over_.runtime();
    running->orphaned_until = saturating_add(runtime.on().now(), runtime.options().linger);
    if (!orphans_) orphans_ = std::make_unique<timer>(runtime.on(), [this] { end_orphans(); });
    if (!orphans_->armed()) orphans_->arm(running->orphaned_until); // the others come later
}

bool incoming_calls::awaited(const running_call& call) {
    const auto* to = replies().destination(call.number);
    auto over = to ? to->over.lock() : nullptr;
    return over && over->over_.open();
}

void incoming_calls::end_orphans() {
    over_.on().later([held = over_.shared_from_this()] {}); // its last call may go now
    auto now = over_.on().now();
    auto next = time_point::max();
    for (auto& entry : running_) {
        if (!entry.of || entry.orphaned_until == time_point::max()) continue;
        if (entry.orphaned_until > now) {
            next = std::min(next, entry.orphaned_until);
            continue;
        }
        entry.orphaned_until = time_point::max();
        if (!awaited(entry)) on_cancel(entry.id);
    }
    if (next != time_point::max()) orphans_->arm(next);
}

void incoming_calls::each(function_ref<void(const std::string& service, std::uint64_t id, bool runs)> visit) const {
    for (const auto& entry : running_)
        if (entry.of) visit(entry.of->name, entry.id, entry.of->service->runs(*this, entry.id));
}

void incoming_calls::on_session_end() {
    auto held = over_.shared_from_this();
    if (replies_) replies_->touch(over_.on().now());
    for (auto& entry : running_) {
        if (!entry.of) continue;
        // Who numbers its calls may come back for the answer.
        if (entry.number == 0) {
            on_cancel(entry.id);
        } else if (entry.elsewhere) {
            forget(entry.id);
            auto origin = replies().origin(entry.number);
            auto over = origin ? origin->over.lock() : nullptr;
            if (over) over->orphan(origin->id);
        } else {
            orphan(entry.id);
        }
    }
}

[[gnu::hot]] void incoming_calls::reply(std::uint64_t id, outgoing_packet response) {
    auto* running = find(id);
    if (!running) return;
    auto& of = *running->of;
    auto number = running->number;
    if (is_observed(*running)) [[unlikely]]
        observe_end(id, errc{}, {}, &response);
    if (number == 0) {
        running->of = nullptr;
        --running_count_;
        if (!over_.open()) return;
    }
    auto& wire = over_.wire();
    if (number == 0 && over_.replies_wait()) [[unlikely]] {
        if (auto why = over_.replies_not_taken(execution::unknown)) {
            of.service->meter().failed(errc::overloaded);
            refuse(id, *why);
            return;
        }
    }
    buffer& out = number == 0 ? wire.out().calls() : over_.on().common<answer_room>().cleared();
    std::size_t start = out.size();
    passed_object object;
    std::optional<failure> problem;
    try {
        if (wire.passes_objects() && response.is_object()) object = response.pass();
        wire::put_frame(out, wire::frame_type::reply, object ? wire::flag::attached : std::uint8_t{0}, id,
                        [&](buffer& body) {
                            if (!object) response.write(body);
                        });
        auto size = out.size() - start - wire::frame_header::size + object.weight();
        auto most = wire.terms().peer_accepts.max_message_bytes;
        if (size > most)
            problem.emplace(errc::too_large,
                            fmt::format("the response of '{}' has {} bytes, its caller accepts {} (max_message_bytes)",
                                        of.name, size, most),
                            execution::unknown);
        else if (number == 0 && out.size() - start > host_memory::free_bytes)
            problem = over_.replies_not_taken(execution::unknown, out.size() - start);
    } catch (const std::exception& thrown) {
        problem.emplace(errc::handler_failed,
                        fmt::format("the response of '{}' cannot be encoded: {}", of.name, thrown.what()),
                        execution::unknown);
    }
    if (problem) {
        out.truncate(start);
        if (number == 0) of.service->meter().failed(problem->code());
        refuse(id, *problem);
        return;
    }
    if (number != 0) {
        of.service->meter().answered();
        forget(id);
        answer_numbered(number, out.view());
        return;
    }
    of.service->meter().answered();
    wire.out().end_call(start, std::move(object));
    wire.written();
}

[[gnu::hot]] void incoming_calls::answer_numbered(std::uint64_t number, bytes_view frame) {
    auto& runtime = over_.runtime();
    auto now = runtime.on().now();
    auto to = replies().finish(number, frame, now);
    answered_.tidy(now);
    auto over = to ? to->over.lock() : nullptr;
    if (over) over->send_answer(to->id, frame);
}

[[gnu::hot]] void incoming_calls::send_answer(std::uint64_t id, bytes_view frame) {
    forget(id);
    if (!over_.open()) return;
    auto& wire = over_.wire();
    if (over_.replies_wait() && wire::read_header(frame.data()).type == wire::frame_type::reply) [[unlikely]] {
        if (auto why = over_.replies_not_taken(execution::unknown)) {
            refuse(id, *why);
            return;
        }
    }
    buffer& out = wire.out().calls();
    std::size_t start = out.size();
    out.append(frame);
    detail::store_little(out.data() + start + 8, id);
    wire.out().end_call(start);
    wire.written();
}

void incoming_calls::refuse(std::uint64_t id, const failure& why) {
    const auto* running = find(id);
    if (running ? is_observed(*running) : call_taps::any()) [[unlikely]]
        observe_end(id, why.code(), why.message(), nullptr);
    if (running) running->of->service->meter().failed(why.code());
    const std::uint64_t number = running ? running->number : 0;
    forget(id);
    if (number == 0 && !over_.open()) return;
    wire::call_failure result;
    result.code = static_cast<std::uint8_t>(why.code());
    result.execution = static_cast<std::uint8_t>(why.executed());
    result.reason = wire::reason_of(why.message());
    auto& wire = over_.wire();
    buffer kept;
    buffer& out = number == 0 ? wire.out().calls() : kept;
    const std::size_t start = out.size();
    wire::put_frame(out, wire::frame_type::error, 0, id, [&](buffer& body) { encode(result, body); });
    if (number != 0) {
        answer_numbered(number, kept.view());
        return;
    }
    wire.out().end_call(start);
    wire.written();
}

} // namespace ise
