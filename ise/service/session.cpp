#include <ise/service/session.hpp>

#include <fmt/format.h>

#include <chrono>
#include <set>

namespace ise {

using wire::frame_type;

session::session(const session_context& of, std::shared_ptr<net::connection> connection,
                 std::weak_ptr<session_owner> owner, std::function<void(session&)> on_over)
    : conversation(of.runtime, std::move(connection)), publications_(of.publications), owner_(std::move(owner)),
      on_over_(std::move(on_over)), outgoing_calls_(*this, of.calls),
      incoming_calls_(*this, of.call_services, of.answered), outgoing_subscriptions_(*this) {}

void session::start() { wire().start(runtime().scope(), weak_from_this()); }

incoming_subscriptions& session::subscribers() {
    if (!incoming_subscriptions_)
        incoming_subscriptions_ = std::make_unique<incoming_subscriptions>(*this, publications_);
    return *incoming_subscriptions_;
}

[[gnu::hot]] result<void> session::on_frame(const net::carried_frame& received) {
    switch (received.header.type) {
        case frame_type::request: return incoming_calls_.on_request(received);
        case frame_type::reply: return outgoing_calls_.on_reply(received);
        case frame_type::error: return outgoing_calls_.on_error(received);
        case frame_type::cancel: incoming_calls_.on_cancel(received.header.id); return {};
        case frame_type::introduce: return incoming_calls_.on_introduce(received);
        case frame_type::answers: return outgoing_calls_.on_answers(received);
        case frame_type::subscribe: return subscribers().on_subscribe(received);
        case frame_type::subscribed: return outgoing_subscriptions_.on_subscribed(received);
        case frame_type::packet: return outgoing_subscriptions_.on_packet(received);
        case frame_type::unsubscribe: return subscribers().on_unsubscribe(received);
        case frame_type::unsubscribed: outgoing_subscriptions_.on_unsubscribed(received); return {};
        case frame_type::ended: return outgoing_subscriptions_.on_ended(received);
        case frame_type::credit: return subscribers().on_credit(received);
        case frame_type::schema_request: return schemas().on_request(received.body);
        case frame_type::schema: return schemas().on_answer(received.body);
        case frame_type::hello:
        case frame_type::welcome:
        case frame_type::reject:
        case frame_type::challenge:
        case frame_type::proof:
            return failure(errc::protocol_error,
                           fmt::format("'{}' came in the middle of a session", wire::name_of(received.header.type)));
        default: return {}; // of a later version: passed over, as FORMAT.md says
    }
}

void session::on_closed(const failure& cause) {
    auto self = shared_from_this();
    auto owner = owner_.lock();
    if (broke_rules(cause.code()))
        runtime().tell(peer_trouble::broken, fmt::format("a session was ended: {}", cause.message()), peer_name());
    outgoing_calls_.on_session_end(cause, owner.get());
    outgoing_subscriptions_.on_session_end(cause);
    incoming_calls_.on_session_end();
    if (incoming_subscriptions_) incoming_subscriptions_->on_session_end();
    if (owner) owner->on_session_end(*this, cause);
    on_over_(*this);
}

void session::revoke(failure why) {
    if (!open()) return;
    constexpr duration grace = std::chrono::milliseconds(500); // to take the goodbye
    runtime().tell(peer_trouble::rejected, fmt::format("a session was ended: {}", why.message()), peer_name());
    // Now: a subscription or an action would wait for its requester to come back.
    if (incoming_subscriptions_) incoming_subscriptions_->end_all(why);
    if (!open()) return; // the callback of a user may have ended it
    finish(std::move(why), grace);
}

void session::review_access() {
    if (!open()) return;
    if (auto revoked = objection_to_session()) {
        revoke(std::move(*revoked));
        return;
    }
    incoming_calls_.review();
    if (incoming_subscriptions_) incoming_subscriptions_->review();
}

std::vector<std::string> session::used_services() const {
    std::set<std::string> names;
    outgoing_calls_.add_used(names);
    outgoing_subscriptions_.add_used(names);
    return {names.begin(), names.end()};
}

} // namespace ise
