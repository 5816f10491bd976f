#include <ise/service/publication_core.hpp>

#include <ise/packet/codec.hpp>
#include <ise/service/service_host.hpp>
#include <ise/service/session.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace ise {
namespace {

using wire::overflow;

constexpr std::uint32_t deepest = 1u << 20;
// All packets held for one subscriber together; beyond it the policy applies as if the queue were full.
constexpr std::size_t max_queue_bytes = 256u << 20;

} // namespace

provided_subscription::provided_subscription(publication_core& of, const wire::subscribe& terms, std::uint64_t number)
    : publication_(of), policy_(terms.policy), depth_(std::clamp<std::uint32_t>(terms.depth, 1, deepest)), credit_(terms.credit),
      min_interval_(static_cast<std::int64_t>(std::min<std::uint64_t>(terms.min_interval_ns, std::int64_t{1} << 62))) {
    if (policy_ == overflow::keep_latest) depth_ = 1;
    auto& env = of.host().env();
    for (std::size_t half = 0; half < ticket_.size(); half += 8) detail::store_little(reinterpret_cast<std::byte*>(&ticket_[half]), env.random());
    info_.number = number;
    if (policy_ == overflow::lossless) ++publication_.lossless_;
}

provided_subscription::~provided_subscription() {
    if (session_) session_->wire().out().remove(*this);
    if (policy_ == overflow::lossless) --publication_.lossless_;
}

void provided_subscription::attach(session& over, std::uint64_t id) {
    linger_.reset();
    session_ = &over;
    id_ = id;
    sent_ = 0;
    info_.peer = over.peer_name();
    wake();
}

void provided_subscription::detach() {
    if (!session_) return;
    session_->wire().out().remove(*this);
    session_ = nullptr;
    auto& host = publication_.host();
    linger_ = std::make_unique<timer>(host.on(), [this] { publication_.vanish(*this); });
    linger_->arm(saturating_add(host.on().now(), host.options().linger));
}

bool provided_subscription::may_send() const noexcept { return policy_ != overflow::lossless || sent_ < credit_; }
bool provided_subscription::has_room() const noexcept { return policy_ != overflow::lossless || queue_.size() < depth_; }

void provided_subscription::wake() {
    if (!session_ || queue_.empty() || !may_send()) return;
    session_->wire().out().add(*this);
    session_->wire().written();
}

void provided_subscription::grant(std::uint64_t total) {
    if (total <= credit_) return;
    credit_ = total;
    wake();
}

void provided_subscription::offer(std::uint64_t sequence, const std::shared_ptr<const bytes>& packet, time_point now) {
    if (min_interval_ > duration{}) {
        if (now < next_allowed_) {
            ++skipped_;
            return;
        }
        next_allowed_ = saturating_add(now, min_interval_);
    }
    while (queue_.size() >= depth_ || (queue_bytes_ + packet->size() > max_queue_bytes && !queue_.empty())) {
        if (policy_ == overflow::lossless || policy_ == overflow::disconnect) {
            publication_.end(*this, failure(errc::overloaded, fmt::format("the subscriber of '{}' did not take {} packets in time",
                                                                          publication_.name(), queue_.size())));
            return; // *this is gone
        }
        auto& oldest = queue_.front();
        std::uint32_t inherited = oldest.skipped;
        queue_bytes_ -= oldest.packet->size();
        queue_.pop_front();
        (queue_.empty() ? skipped_ : queue_.front().skipped) += inherited;
        ++dropped_;
        ++publication_.host().counts().packets_dropped;
    }
    queue_.push_back(item{sequence, std::exchange(skipped_, 0), packet});
    queue_bytes_ += packet->size();
    wake();
}

bool provided_subscription::take(net::outbox& out, std::size_t quantum) {
    std::size_t taken = 0;
    while (!queue_.empty() && may_send() && taken < quantum) {
        auto& next = queue_.front();
        std::array<std::byte, 12> head;
        detail::store_little(head.data(), next.sequence);
        detail::store_little(head.data() + 8, next.skipped);
        wire::frame_header header;
        header.type = wire::frame_type::packet;
        header.flags = next.skipped ? wire::flag::skipped : std::uint8_t{0};
        header.id = id_;
        out.put_packet(*this, header, bytes_view(head).first(next.skipped ? 12 : 8), next.packet);
        std::size_t size = next.packet->size();
        taken += size + wire::frame_header::size;
        queue_bytes_ -= size;
        queue_.pop_front();
        ++sent_;
        if (size > net::outbox::whole_bytes) break; // goes in pieces: the rest waits for it
    }
    if (policy_ == overflow::lossless) publication_.room_made();
    return !queue_.empty() && may_send();
}

