#include <ise/subscription/incoming_subscriptions.hpp>

#include <ise/packet/codec.hpp>
#include <ise/packet/compatibility.hpp>
#include <ise/wire/body.hpp>
#include <ise/wire/reason.hpp>

#include <fmt/format.h>

#include <utility>
#include <vector>

namespace ise {

using wire::frame_type;

incoming_subscriptions::~incoming_subscriptions() {
    for (auto& [id, one] : by_id_)
        if (one.who) one.who->let_go(*this);
}

result<void> incoming_subscriptions::on_subscribe(const net::carried_frame& received) {
    if (auto good = over().takes_answers(); !good) return good;
    auto terms = wire::read_body<wire::subscribe>(received.body);
    if (!terms) return terms.error();
    auto id = received.header.id;
    if (by_id_.contains(id)) return failure(errc::protocol_error, "a subscription came with a number that is in use");
    if (auto wrong = objection_to(terms->service)) return *wrong;
    auto& runtime = over().runtime();
    if (by_id_.size() >= runtime.options().max_subscriptions_per_session) {
        failure why(errc::overloaded,
                    fmt::format("more than {} subscriptions of one session (max_subscriptions_per_session)",
                                runtime.options().max_subscriptions_per_session));
        runtime.tell(peer_trouble::excess, why.message(), over().caller_name());
        end(id, why, 0);
        return {};
    }
    if (over().wire().lossy() && terms->policy == wire::overflow::lossless) {
        end(id,
            failure(errc::invalid_argument,
                    fmt::format("'{}' cannot be subscribed to without loss over udp", terms->service.service)),
            0);
        return {};
    }
    if (auto denied = over().objection_to_use(service_kind::subscription, terms->service.service, true)) {
        end(id, *denied, 0);
        return {};
    }
    if (over().audited(terms->service.service)) over().note_use(service_kind::subscription, terms->service.service);
    auto publication = services_.find_publication(terms->service.service);
    if (!publication) {
        end(id, services_.no_publication(terms->service.service), 0);
        return {};
    }
    const auto& ours = publication->types();
    if (terms->service.fingerprints.size() != ours.fingerprints.size()) {
        end(id,
            failure(errc::type_mismatch,
                    fmt::format("'{}' has {} packets here, {} at the subscriber", publication->name(),
                                ours.fingerprints.size(), terms->service.fingerprints.size())),
            0);
        return {};
    }
    entry made;
    made.publication = publication;
    by_id_.emplace(id, std::move(made));
    if (terms->service.fingerprints == ours.fingerprints) {
        admit(id, std::move(*terms), nullptr,
              over().wire().passes_objects() && (received.header.flags & wire::flag::objects));
        return {};
    }
    const auto size = received.body.size();
    if (!asked_bytes_.fits(size)) {
        failure why(errc::overloaded,
                    fmt::format("{} bytes of subscribe requests of one session wait for schemas (session_bytes)",
                                asked_bytes_.used + size));
        runtime.tell(peer_trouble::excess, why.message(), over().caller_name());
        end(id, why, 0);
        return {};
    }
    auto fingerprints = terms->service.fingerprints;
    auto held = std::make_shared<asked>(std::move(*terms), size, asked_bytes_);
    by_id_.at(id).comparing = held;
    // Weak: a request that has left is not held until the peer answers about its schemas.
    over().schemas().need(
        std::move(fingerprints),
        [this, id, which = std::weak_ptr(held)](const std::vector<schema>& theirs) {
            if (auto one = compared(id, which)) admit(id, std::move(one->terms), &theirs, false);
        },
        [this, id, which = std::weak_ptr(held)](const failure& why) {
            if (compared(id, which)) end(id, why, 0);
        });
    return {};
}

// It may have left since, and its number may be another's.
std::shared_ptr<incoming_subscriptions::asked> incoming_subscriptions::compared(
    std::uint64_t id, const std::weak_ptr<asked>& which) const {
    const auto found = by_id_.find(id);
    auto one = which.lock();
    return found != by_id_.end() && found->second.comparing == one ? one : nullptr;
}

void incoming_subscriptions::admit(std::uint64_t id, wire::subscribe terms, const std::vector<schema>* theirs,
                                   bool takes_objects) {
    auto& made = by_id_.at(id);
    made.comparing.reset();
    auto held = made.publication;
    auto& publication = *held;
    const auto& ours = publication.types();
    std::unique_ptr<adapter> request;
    if (theirs) {
        std::string diff;
        for (std::size_t place = 0; place < ours.schemas.size(); ++place) {
            bool we_read = place == role::subscribe_request || place == role::unsubscribe_request;
            const auto& reader = we_read ? ours.schemas[place] : (*theirs)[place];
            const auto& writer = we_read ? (*theirs)[place] : ours.schemas[place];
            if (auto wrong = incompatibility(reader, writer))
                diff += fmt::format("{}{}: {}", diff.empty() ? "" : "\n", role::name(service_kind::subscription, place),
                                    *wrong);
        }
        if (!diff.empty()) {
            failure why(errc::type_mismatch,
                        fmt::format("the packets of '{}' differ incompatibly:\n{}", publication.name(), diff));
            over().runtime().tell(peer_trouble::mismatch, why.message(), over().caller_name());
            end(id, why, 0);
            return;
        }
        request = std::make_unique<adapter>((*theirs)[role::subscribe_request], ours.schemas[role::subscribe_request]);
        made.unsubscribe =
            std::make_unique<adapter>((*theirs)[role::unsubscribe_request], ours.schemas[role::unsubscribe_request]);
    }
    wire::subscribed answer;
    answer.fingerprints = ours.fingerprints;
    result<remote_subscriber*> who = failure(errc::refused, {});
    std::uint64_t lost = 0;
    try {
        who = publication.subscribe(*this, terms, request.get(), takes_objects, answer, lost);
    } catch (const error& thrown) {
        who = thrown.why();
    } catch (const std::exception& thrown) {
        who = failure(errc::handler_failed, thrown.what());
    }
    auto found = by_id_.find(id);
    if (found == by_id_.end()) { // what the user's callback did has ended it
        if (who) publication.end(**who, failure(errc::cancelled, {}));
        return;
    }
    if (!who) {
        end(id, who.error(), lost);
        return;
    }
    const auto body = encode(answer);
    const auto what = fmt::format("the answer to a subscription to '{}'", publication.name());
    if (auto wrong = over().too_large(what, body.size())) {
        publication.end(**who, *wrong); // the user's callback has accepted it, and is called back
        end(id, *wrong, 0);
        return;
    }
    found->second.who = *who;
    over().send(frame_type::subscribed, 0, id, [&](buffer& out) { out.append(bytes_view(body)); });
    (*who)->attach(*this, id); // behind the answer
}

void incoming_subscriptions::settle_all() noexcept {
    for (auto& [id, one] : by_id_) one.publication->settle();
}

void incoming_subscriptions::end(std::uint64_t id, const failure& why, std::uint64_t lost) {
    forget(id);
    if (!over().open()) return;
    wire::ended result;
    result.lost = lost;
    result.code = static_cast<std::uint8_t>(why.code());
    result.reason = wire::reason_of(why.message());
    over().send(frame_type::ended, 0, id, [&](buffer& body) { encode(result, body); });
}

result<void> incoming_subscriptions::on_unsubscribe(const net::carried_frame& received) {
    if (auto good = over().takes_answers(); !good) return good;
    auto found = by_id_.find(received.header.id);
    bytes response;
    if (found != by_id_.end()) {
        auto left = std::move(found->second);
        by_id_.erase(found);
        try {
            if (left.who) response = left.publication->unsubscribe(*left.who, received.body, left.unsubscribe.get());
        } catch (const std::exception& thrown) { // the user's callback, or its packet: it has left all the same
            over().runtime().tell(peer_trouble::callback,
                                  fmt::format("'{}': {}", left.publication->name(), thrown.what()),
                                  over().caller_name());
        }
        const auto what = fmt::format("the answer to who left '{}'", left.publication->name());
        if (auto wrong = over().too_large(what, response.size())) {
            over().runtime().tell(peer_trouble::excess, wrong->message(), over().caller_name());
            response.clear();
        }
    } // else it ended meanwhile: the answer is the same
    over().send(frame_type::unsubscribed, 0, received.header.id,
                [&](buffer& body) { body.append(bytes_view(response)); });
    return {};
}

result<void> incoming_subscriptions::on_credit(const net::carried_frame& received) {
    if (received.body.size() != 8) return failure(errc::protocol_error, "a credit frame has 8 bytes");
    auto found = by_id_.find(received.header.id);
    if (found != by_id_.end() && found->second.who)
        found->second.who->grant(detail::load_little<std::uint64_t>(received.body.data()));
    return {};
}

void incoming_subscriptions::review() {
    std::vector<std::pair<std::uint64_t, failure>> over_now;
    for (const auto& [id, one] : by_id_)
        if (auto denied = over().objection_to_use(service_kind::subscription, one.publication->name(), true))
            over_now.emplace_back(id, std::move(*denied));
    end_each(over_now);
}

void incoming_subscriptions::end_all(const failure& why) {
    std::vector<std::pair<std::uint64_t, failure>> over_now;
    for (const auto& [id, one] : by_id_) over_now.emplace_back(id, why);
    end_each(over_now);
}

void incoming_subscriptions::end_each(const std::vector<std::pair<std::uint64_t, failure>>& over_now) {
    for (const auto& [id, why] : over_now) {
        auto found = by_id_.find(id); // the callback of a user may have ended others
        if (found == by_id_.end()) continue;
        if (auto* who = found->second.who) found->second.publication->end(*who, why);
        else end(id, why, 0);
    }
}

void incoming_subscriptions::on_session_end() {
    for (auto& [id, one] : by_id_)
        if (one.who) one.who->detach();
    by_id_.clear();
}

} // namespace ise
