#include <ise/subscription/incoming_subscriptions.hpp>

#include <ise/packet/codec.hpp>
#include <ise/packet/compatibility.hpp>
#include <ise/wire/body.hpp>

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
    auto fingerprints = terms->service.fingerprints;
    auto asked = std::make_shared<wire::subscribe>(std::move(*terms));
    by_id_.at(id).comparing = asked;
    over().schemas().need(
        std::move(fingerprints),
        [this, id, asked](const std::vector<schema>& theirs) {
            if (compares(id, asked)) admit(id, std::move(*asked), &theirs, false);
        },
        [this, id, asked](const failure& why) {
            if (compares(id, asked)) end(id, why, 0);
        });
    return {};
}

// It may have left since, and its number may be another's.
bool incoming_subscriptions::compares(std::uint64_t id, const std::shared_ptr<wire::subscribe>& asked) const {
    const auto found = by_id_.find(id);
    return found != by_id_.end() && found->second.comparing == asked;
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
    found->second.who = *who;
    over().send(frame_type::subscribed, 0, id, [&](buffer& body) { encode(answer, body); });
    (*who)->attach(*this, id); // behind the answer
}

void incoming_subscriptions::end(std::uint64_t id, const failure& why, std::uint64_t lost) {
    forget(id);
    if (!over().open()) return;
    wire::ended result;
    result.lost = lost;
    result.code = static_cast<std::uint8_t>(why.code());
    result.reason = why.message();
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
