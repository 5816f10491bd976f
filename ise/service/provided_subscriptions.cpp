#include <ise/packet/codec.hpp>
#include <ise/packet/compatibility.hpp>
#include <ise/service/provided_subscription.hpp>
#include <ise/service/service_host.hpp>
#include <ise/service/session.hpp>
#include <ise/wire/body.hpp>

#include <fmt/format.h>

namespace ise {

using wire::frame_type;

provided_subscriptions::~provided_subscriptions() {
    for (auto& [id, one] : by_id_)
        if (one.who) one.who->let_go(session_);
}

result<void> provided_subscriptions::on_subscribe(const wire::frame& received) {
    auto terms = wire::read_body<wire::subscribe>(received.body);
    if (!terms) return terms.error();
    auto id = received.header.id;
    if (by_id_.contains(id)) return failure(errc::protocol_error, "a subscription came with a number that is in use");
    if (auto wrong = objection_to(terms->service)) return *wrong;
    auto& host = session_.host();
    if (by_id_.size() >= host.options().max_subscriptions_per_session) {
        failure why(errc::overloaded, fmt::format("more than {} subscriptions of one session (max_subscriptions_per_session)", host.options().max_subscriptions_per_session));
        host.tell(peer_trouble::excess, why.message(), session_.caller_name());
        refuse(id, why);
        return {};
    }
    if (session_.wire().lossy() && terms->policy == wire::overflow::lossless) {
        refuse(id, failure(errc::invalid_argument, fmt::format("'{}' cannot be subscribed to without loss over udp", terms->service.service)));
        return {};
    }
    auto publication = host.services().find_publication(terms->service.service);
    if (!publication) {
        auto why = host.services().find_calls(terms->service.service)
                       ? fmt::format("'{}' is a request-response service, not a subscription", terms->service.service)
                       : fmt::format("there is no service '{}'", terms->service.service);
        refuse(id, failure(errc::no_such_service, std::move(why)));
        return {};
    }
    const auto& ours = publication->types();
    if (terms->service.fingerprints.size() != ours.fingerprints.size()) {
        refuse(id, failure(errc::type_mismatch, fmt::format("'{}' has {} packets here, {} at the subscriber", publication->name(),
                                                            ours.fingerprints.size(), terms->service.fingerprints.size())));
        return {};
    }
    entry made;
    made.publication = publication;
    by_id_.emplace(id, std::move(made));
    if (terms->service.fingerprints == ours.fingerprints) {
        admit(id, std::move(*terms), nullptr, session_.wire().passes_objects() && (received.header.flags & wire::flag::objects));
        return {};
    }
    auto fingerprints = terms->service.fingerprints;
    auto shared = std::make_shared<wire::subscribe>(std::move(*terms));
    session_.schemas().need(
        std::move(fingerprints),
        [this, id, shared](const std::vector<schema>& theirs) {
            if (by_id_.contains(id)) admit(id, std::move(*shared), &theirs, false);
        },
        [this, id](const failure& why) {
            if (by_id_.contains(id)) refuse(id, why); // else it has left
        });
    return {};
}

void provided_subscriptions::admit(std::uint64_t id, wire::subscribe terms, const std::vector<schema>* theirs, bool takes_objects) {
    auto& made = by_id_.at(id);
    auto& publication = *made.publication;
    const auto& ours = publication.types();
    std::unique_ptr<adapter> request;
    if (theirs) {
        std::string diff;
        for (std::size_t place = 0; place < ours.schemas.size(); ++place) {
            bool we_read = place == role::subscribe_request || place == role::unsubscribe_request;
            const auto& reader = we_read ? ours.schemas[place] : (*theirs)[place];
            const auto& writer = we_read ? (*theirs)[place] : ours.schemas[place];
            if (auto wrong = incompatibility(reader, writer))
                diff += fmt::format("{}{}: {}", diff.empty() ? "" : "\n", role::name(service_kind::subscription, place), *wrong);
        }
        if (!diff.empty()) {
            failure why(errc::type_mismatch, fmt::format("the packets of '{}' differ incompatibly:\n{}", publication.name(), diff));
            session_.host().tell(peer_trouble::mismatch, why.message(), session_.caller_name());
            refuse(id, why);
            return;
        }
        request = std::make_unique<adapter>((*theirs)[role::subscribe_request], ours.schemas[role::subscribe_request]);
        made.unsubscribe = std::make_unique<adapter>((*theirs)[role::unsubscribe_request], ours.schemas[role::unsubscribe_request]);
    }
    wire::subscribed answer;
    answer.fingerprints = ours.fingerprints;
    result<provided_subscription*> who = failure(errc::refused, {});
    std::uint64_t lost = 0;
    try {
        who = publication.subscribe(session_, terms, request.get(), takes_objects, answer, lost);
    } catch (const error& thrown) {
        who = thrown.why();
    } catch (const std::exception& thrown) {
        who = failure(errc::handler_failed, thrown.what());
    }
    if (!who) {
        refuse(id, who.error(), lost);
        return;
    }
    made.who = *who;
    auto& wire = session_.wire();
    wire::put_frame(wire.out().begin_call(), frame_type::subscribed, 0, id, [&](buffer& body) { encode(answer, body); });
    wire.out().end_call();
    made.who->attach(session_, id); // behind the answer
    wire.written();
}

void provided_subscriptions::refuse(std::uint64_t id, const failure& why, std::uint64_t lost) {
    by_id_.erase(id);
    session_.end_provided(id, why, lost);
}

result<void> provided_subscriptions::on_unsubscribe(const wire::frame& received) {
    auto found = by_id_.find(received.header.id);
    auto& wire = session_.wire();
    bytes response;
    if (found != by_id_.end()) {
        auto left = std::move(found->second);
        by_id_.erase(found);
        try {
            if (left.who) response = left.publication->unsubscribe(*left.who, received.body, left.unsubscribe.get());
        } catch (const std::exception& thrown) { // the user's callback, or its packet: it has left all the same
            session_.host().tell(peer_trouble::callback, fmt::format("'{}': {}", left.publication->name(), thrown.what()), session_.caller_name());
        }
    } // else it ended meanwhile: the answer is the same
    wire::put_frame(wire.out().begin_call(), frame_type::unsubscribed, 0, received.header.id, [&](buffer& body) { body.append(bytes_view(response)); });
    wire.out().end_call();
    wire.written();
    return {};
}

result<void> provided_subscriptions::on_credit(const wire::frame& received) {
    if (received.body.size() != 8) return failure(errc::protocol_error, "a credit frame has 8 bytes");
    auto found = by_id_.find(received.header.id);
    if (found != by_id_.end() && found->second.who) found->second.who->grant(detail::load_little<std::uint64_t>(received.body.data()));
    return {};
}

void provided_subscriptions::on_session_end() {
    for (auto& [id, one] : by_id_)
        if (one.who) one.who->detach();
    by_id_.clear();
}

} // namespace ise
