#include <ise/subscription/subscriber_core.hpp>

#include <ise/packet/compatibility.hpp>
#include <ise/session/conversation.hpp>
#include <ise/session/tracer.hpp>
#include <ise/subscription/packet_frame.hpp>

#include <fmt/format.h>

namespace ise {

using detail::gap_of;

namespace {

// New credit is granted in portions: a frame for every packet would cost as much as the packet.
std::uint64_t portion_of(std::size_t capacity) { return std::max<std::uint64_t>(1, capacity / 2); }

} // namespace

subscribe_options subscribe_options::keep_latest() {
    subscribe_options made;
    made.policy = overflow::keep_latest;
    made.depth = 1;
    return made;
}

subscribe_options subscribe_options::keep_last(std::uint32_t depth) {
    subscribe_options made;
    made.depth = depth;
    return made;
}

subscribe_options subscribe_options::lossless(std::uint32_t depth) {
    subscribe_options made;
    made.policy = overflow::lossless;
    made.depth = depth;
    return made;
}

subscribe_options subscribe_options::disconnect(std::uint32_t depth) {
    subscribe_options made;
    made.policy = overflow::disconnect;
    made.depth = depth;
    return made;
}

subscriber_core::subscriber_core(std::shared_ptr<subscription_owner> to, std::string service, const packet_types& types,
                                 subscribe_options options, bytes request)
    : on_(to->runtime().on()), owner_(std::move(to)), options_(options),
      capacity_(options.policy == overflow::keep_latest ? 1 : std::max<std::size_t>(options.depth, 1)),
      max_bytes_(owner_->runtime().options().queued_bytes()), service_(std::move(service)), types_(types),
      request_(std::move(request)), farewell_(adapt(schema(), types.schemas[role::unsubscribe_request], {})),
      packet_(on_), answer_(on_), held_room_{owner_->runtime().options().held_bytes()}, held_(capacity_, held_room_) {}

subscriber_core::~subscriber_core() = default;

void subscriber_core::throw_empty() {
    throw error(errc::invalid_argument, "an empty subscription: assign what `subscribe(service)` gave first");
}

task<result<void>> subscriber_core::begin() {
    auto limit = options_.deadline > duration{} ? options_.deadline : owner_->runtime().options().default_deadline;
    bool late = false;
    timer deadline(on_, [&] {
        late = true;
        answer_.resume();
    });
    deadline.arm(saturating_add(on_.now(), limit));
    owner_->attach(*this);
    if (!established_ && !refused_) co_await answer_.wait();
    // Committed is committed, also where the session has ended again before this runs: the link goes on by the ticket.
    if (established_ || (resume_ && !refused_)) co_return result<void>();
    auto why = refused_ ? *refused_
               : late   ? failure(errc::timed_out,
                                  fmt::format("'{}' at {} was not subscribed to in time{}{}", service_, owner_->name(),
                                            owner_->obstacle().empty() ? "" : ": ", owner_->obstacle()))
                        : failure(errc::cancelled, fmt::format("subscribing to '{}' was cancelled", service_));
    if (late && !session_) owner_->on_missed(*this);
    unsubscribe();
    co_return why;
}

void subscriber_core::unsubscribe() {
    if (session_) session_->unsubscribe(*this, farewell_, {});
    session_ = nullptr;
    established_ = false;
    owner_->detach(*this);
    if (!ended_) finish(failure(errc::cancelled, fmt::format("the subscription to '{}' was left", service_)));
}

task<result<bytes>> subscriber_core::leave_with(bytes request, duration deadline) {
    if (ended_) co_return *ended_;
    if (!session_ || !established_) {
        unsubscribe();
        co_return failure(
            errc::peer_lost,
            fmt::format("'{}' at {} was left while it was out of reach: it was not asked", service_, owner_->name()));
    }
    auto going = std::make_shared<departure>(on_);
    timer alarm(on_, [going] { going->answered.resume(); });
    alarm.arm(
        saturating_add(on_.now(), deadline > duration{} ? deadline : owner_->runtime().options().default_deadline));
    session_->unsubscribe(*this, request, going);
    session_ = nullptr;
    unsubscribe();
    if (!going->outcome) co_await going->answered.wait();
    if (!going->outcome)
        co_return failure(errc::timed_out,
                          fmt::format("'{}' at {} was left, and did not answer in time", service_, owner_->name()),
                          execution::unknown);
    if (!*going->outcome) co_return going->outcome->error();
    auto& raw = **going->outcome;
    if (raw.empty() && !adapt(schema(), types_.schemas[role::unsubscribe_response], {}).empty())
        co_return failure(errc::handler_failed,
                          fmt::format("'{}' at {} was left, and gave no answer: it had ended, or failed over it",
                                      service_, owner_->name()),
                          execution::unknown);
    if (raw.empty() || !farewell_adapter_) co_return std::move(raw);
    try {
        co_return (*farewell_adapter_)(raw);
    } catch (const error& unfit) {
        co_return unfit.why();
    }
}

void subscriber_core::finish(failure why) {
    ended_ = std::move(why);
    packet_.resume();
    answer_.resume();
}

wire::subscribe subscriber_core::terms() const {
    wire::subscribe made;
    made.service.service = service_;
    made.service.fingerprints = types_.fingerprints;
    made.policy = options_.policy;
    made.depth = static_cast<std::uint32_t>(capacity_);
    made.credit = capacity_ - std::min(queue_.size(), capacity_);
    made.min_interval_ns = static_cast<std::uint64_t>(std::max<std::int64_t>(0, options_.min_interval.count()));
    made.last_value = options_.last_value;
    if (resume_ && resumes()) {
        made.resume.push_back(*resume_);
        made.resume.back().next_sequence = next_sequence_;
    }
    made.request.assign(reinterpret_cast<const std::uint8_t*>(request_.data()),
                        reinterpret_cast<const std::uint8_t*>(request_.data()) + request_.size());
    return made;
}

void subscriber_core::on_sent(subscription_session& over, std::uint64_t id) {
    session_ = &over;
    id_ = id;
    consumed_ = 0;
    granted_at_first_ = capacity_ - std::min(queue_.size(), capacity_); // as terms() said
    grant_at_ =
        options_.policy == overflow::lossless ? portion_of(capacity_) : std::numeric_limits<std::uint64_t>::max();
    held_.clear();
    comparing_ = false;
    on_sent_to(over.over().wire().terms().peer.incarnation);
}

result<void> subscriber_core::on_subscribed(wire::subscribed answer) {
    if (established_ || comparing_) return failure(errc::protocol_error, "a subscription was answered twice");
    if (answer.fingerprints.size() != types_.fingerprints.size())
        return failure(errc::protocol_error, "a subscription was answered with the packets of another kind");
    if (answer.fingerprints == types_.fingerprints) {
        adapter_.reset();
        farewell_adapter_.reset();
        establish(answer);
        return {};
    }
    comparing_ = true;
    auto shared = std::make_shared<wire::subscribed>(std::move(answer));
    auto id = id_;
    // The subscription may be gone when the schemas come: it is looked up then.
    auto refuse = [over = session_, id](const failure& why) {
        if (auto* who = over->find(id)) who->refuse_packets(why);
    };
    session_->over().schemas().need(
        {shared->fingerprints[role::subscribe_response], shared->fingerprints[role::published],
         shared->fingerprints[role::unsubscribe_response]},
        [over = session_, id, shared, refuse](const std::vector<schema>& theirs) {
            auto* who = over->find(id);
            if (!who) return;
            try {
                who->adapt_to(theirs, *shared);
            } catch (const error& incompatible) {
                refuse(incompatible.why());
                return;
            }
            who->establish(*shared);
        },
        refuse);
    return {};
}

void subscriber_core::refuse_packets(const failure& why) {
    end_here(failure(errc::type_mismatch, fmt::format("'{}' at {}: {}", service_, owner_->name(), why.message())));
}

void subscriber_core::adapt_to(const std::vector<schema>& theirs, wire::subscribed& answer) {
    adapter adapt(theirs[0], types_.schemas[role::subscribe_response]);
    farewell_adapter_ = std::make_unique<adapter>(theirs[2], types_.schemas[role::unsubscribe_response]);
    if (!answer.resumed) { // else there is no response: it came in the first session
        auto adapted = adapt(std::as_bytes(std::span(answer.response)));
        auto* raw = reinterpret_cast<const std::uint8_t*>(adapted.data());
        answer.response.assign(raw, raw + adapted.size());
    }
    adapter_ = std::make_unique<adapter>(theirs[1], types_.schemas[role::published]);
    if (adapter_->is_identity()) adapter_.reset();
}

void subscriber_core::establish(const wire::subscribed& answer) {
    bool again = resume_.has_value();
    if (answer.resumed) {
        ++counts_.resumed;
    } else {
        if (again) {
            ++counts_.restarts;
            lost_before_ = detail::unknown_gap;
        }
        if (again && options_.policy == overflow::lossless) { // by a provider that does not know better
            end_here(failure(errc::peer_lost, fmt::format("an unknown number of packets of '{}' from {} were lost",
                                                          service_, owner_->name())));
            return;
        }
        next_sequence_ = answer.first_sequence;
    }
    wire::resumption point;
    point.ticket = answer.ticket;
    point.incarnation = answer.incarnation;
    resume_ = point;
    comparing_ = false;
    established_ = true;
    owner_->on_established(*this);
    if (!again) owner_->runtime().on_subscribed(service_, owner_->name());
    try {
        take_response(std::as_bytes(std::span(answer.response)));
    } catch (const error& unreadable) {
        end_here(unreadable.why());
        return;
    }
    if (consumed_ >= grant_at_) grant();
    answer_.resume();
    held_.release([this](const packet_place& place, incoming_packet packet) {
        [[maybe_unused]] auto taken = on_packet(place, packet);
    });
}

void subscriber_core::on_refused(const failure& why) {
    const bool committed = resume_.has_value();
    established_ = false;
    refused_ = why;
    owner_->detach(*this);
    if (auto& host = owner_->runtime(); committed && !host.stopping())
        host.on_subscription_ended(service_, owner_->name(), why);
    finish(why);
}

void subscriber_core::on_ended(const failure& why, std::uint64_t lost) {
    session_ = nullptr;
    if (lost == wire::unknown_loss) ++counts_.restarts;
    else counts_.lost_at_provider += lost;
    on_refused(why);
}

void subscriber_core::end_here(const failure& why) {
    if (session_) session_->unsubscribe(*this, farewell_, {});
    session_ = nullptr;
    on_refused(why);
}

void subscriber_core::on_session_end(const failure& cause) {
    session_ = nullptr;
    established_ = false;
    comparing_ = false;
    held_.clear();
    // The link makes a new session and subscribes again, unless there was only this one.
    if (owner_->reconnects()) on_session_lost();
    else on_refused(cause);
}

result<void> subscriber_core::on_packet(const packet_place& place, incoming_packet& packet) {
    // The rule, as in `take_run`.
    if (place.sequence == next_sequence_ && established_ && place.skipped == 0 && !adapter_ && has_room()) [[likely]] {
        ++next_sequence_;
    } else {
        auto admitted = admit(place, packet);
        if (!admitted) return admitted.error();
        if (!*admitted) return {};
    }
    packet_origin from;
    from.lost_before = std::exchange(lost_before_, 0);
    from.published_at = place.published_at;
    traced_arrival traced;
    if (place.trace) [[unlikely]]
        traced = {place.trace, on_.now()};
    const auto* trace = place.trace ? &traced : nullptr;
    if (packet.object() && !packet.adapt) queue_.push(std::move(*packet.object()), from, trace);
    else queue_.push(packet.bytes(), from, trace);
    note_received(1);
    return {};
}

// The rule: each is the next one, and there is room for it.
[[gnu::hot]] std::size_t subscriber_core::take_run(bytes_view frames) {
    if (!established_ || adapter_ || lost_before_ != 0 || !has_room()) return 0;
    std::size_t size = 0, packets = 0;
    for (const auto room = capacity_ - queue_.size(); packets < room && size < frames.size(); ++packets) {
        const auto* frame = frames.data() + size;
        const auto whole = packet_frame::size_of(frame);
        if (whole < packet_frame::head_bytes || packet_frame::sequence_of(frame) != next_sequence_) break;
        ++next_sequence_;
        size += whole;
    }
    if (packets == 0) return 0;
    queue_.push_run(frames.first(size), packets);
    note_received(packets);
    return size;
}

void subscriber_core::note_received(std::size_t packets) {
    counts_.received += packets;
    owner_->runtime().counts().packets_received += packets;
    packet_.resume();
}

// One that is not as the rule says: whether it is kept.
result<bool> subscriber_core::admit(const packet_place& place, incoming_packet& packet) {
    const auto sequence = place.sequence;
    const auto skipped = place.skipped;
    if (!established_) {
        while (!held_.hold(place, packet)) held_.drop_oldest();
        return false;
    }
    if (sequence < next_sequence_ && session_ && session_->over().wire().lossy()) {
        ++counts_.late;
        return false;
    }
    if (sequence < next_sequence_)
        return failure(errc::protocol_error,
                       fmt::format("packet {} of '{}' came after packet {}", sequence, service_, next_sequence_ - 1));
    std::uint64_t missing = sequence - next_sequence_;
    std::uint64_t lost = missing > skipped ? missing - skipped : 0;
    counts_.skipped += std::min<std::uint64_t>(missing, skipped);
    counts_.lost_at_provider += lost;
    owner_->runtime().counts().packets_lost += lost;
    lost_before_ = gap_of(lost_before_, lost);
    next_sequence_ = sequence + 1;
    if (lost > 0 && options_.policy == overflow::lossless) { // such as one that is too large for this side
        end_here(failure(errc::overloaded,
                         fmt::format("{} packets of '{}' from {} were lost", lost, service_, owner_->name())));
        return false;
    }
    while (!has_room()) {
        if (options_.policy == overflow::disconnect || options_.policy == overflow::lossless) {
            // Lossless: the provider sent more than the credit it was given.
            end_here(failure(errc::overloaded,
                             fmt::format("{} packets of '{}' were not taken in time", queue_.size(), service_)));
            return false;
        }
        drop_oldest();
        ++counts_.lost_here;
        ++owner_->runtime().counts().packets_lost;
    }
    if (!adapter_) return true;
    try { // now, as the next session may have another one
        packet.adapt = adapter_.get();
        packet.bytes();
        return true;
    } catch (const error& unreadable) {
        count_undecodable(unreadable);
        lost_before_ = gap_of(lost_before_, 1);
        let_another_come();
        return false;
    }
}

void subscriber_core::drop_oldest() { gap_ = gap_of(gap_of(gap_, queue_.pop().lost_before), 1); }

// The coroutine that takes the packet works for its trace from here on, unless it works for a call.
void subscriber_core::follow_trace() {
    trace_id in;
    if (const auto* arrived = queue_.front_trace()) {
        in = arrived->trace;
        auto& runtime = owner_->runtime();
        if (auto* traces = runtime.options().traces.get()) {
            const auto id = traces->next_id();
            traces->ended(in, id, span::side::consumer, {}, arrived->came, runtime.env().now() - arrived->came,
                          service_, runtime.self().path, owner_->name());
            in.parent = id;
        }
    }
    work_for(in);
}

// Credit is sent ahead of everything else: before the answer it could arrive before the subscribe packet.
void subscriber_core::grant() {
    if (!established_) return;
    grant_at_ = consumed_ + portion_of(capacity_);
    session_->grant(*this, granted_at_first_ + consumed_);
}

void subscriber_core::drop_undecodable(const error& why) {
    --counts_.received;
    count_undecodable(why);
    gap_ = gap_of(take_packet().lost_before, 1);
}

void subscriber_core::count_undecodable(const error& why) {
    ++counts_.undecodable;
    if (counts_.undecodable == 1)
        owner_->runtime().log().warning(why.what(), {{"service", service_}, {"peer", owner_->name()}});
}

} // namespace ise
