#include <ise/service/session.hpp>

#include <ise/core/limits.hpp>
#include <ise/packet/codec.hpp>
#include <ise/packet/compatibility.hpp>
#include <ise/service/link.hpp>
#include <ise/service/provided_subscription.hpp>
#include <ise/service/service_host.hpp>
#include <ise/service/subscriber_core.hpp>
#include <ise/wire/body.hpp>

#include <fmt/format.h>

#include <set>

namespace ise {
namespace {

using wire::frame_type;

std::uint64_t call_id(std::uint32_t slot, std::uint32_t generation) noexcept {
    return static_cast<std::uint64_t>(generation) << 32 | slot;
}

} // namespace

session::session(service_host& host, std::shared_ptr<net::connection> connection, std::weak_ptr<link> owner)
    : host_(host), connection_(std::move(connection)), owner_(std::move(owner)), schemas_(host.schemas(), *connection_),
      incoming_(*this) {}

session::~session() = default;

std::string session::caller_name() const {
    const auto& at = peer_name();
    if (peer().path.empty() && at.starts_with("inproc://")) return "a component without a name in the same process";
    if (peer().path.empty() && at.starts_with("local://")) return "a component without a name on the same host";
    return at;
}

void session::start() { connection_->start(host_.scope(), weak_from_this()); }

result<void> session::on_frame(const wire::frame& received) {
    switch (received.header.type) {
        case frame_type::request: return incoming_.on_request(received);
        case frame_type::reply: return on_reply(received);
        case frame_type::error: return on_error(received);
        case frame_type::cancel: incoming_.on_cancel(received.header.id); return {};
        case frame_type::introduce: return incoming_.on_introduce(received);
        case frame_type::answers: return on_answers(received);
        case frame_type::subscribe:
            if (auto good = takes_answers(); !good) return good;
            return provided().on_subscribe(received);
        case frame_type::subscribed: return on_subscribed(received);
        case frame_type::packet: return on_packet(received);
        case frame_type::unsubscribe:
            if (auto good = takes_answers(); !good) return good;
            return provided().on_unsubscribe(received);
        case frame_type::unsubscribed: on_unsubscribed(received); return {};
        case frame_type::ended: return on_ended(received);
        case frame_type::credit: return provided().on_credit(received);
        case frame_type::schema_request: return schemas_.on_request(received.body);
        case frame_type::schema: return schemas_.on_answer(received.body);
        case frame_type::hello:
        case frame_type::welcome:
        case frame_type::reject:
        case frame_type::challenge:
        case frame_type::proof:
            return failure(errc::protocol_error, fmt::format("'{}' came in the middle of a session", wire::name_of(received.header.type)));
        default: return {}; // of a later version: passed over, as FORMAT.md says
    }
}

// Each of these frames is answered, whatever it says.
result<void> session::takes_answers() const {
    auto unsent = connection_->out().pending_call_bytes();
    if (unsent <= 2 * host_.options().max_unsent_bytes) return {};
    return failure(errc::overloaded, fmt::format("does not take its answers: {} bytes of them wait (max_unsent_bytes)", unsent));
}

std::vector<std::string> session::used_services() const {
    std::set<std::string> names;
    for (const auto& one : introduced_) names.insert(one->name);
    for (const auto& [id, subscriber] : subscribers_) names.insert(subscriber->service());
    return {names.begin(), names.end()};
}

// --- calls of this side ---------------------------------------------------------------------------------------

std::uint32_t session::number_of(const pending_call& call) {
    for (std::size_t number = 0; number < introduced_.size(); ++number)
        if (introduced_[number]->types == call.types && introduced_[number]->name == call.service) return static_cast<std::uint32_t>(number);
    auto made = std::make_unique<introduced>();
    made->name = call.service;
    made->types = call.types;
    introduced_.push_back(std::move(made));
    host_.schemas().add_own(*call.types);
    host_.uses().reached(*call.owner, call.service, call.types);
    auto number = static_cast<std::uint32_t>(introduced_.size() - 1);
    introduce(number);
    return number;
}

// A control frame: it overtakes requests, of which each may be given up before it was written.
void session::introduce(std::uint32_t number) {
    wire::introduction told;
    told.service = introduced_[number]->name;
    told.fingerprints = introduced_[number]->types->fingerprints;
    wire::put_frame(connection_->out().control(), frame_type::introduce, 0, number, [&](buffer& body) { encode(told, body); });
}

reply_window& session::replies() {
    if (!replies_) replies_ = host_.reply_windows().of(peer().reply_key, peer().incarnation, host_.on().now());
    return *replies_;
}

bool session::send(pending_call& call, outgoing_packet request) {
    if (connection_->out().pending_call_bytes() > host_.options().max_unsent_bytes) return false;
    if (free_slots_.empty()) {
        auto most = std::min(connection_->terms().peer_accepts.max_calls, 1u << 20);
        if (slots_.size() >= most) return false;
        slots_.emplace_back();
        free_slots_.push_back(static_cast<std::uint32_t>(slots_.size() - 1));
    }
    std::uint32_t number = number_of(call);
    std::uint32_t at = free_slots_.back();
    call.id = call_id(at, slots_[at].generation);
    std::uint8_t flags = call.trace.trace ? wire::flag::traced : std::uint8_t{0};
    if (call.number != 0) flags |= wire::flag::again;
    // Where sessions come and go more lightly, what was asked can be asked again.
    bool numbered = connection_->lossy() && !call.owner->peer_only();
    if (numbered) flags |= wire::flag::numbered;
    if (numbered && call.number == 0) call.number = call.owner->next_call_number();

    passed_object object;
    if (connection_->passes_objects() && request.is_object()) {
        object = request.pass();
        flags |= wire::flag::beside;
    }
    auto& out = connection_->out().begin_call();
    std::size_t start = out.size();
    try {
        wire::put_frame(out, frame_type::request, flags, call.id, [&](buffer& body) {
            body.append(number);
            body.append(static_cast<std::int64_t>(call.deadline.time_since_epoch().count())); // becomes what remains (outbox)
            if (call.trace.trace) {
                body.append(call.trace.trace);
                body.append(call.trace.parent);
            }
            if (numbered) body.append(call.number);
            if (object) return;
            auto packet = body.size();
            request.write(body);
            if (!numbered) return;
            call.waiting.clear();
            call.waiting.raw.append(body.view().subspan(packet));
        });
        auto size = out.size() - start - wire::frame_header::size + object.weight();
        auto most = connection_->terms().peer_accepts.max_message_bytes;
        if (size > most)
            throw error(errc::too_large, fmt::format("the request of '{}' has {} bytes, {} accepts {} (max_message_bytes){}", call.service, size, peer_name(), most, connection_->lossy() ? " over udp: split it, or use tcp" : ""));
    } catch (...) {
        out.truncate(start);
        throw;
    }
    free_slots_.pop_back();
    slots_[at].call = &call;
    slots_[at].service = number;
    call.sent_on = this;
    call.sent_to = peer().incarnation;
    if (object) connection_->out().end_call(std::move(object));
    else connection_->out().end_call();
    connection_->written();
    return true;
}

void session::abandon(pending_call& call) {
    take_slot(call.id);
    if (!connection_->open()) return;
    if (!connection_->out().withdraw(call.id))
        wire::put_frame(connection_->out().control(), frame_type::cancel, 0, call.id, [](buffer&) {});
    connection_->written();
}

session::slot* session::find_slot(std::uint64_t id) noexcept {
    auto at = static_cast<std::uint32_t>(id);
    if (at >= slots_.size() || !slots_[at].call || call_id(at, slots_[at].generation) != id) return nullptr;
    return &slots_[at];
}

pending_call& session::free_slot(slot& of) {
    ++of.generation;
    free_slots_.push_back(static_cast<std::uint32_t>(&of - slots_.data()));
    return *std::exchange(of.call, nullptr);
}

pending_call* session::take_slot(std::uint64_t id) {
    auto* found = find_slot(id);
    return found ? &free_slot(*found) : nullptr;
}

result<void> session::on_reply(const wire::frame& received) {
    auto* found = find_slot(received.header.id);
    if (!found) {
        ++host_.calls().late_replies;
        return {};
    }
    auto& service = *introduced_[found->service];
    if (service.adapting) {
        incoming_packet response(received.body, received.object);
        held_reply_bytes_ += response.size();
        if (service.held.size() >= limit::held_replies || held_reply_bytes_ > limit::held_bytes)
            return failure(errc::overloaded, fmt::format("{} replies of '{}' wait for its schema (held_replies, held_bytes)", service.held.size(), service.name));
        service.held.emplace_back(received.header.id, response.keep());
        return {};
    }
    complete(free_slot(*found), service, incoming_packet(received.body, received.object));
    return {};
}

result<void> session::on_answers(const wire::frame& received) {
    auto told = wire::read_body<wire::provider_packets>(received.body);
    if (!told) return told.error();
    if (received.header.id >= introduced_.size()) return failure(errc::protocol_error, "the packets of a service came that was not introduced");
    auto number = static_cast<std::uint32_t>(received.header.id);
    auto& service = *introduced_[number];
    if (service.adapting || service.response) return failure(errc::protocol_error, fmt::format("the packets of '{}' came twice", service.name));
    if (told->fingerprints.size() != service.types->fingerprints.size())
        return failure(errc::protocol_error, fmt::format("'{}' was answered with the packets of another kind", service.name));
    if (told->fingerprints[role::response] == service.types->fingerprints[role::response]) return {};
    service.adapting = true;
    auto release = [this, number](const failure* problem) {
        auto& waited = *introduced_[number];
        waited.adapting = false;
        for (auto& [id, response] : std::exchange(waited.held, {})) {
            held_reply_bytes_ -= response.size();
            auto* call = take_slot(id);
            if (!call) {
                ++host_.calls().late_replies;
            } else if (!problem) {
                complete(*call, waited, incoming_packet(response));
            } else {
                host_.calls().fail(*call, failure(problem->code(), fmt::format("the response of '{}' from {}: {}", waited.name, peer_name(), problem->message()), execution::unknown));
            }
        }
    };
    schemas_.need({told->fingerprints[role::response]},
        [this, number, release](const std::vector<schema>& theirs) {
            auto& waited = *introduced_[number];
            try {
                waited.response = std::make_unique<adapter>(theirs[0], waited.types->schemas[role::response]);
                release(nullptr);
            } catch (const error& incompatible) {
                release(&incompatible.why());
            }
        },
        [release](const failure& why) { release(&why); });
    return {};
}

void session::complete(pending_call& call, introduced& service, incoming_packet response) {
    call_outcome outcome;
    response.adapt = service.response.get();
    outcome.response = &response;
    host_.calls().end(call, outcome);
}

result<void> session::on_error(const wire::frame& received) {
    auto told = wire::read_body<wire::call_failure>(received.body);
    if (!told) return told.error();
    auto* call = take_slot(received.header.id);
    if (!call) {
        ++host_.calls().late_replies;
        return {};
    }
    auto state = told->execution == 0 ? execution::not_executed : execution::unknown;
    auto text = fmt::format("'{}' at {}: {}", call->service, peer_name(), told->reason);
    host_.calls().fail(*call, failure(static_cast<errc>(told->code), std::move(text), state));
    return {};
}

// --- subscriptions of this side -------------------------------------------------------------------------------

void session::subscribe(subscriber_core& subscriber) {
    auto terms = subscriber.terms();
    if (connection_->lossy() && terms.policy == wire::overflow::lossless) {
        subscriber.on_refused(failure(errc::invalid_argument, fmt::format("'{}' cannot be subscribed to without loss: {} is reached over udp, which loses packets; ask for the last ones, or reach it over tcp or a local socket", subscriber.service(), peer_name())));
        return;
    }
    auto id = next_subscription_++;
    host_.schemas().add_own(subscriber.types());
    subscribers_.emplace(id, &subscriber);
    subscriber.on_sent(*this, id);
    if (terms.policy == wire::overflow::lossless) { // a publisher may wait for this side, and no longer than it hears of it
        connection_->sign_often();
        host_.signs()->hasten(connection_->signs()->heartbeat());
    }
    const std::uint8_t flags = connection_->passes_objects() && subscriber.takes_objects() ? wire::flag::objects : std::uint8_t{0};
    wire::put_frame(connection_->out().begin_call(), frame_type::subscribe, flags, id, [&](buffer& body) { encode(terms, body); });
    connection_->out().end_call();
    connection_->written();
}

void session::unsubscribe(subscriber_core& subscriber) { unsubscribe(subscriber, subscriber.farewell(), nullptr); }

void session::unsubscribe(subscriber_core& subscriber, bytes_view farewell, departure* waiting) {
    if (subscribers_.erase(subscriber.id()) == 0 || !connection_->open()) return;
    if (waiting) departures_.emplace(subscriber.id(), waiting);
    wire::put_frame(connection_->out().begin_call(), frame_type::unsubscribe, 0, subscriber.id(), [&](buffer& body) { body.append(farewell); });
    connection_->out().end_call();
    connection_->written();
}

// Mostly nobody waits for it.
void session::on_unsubscribed(const wire::frame& received) {
    auto found = departures_.find(received.header.id);
    if (found == departures_.end()) return;
    auto& waiting = *found->second;
    departures_.erase(found);
    waiting.outcome.emplace(bytes(received.body.begin(), received.body.end()));
    waiting.answered.resume();
}

loop& session::host_loop() noexcept { return host_.on(); }

subscriber_core* session::find_subscriber(std::uint64_t id) const noexcept {
    auto found = subscribers_.find(id);
    return found == subscribers_.end() ? nullptr : found->second;
}

void session::grant(const subscriber_core& subscriber, std::uint64_t total) {
    if (!connection_->open()) return;
    wire::put_frame(connection_->out().control(), frame_type::credit, 0, subscriber.id(), [&](buffer& body) { body.append(total); });
    connection_->written();
}

result<void> session::on_subscribed(const wire::frame& received) {
    auto answer = wire::read_body<wire::subscribed>(received.body);
    if (!answer) return answer.error();
    auto found = subscribers_.find(received.header.id);
    if (found == subscribers_.end()) return {}; // left meanwhile; the unsubscribe is on its way
    return found->second->on_subscribed(std::move(*answer));
}

result<void> session::on_packet(const wire::frame& received) {
    bytes_view body = received.body;
    bool skipped = received.header.flags & wire::flag::skipped;
    if (body.size() < (skipped ? 12u : 8u)) return failure(errc::protocol_error, "a packet came without its sequence");
    auto sequence = detail::load_little<std::uint64_t>(body.data());
    auto left_out = skipped ? detail::load_little<std::uint32_t>(body.data() + 8) : 0;
    auto found = subscribers_.find(received.header.id);
    if (found == subscribers_.end()) return {};
    incoming_packet packet(body.subspan(skipped ? 12 : 8), received.object);
    return found->second->on_packet(sequence, left_out, packet);
}

result<void> session::on_ended(const wire::frame& received) {
    auto why = wire::read_body<wire::ended>(received.body);
    if (!why) return why.error();
    auto found = subscribers_.find(received.header.id);
    if (found == subscribers_.end()) return {};
    auto* subscriber = found->second;
    subscribers_.erase(found);
    subscriber->on_ended(failure(static_cast<errc>(why->code), fmt::format("'{}' at {}: {}", subscriber->service(), peer_name(), why->reason)), why->lost);
    return {};
}

provided_subscriptions& session::provided() {
    if (!provided_) provided_ = std::make_unique<provided_subscriptions>(*this);
    return *provided_;
}

std::size_t& session::subscriber_bytes() { return provided().held_bytes(); }

void session::forget_provided(std::uint64_t subscription) {
    if (provided_) provided_->forget(subscription);
}

void session::end_provided(std::uint64_t subscription, const failure& why, std::uint64_t lost) {
    forget_provided(subscription);
    if (!connection_->open()) return;
    wire::ended told;
    told.lost = lost;
    told.code = static_cast<std::uint8_t>(why.code());
    told.reason = why.message();
    wire::put_frame(connection_->out().begin_call(), frame_type::ended, 0, subscription, [&](buffer& body) { encode(told, body); });
    connection_->out().end_call();
    connection_->written();
}

// --- the end ---------------------------------------------------------------------------------------------------

void session::on_closed(const failure& cause) {
    auto self = shared_from_this();
    auto owner = owner_.lock();
    if (broke_rules(cause.code())) host_.tell(peer_trouble::broken, fmt::format("a session was ended: {}", cause.message()), peer_name());
    // Requests of which no byte was written go on waiting; the others may have run.
    connection_->take_unwritten([&](const wire::frame& unwritten) {
        const auto& header = unwritten.header;
        auto* call = take_slot(header.id);
        if (!call) return; // given up
        bool ours = owner && call->owner.get() == owner.get(); // one over another link to this session ends with it
        if (ours && (header.flags & wire::flag::again)) {
            owner->repeat(*call); // an earlier session may have carried it
        } else if (ours) {
            std::size_t head = 12 + (header.flags & wire::flag::traced ? 16 : 0) + (header.flags & wire::flag::numbered ? 8 : 0);
            owner->requeue(*call, incoming_packet(unwritten.body.subspan(head), unwritten.object).keep());
        } else {
            host_.calls().fail(*call, failure(errc::peer_lost, fmt::format("'{}': the session ended before it was called: {}", call->service, cause.message())));
        }
    });
    for (std::size_t at = 0; at < slots_.size(); ++at) {
        auto* call = slots_[at].call;
        if (!call) continue;
        take_slot(call->id);
        if (call->number != 0 && owner && call->owner.get() == owner.get() && !host_.stopping()) {
            owner->repeat(*call);
            continue;
        }
        host_.calls().fail(*call, failure(errc::peer_lost, fmt::format("'{}': the session ended before the answer: {}", call->service, cause.message()), execution::unknown));
    }
    for (auto& [id, subscriber] : std::exchange(subscribers_, {})) subscriber->on_session_end(cause);
    for (auto& [id, waiting] : std::exchange(departures_, {})) {
        waiting->outcome.emplace(failure(errc::peer_lost, fmt::format("the session ended before the answer to the farewell: {}", cause.message()), execution::unknown));
        waiting->answered.resume();
    }
    incoming_.on_session_end();
    if (provided_) provided_->on_session_end();
    if (owner) owner->on_session_end(*this, cause);
    host_.forget(*this);
}

} // namespace ise
