#include <ise/session/conversation.hpp>

#include <ise/access/guard.hpp>
#include <ise/core/limits.hpp>
#include <ise/core/real/ownership.hpp>

#include <fmt/format.h>

namespace ise {

conversation::conversation(service_runtime& runtime, std::shared_ptr<net::connection> connection)
    : runtime_(runtime), connection_(std::move(connection)),
      schemas_(runtime.schemas(), *connection_, runtime.options().session_bytes),
      over_(peer().path.empty() ? transport_of(peer_name()) : nullptr) {
    auto policy = runtime.access() ? runtime.access()->current() : nullptr;
    connection_->identify_peer(access::identity_of(verified(), runtime.own_identity(), policy.get()));
}

conversation::~conversation() {
    if (counted_in_) counted_in_->forget(*connection_);
}

bool of_its_maker(const service_runtime& runtime, const verified_peer& peer) {
    return runtime.self().path.empty() && is_own_user(peer.user);
}

std::optional<failure> conversation::objection_to_use(service_kind kind, const std::string& service, bool note) {
    auto* guard = runtime_.access();
    if (!guard || verified().same_process) return {};
    if (service.starts_with("ise.process.") && of_its_maker(runtime_, verified())) return {};
    if (!view_) view_ = std::make_unique<access::view>(guard->current(), verified().who);
    const auto& titles = runtime_.titles();
    auto what = access::request_for(kind == service_kind::subscription, titles, service);
    if (what.item.data() != service.data()) { // a service of ISE itself may have a rule of its own
        auto plain = what;
        plain.what = kind == service_kind::subscription ? access::action::subscribe : access::action::call;
        plain.item = service;
        auto said = view_->decide(plain);
        if (said.allowed && !view_->decide(what).denied) return {};
        if (said.denied) what = plain;
    }
    return guard->objection(*view_, verified(), what, runtime_.self().path, note);
}

bool conversation::audited(const std::string& service) const {
    auto* guard = runtime_.access();
    return guard && !verified().same_process && guard->audit().keeps() &&
           guard->current()->audited(runtime_.titles(), service);
}

void conversation::note_use(service_kind kind, const std::string& service) {
    auto* guard = runtime_.access();
    if (!guard || !view_) return;
    auto what = access::request_for(kind == service_kind::subscription, runtime_.titles(), service);
    auto said = view_->decide(what);
    if (!said.allowed) { // a rule of its own allowed it
        what.what = kind == service_kind::subscription ? access::action::subscribe : access::action::call;
        what.item = service;
        said = view_->decide(what);
    }
    guard->note(verified(), what, runtime_.self().path, said);
}

std::optional<failure> conversation::objection_to_session() {
    auto* guard = runtime_.access();
    if (!guard || verified().same_process) return {};
    auto policy = guard->current();
    view_.reset();
    if (access::identity_of(verified(), runtime_.own_identity(), policy.get()) != verified().who)
        return failure(errc::access_denied,
                       fmt::format("the access policy has another identity for {} now", access::shown(verified().who)));
    if (peer().path.empty() || of_its_maker(runtime_, verified())) return {};
    const std::string named[] = {peer().path};
    access::request what;
    what.what = access::action::name;
    what.targets = named;
    return guard->objection(&verified(), what, runtime_.self().path, false);
}

std::string conversation::caller_name() const {
    if (!over_ || !over_->same_host) return peer_name();
    if (over_->same_process) return "a component without a name in the same process";
    return "a component without a name on the same host";
}

std::optional<failure> conversation::too_large(std::string_view what, std::size_t size) const {
    const auto most = connection_->terms().peer_accepts.max_message_bytes;
    if (size <= most) return std::nullopt;
    return failure(errc::too_large, fmt::format("{} has {} bytes, the peer accepts {} (max_message_bytes){}", what,
                                                size, most, connection_->lossy() ? " over udp; use tcp" : ""));
}

void conversation::send(wire::frame_type type, std::uint8_t flags, std::uint64_t id,
                        function_ref<void(buffer&)> write_body) {
    auto& calls = connection_->out().calls();
    const auto start = calls.size();
    wire::put_frame(calls, type, flags, id, write_body);
    connection_->out().end_call(start);
    connection_->written();
}

void conversation::send_ahead(wire::frame_type type, std::uint64_t id, function_ref<void(buffer&)> write_body) {
    wire::put_frame(connection_->out().control(), type, 0, id, write_body);
    connection_->written();
}

std::optional<failure> conversation::replies_not_taken(execution state, std::size_t besides) {
    auto unsent = connection_->out().pending_call_bytes() - besides;
    if (unsent > runtime_.options().session_bytes)
        return failure(errc::overloaded,
                       fmt::format("{} bytes of replies wait for being taken (session_bytes)", unsent), state);
    counted_in_ = runtime_.hosts();
    auto of_host = counted_in_->with(*connection_).unread_replies - besides;
    if (of_host <= runtime_.options().host_bytes()) return std::nullopt;
    return failure(
        errc::overloaded,
        fmt::format("{} bytes of replies wait for being taken by sessions of one host (host_bytes)", of_host), state);
}

result<void> conversation::takes_answers() {
    auto unsent = connection_->out().pending_call_bytes();
    if (unsent > 2 * runtime_.options().session_bytes)
        return failure(errc::overloaded,
                       fmt::format("does not take its answers: {} bytes of them wait (session_bytes)", unsent));
    if (!replies_wait()) return {};
    counted_in_ = runtime_.hosts();
    auto of_host = counted_in_->with(*connection_).unread_replies;
    if (of_host <= 2 * runtime_.options().host_bytes()) return {};
    return failure(errc::overloaded,
                   fmt::format("does not take its answers: {} bytes of them wait for its host (host_bytes)", of_host));
}

[[gnu::hot]] result<void> conversation::messages_fit() {
    if (connection_->unfinished_bytes() <= host_memory::free_bytes) return {};
    counted_in_ = runtime_.hosts();
    auto of_host = counted_in_->with(*connection_).unfinished_messages;
    if (of_host <= runtime_.options().unfinished_bytes()) return {};
    return failure(errc::too_large,
                   fmt::format("unfinished messages from its host hold {} bytes (unfinished_bytes)", of_host));
}

std::optional<failure> objection_to(const wire::introduction& result) {
    if (result.service.size() > limit::service_name_bytes)
        return failure(errc::too_large,
                       fmt::format("the name of a service has {} bytes, {} are allowed (service_name_bytes)",
                                   result.service.size(), limit::service_name_bytes));
    if (result.fingerprints.size() > limit::service_fingerprints)
        return failure(errc::too_large,
                       fmt::format("'{}' was introduced with {} packets, {} are allowed (service_fingerprints)",
                                   result.service, result.fingerprints.size(), limit::service_fingerprints));
    return std::nullopt;
}

} // namespace ise
