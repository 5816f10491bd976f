#include <ise/call/outgoing_calls.hpp>

#include <ise/packet/codec.hpp>
#include <ise/packet/compatibility.hpp>
#include <ise/wire/body.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <new>

namespace ise {

using wire::frame_type;

namespace {

std::uint64_t call_id(std::uint32_t slot, std::uint32_t generation) noexcept {
    return static_cast<std::uint64_t>(generation) << 32 | slot;
}

} // namespace

[[gnu::hot]] std::uint32_t outgoing_calls::number_of(const pending_call& call) {
    for (std::size_t number = 0; number < introduced_.size(); ++number)
        if (introduced_[number]->types == call.types && introduced_[number]->name == call.service)
            return static_cast<std::uint32_t>(number);
    auto made = std::make_unique<introduced>(held_);
    made->name = call.service;
    made->types = call.types;
    made->told = call.types->fingerprints[role::response];
    over_.runtime().schemas().add_own(*call.types);
    call.owner->on_first_call(call.service, *call.types);
    auto number = static_cast<std::uint32_t>(introduced_.size());
    introduced_.push_back(std::move(made));
    const auto& control = over_.wire().out().control();
    const auto unsent = control.size();
    try {
        introduce(number);
    } catch (...) { // a number that the peer does not know would end the session
        if (control.size() == unsent) introduced_.pop_back();
        throw;
    }
    return number;
}

// A control frame: it overtakes requests, of which each may be given up before it was written.
void outgoing_calls::introduce(std::uint32_t number) {
    wire::introduction result;
    result.service = introduced_[number]->name;
    result.fingerprints = introduced_[number]->types->fingerprints;
    over_.send_ahead(frame_type::introduce, number, [&](buffer& body) { encode(result, body); });
}

[[gnu::hot]] bool outgoing_calls::send(pending_call& call, outgoing_packet request) {
    auto& connection = over_.wire();
    if (connection.out().pending_call_bytes() > over_.runtime().options().session_bytes) return false;
    if (first_free_ == slots_.size()) {
        auto most = std::min(connection.terms().peer_accepts.max_calls, 1u << 20);
        if (slots_.size() >= most) return false;
        slots_.emplace_back().service = first_free_ + 1;
    }
    wire::request_head head;
    head.service = number_of(call);
    const auto now = over_.on().now();
    head.until = connection.knows_clock();
    head.time_ns = head.until
                       ? saturating_add(call.deadline, connection.terms().clock.ahead(now)).time_since_epoch().count()
                       : std::max(call.deadline - now, duration{}).count();
    if (call.trace) [[unlikely]] {
        head.trace = call.trace.trace;
        head.parent = call.trace.parent;
        if (connection.tells_traces()) head.high = call.trace.high;
    }
    const auto at = first_free_;
    call.id = call_id(at, slots_[at].generation);
    const std::uint8_t again = call.number != 0 ? wire::flag::again : std::uint8_t{0};
    // Where sessions come and go more lightly, what was asked can be asked again.
    const bool numbered = connection.lossy() && call.owner->reconnects();
    if (numbered && call.number == 0) call.number = call.owner->next_number();
    if (numbered) head.number = call.number;
    std::uint8_t flags = head.flags() | again;

    passed_object object;
    if (connection.passes_objects() && request.is_object()) {
        object = request.pass();
        flags |= wire::flag::attached;
    }
    auto& out = connection.out().calls();
    std::size_t start = out.size();
    try {
        wire::put_frame(out, frame_type::request, flags, call.id, [&](buffer& body) {
            head.put(body);
            if (object) return;
            auto packet = body.size();
            request.write(body);
            if (!numbered) return;
            call.waiting.clear();
            call.waiting.raw.append(body.view().subspan(packet));
        });
        auto size = out.size() - start - wire::frame_header::size + object.weight();
        auto most = connection.terms().peer_accepts.max_message_bytes;
        if (size > most)
            throw error(errc::too_large,
                        fmt::format("the request of '{}' has {} bytes, {} accepts {} (max_message_bytes){}",
                                    call.service, size, over_.peer_name(), most,
                                    connection.lossy() ? " over udp: split it, or use tcp" : ""));
        connection.out().end_call(start, std::move(object));
    } catch (...) {
        out.truncate(start);
        throw;
    }
    auto& taken = slots_[at];
    taken.call = &call;
    first_free_ = std::exchange(taken.service, head.service);
    ++pending_;
    call.moves(call_state::sent, *this);
    call.sent_to = over_.peer().incarnation;
    connection.written();
    return true;
}

failure outgoing_calls::let_go(pending_call& call, errc why) {
    take_slot(call.id);
    auto& connection = over_.wire();
    if (connection.open()) {
        if (connection.out().withdraw(call.id)) connection.written();
        else over_.send_ahead(frame_type::cancel, call.id, [](buffer&) {});
    }
    const auto& who = call.owner->name();
    if (why == errc::cancelled)
        return {why, fmt::format("the call of '{}' at {} was cancelled", call.service, who), execution::unknown};
    return {why, fmt::format("'{}' at {} did not answer in time", call.service, who), execution::unknown};
}

outgoing_calls::slot* outgoing_calls::find_slot(std::uint64_t id) noexcept {
    auto at = static_cast<std::uint32_t>(id);
    if (at >= slots_.size() || !slots_[at].call || call_id(at, slots_[at].generation) != id) return nullptr;
    return &slots_[at];
}

pending_call& outgoing_calls::free_slot(slot& of) {
    ++of.generation;
    of.service = std::exchange(first_free_, static_cast<std::uint32_t>(&of - slots_.data()));
    --pending_;
    return *std::exchange(of.call, nullptr);
}

pending_call* outgoing_calls::take_slot(std::uint64_t id) {
    auto* found = find_slot(id);
    return found ? &free_slot(*found) : nullptr;
}

[[gnu::hot]] result<void> outgoing_calls::on_reply(const net::carried_frame& received) {
    auto* found = find_slot(received.header.id);
    if (!found) {
        ++calls_.late_replies;
        return {};
    }
    auto& service = *introduced_[found->service];
    incoming_packet response(received.body, received.object);
    if (service.adapting) {
        if (!service.held.hold(received.header.id, response))
            calls_.fail(free_slot(*found),
                        failure(errc::overloaded,
                                fmt::format("'{}' at {}: there was no room for its reply, as {} replies wait for a "
                                            "schema (held_replies, session_bytes)",
                                            service.name, over_.peer_name(), held_.packets),
                                execution::unknown));
        return {};
    }
    response.adapt = service.response.get();
    call_outcome outcome;
    outcome.response = &response;
    calls_.end(free_slot(*found), outcome);
    return {};
}

result<void> outgoing_calls::on_answers(const net::carried_frame& received) {
    auto report = wire::read_body<wire::provider_packets>(received.body);
    if (!report) return report.error();
    if (received.header.id >= introduced_.size())
        return failure(errc::protocol_error, "the packets of a service came that was not introduced");
    auto& service = *introduced_[static_cast<std::size_t>(received.header.id)]; // stays where it is
    if (report->fingerprints.size() != service.types->fingerprints.size())
        return failure(errc::protocol_error,
                       fmt::format("'{}' was answered with the packets of another kind", service.name));
    const auto told = report->fingerprints[role::response];
    if (told == service.told) return {};
    if (service.adapting) { // its schema will not be needed, nor understood
        const failure anew(errc::type_mismatch, "it was provided anew with another response meanwhile");
        release(service, &anew);
    }
    service.told = told;
    service.response.reset();
    if (told == service.types->fingerprints[role::response]) return {};
    service.adapting = true;
    over_.schemas().need(
        {told},
        [this, &service, told](const std::vector<schema>& theirs) {
            if (service.told != told) return;
            try {
                service.response = std::make_unique<adapter>(theirs[0], service.types->schemas[role::response]);
                release(service, nullptr);
            } catch (const error& incompatible) {
                release(service, &incompatible.why());
            }
        },
        [this, &service, told](const failure& why) {
            if (service.told == told) release(service, &why);
        });
    return {};
}

void outgoing_calls::release(introduced& service, const failure* problem) {
    service.adapting = false;
    service.held.release([&](std::uint64_t id, incoming_packet response) {
        auto* call = take_slot(id);
        if (!call) {
            ++calls_.late_replies;
        } else if (!problem) {
            response.adapt = service.response.get();
            call_outcome outcome;
            outcome.response = &response;
            calls_.end(*call, outcome);
        } else {
            calls_.fail(*call, failure(problem->code(),
                                       fmt::format("the response of '{}' from {}: {}", service.name, over_.peer_name(),
                                                   problem->message()),
                                       execution::unknown));
        }
    });
}

result<void> outgoing_calls::on_error(const net::carried_frame& received) {
    auto outcome = wire::read_body<wire::call_failure>(received.body);
    if (!outcome) return outcome.error();
    auto* call = take_slot(received.header.id);
    if (!call) {
        ++calls_.late_replies;
        return {};
    }
    auto state = outcome->execution == 0 ? execution::not_executed : execution::unknown;
    auto text = fmt::format("'{}' at {}: {}", call->service, over_.peer_name(), outcome->reason);
    calls_.fail(*call, failure(static_cast<errc>(outcome->code), std::move(text), state));
    return {};
}

void outgoing_calls::on_session_end(const failure& cause, call_owner* owner) {
    // Requests of which no byte was written go on waiting; the others may have run.
    over_.wire().take_unwritten([&](const net::carried_frame& unwritten) {
        const auto& header = unwritten.header;
        auto* call = take_slot(header.id);
        if (!call) return;                         // given up
        bool ours = owner && call->owner == owner; // one over another link to this session ends with it
        if (ours && (header.flags & wire::flag::again)) {
            owner->repeat(*call); // an earlier session may have carried it
        } else if (ours) {
            requeue(*owner, *call,
                    incoming_packet(unwritten.body.subspan(wire::request_head::size(header.flags)), unwritten.object));
        } else {
            calls_.fail(*call, failure(errc::peer_lost, fmt::format("'{}': the session ended before it was called: {}",
                                                                    call->service, cause.message())));
        }
    });
    for (auto& left : slots_) {
        if (!left.call) continue;
        auto& call = free_slot(left);
        if (call.number != 0 && owner && call.owner == owner && !over_.runtime().stopping()) {
            owner->repeat(call);
            continue;
        }
        calls_.fail(call,
                    failure(errc::peer_lost,
                            fmt::format("'{}': the session ended before the answer: {}", call.service, cause.message()),
                            execution::unknown));
    }
}

void outgoing_calls::requeue(call_owner& owner, pending_call& call, incoming_packet request) {
    payload kept;
    try {
        kept = request.keep();
    } catch (const std::bad_alloc&) { // the others go on
        calls_.fail(call, failure(errc::overloaded, "no memory"));
        return;
    }
    owner.requeue(call, std::move(kept));
}

void outgoing_calls::add_used(std::set<std::string>& names) const {
    for (const auto& one : introduced_) names.insert(one->name);
}

} // namespace ise