publication_core::publication_core(service_host& host, std::string name, const packet_types& types)
    : host_(host), name_(std::move(name)), types_(types), room_(host.on(), [this] { room_.resume(); }) {}

publication_core::~publication_core() = default;

void publication_core::publish(std::shared_ptr<const bytes> packet) {
    ++sequence_;
    ++host_.counts().packets_published;
    last_ = packet;
    auto now = host_.on().now();
    for (auto who = all_.begin(); who != all_.end();) {
        auto next = std::next(who); // offering may end it
        who->offer(sequence_, packet, now);
        who = next;
    }
}

void publication_core::publish_to(std::shared_ptr<const bytes> packet, function_ref<bool(const subscriber_info&)> wants) {
    ++sequence_;
    ++host_.counts().packets_published;
    auto now = host_.on().now();
    for (auto who = all_.begin(); who != all_.end();) {
        auto next = std::next(who); // offering may end it
        if (wants(who->info())) {
            who->offer(sequence_, packet, now);
        } else {
            who->pass();
        }
        who = next;
    }
}

bool publication_core::has_room() const noexcept {
    if (lossless_ == 0) return true;
    for (const auto& who : all_)
        if (!who.has_room()) return false;
    return true;
}

task<> publication_core::wait_for_room() {
    while (!has_room()) co_await room_.wait();
}

void publication_core::room_made() {
    if (room_.waiting() && has_room()) room_.resume();
}

result<provided_subscription*> publication_core::subscribe(session& from, const wire::subscribe& terms, const adapter* adapt,
                                                           wire::subscribed& answer) {
    answer.incarnation = host_.self().incarnation;
    if (!terms.resume.empty() && terms.resume.front().incarnation == host_.self().incarnation) {
        const auto& wanted = terms.resume.front();
        for (auto& who : all_) {
            if (who.ticket() != wanted.ticket) continue;
            who.detach(); // its old session may not have noticed yet
            who.credit_ = terms.credit;
            // What was sent and did not arrive is a gap that the sequence tells.
            answer.ticket = who.ticket();
            answer.first_sequence = wanted.next_sequence;
            answer.resumed = true;
            return &who;
        }
    }
    auto& who = all_.emplace_back(*this, terms, next_number_++);
    who.info_.peer = from.peer_name();
    bytes response;
    if (accept) {
        auto decided = accept(std::as_bytes(std::span(terms.request)), adapt, who.info_);
        if (!decided) {
            all_.pop_back();
            return decided.error();
        }
        response = std::move(*decided);
    }
    answer.ticket = who.ticket();
    answer.response.assign(reinterpret_cast<const std::uint8_t*>(response.data()),
                           reinterpret_cast<const std::uint8_t*>(response.data()) + response.size());
    bool with_last = terms.last_value && last_;
    answer.first_sequence = with_last ? sequence_ : sequence_ + 1;
    if (with_last) who.offer(sequence_, last_, host_.on().now());
    return &who;
}

bytes publication_core::unsubscribe(provided_subscription& who, bytes_view request, const adapter* adapt) {
    bytes response;
    if (removed) response = removed(request, adapt, who.info_);
    all_.remove_if([&](const provided_subscription& entry) { return &entry == &who; });
    room_made();
    return response;
}

void publication_core::end(provided_subscription& who, const failure& why) {
    if (who.session_) who.session_->end_provided(who.id_, why);
    if (removed) removed({}, nullptr, who.info_);
    all_.remove_if([&](const provided_subscription& entry) { return &entry == &who; });
    room_made();
}

void publication_core::vanish(provided_subscription& who) {
    host_.log().debug("a subscriber did not come back", {{"service", name_}, {"peer", who.info_.peer}});
    if (removed) removed({}, nullptr, who.info_);
    all_.remove_if([&](const provided_subscription& entry) { return &entry == &who; });
    room_made();
}

void publication_core::stop(const failure& why) {
    while (!all_.empty()) end(all_.front(), why);
    room_.resume();
}

} // namespace ise
