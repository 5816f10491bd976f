#pragma once
#include <ise/core/task.hpp>
#include <ise/core/trace_id.hpp>
#include <ise/core/waiter.hpp>
#include <ise/packet/adapt.hpp>
#include <ise/session/contract.hpp>
#include <ise/session/held_packets.hpp>
#include <ise/subscription/receive_queue.hpp>
#include <ise/subscription/received.hpp>
#include <ise/wire/messages.hpp>

#include <memory>
#include <optional>
#include <string>

namespace ise {

class conversation;
class service_runtime;
class subscriber_core;

/// What stands before a published packet.
struct packet_place {
    std::uint64_t sequence = 0;
    std::uint32_t skipped = 0;
    wall_time published_at = detail::no_stamp;
    trace_id trace;
};

/// A subscriber that left and waits for the provider's answer.
struct departure {
    explicit departure(loop& on) : answered(on) {}

    waiter<> answered;
    std::optional<result<bytes>> outcome;
};

/// What a subscriber asks of the session over which its packets come.
class subscription_session {
public:
    virtual conversation& over() noexcept = 0;
    /// `farewell` is the unsubscribe packet; its answer is for `waiting`, where there is somebody.
    virtual void unsubscribe(subscriber_core& subscriber, bytes_view farewell, std::weak_ptr<departure> waiting) = 0;
    /// Grants more packets to the provider: so many in all.
    virtual void grant(const subscriber_core& subscriber, std::uint64_t total) = 0;
    /// The subscriber of that number, if it is still there.
    virtual subscriber_core* find(std::uint64_t id) const noexcept = 0;

protected:
    ~subscription_session() = default;
};

/// What a subscriber asks of the way to its provider, which subscribes again over every new session.
class subscription_owner {
public:
    virtual service_runtime& runtime() const noexcept = 0;
    /// The provider for people.
    virtual const std::string& name() const noexcept = 0;
    /// Why there is no session; empty: nothing is known against it.
    virtual std::string obstacle() const = 0;
    /// Whether a new session follows one that ended; subscriptions continue over it.
    virtual bool reconnects() const noexcept = 0;
    virtual void attach(subscriber_core& subscriber) = 0;
    virtual void detach(subscriber_core& subscriber) noexcept = 0;
    virtual void on_established(const subscriber_core& subscriber) = 0;
    /// It was given up before there was a session.
    virtual void on_missed(const subscriber_core& subscriber) = 0;

protected:
    ~subscription_owner() = default;
};

/// The policy for packets that a subscriber does not read in time: `keep_latest`, `keep_last`, `lossless`,
/// `disconnect`.
using overflow = wire::overflow;

/// Options of a subscription.
struct subscribe_options {
    /// The policy for packets that the subscriber does not read in time, on both sides: keep the latest, keep the last
    /// `depth`, lossless (the provider keeps up to `depth` packets, and ends the subscription beyond), or end the
    /// subscription at the first packet that would be lost.
    overflow policy = overflow::keep_last;
    std::uint32_t depth = 64; ///< in packets
    duration min_interval{};  ///< rate limit; packets in between are skipped, not lost
    bool last_value = true;   ///< the last packet published before is delivered first
    duration deadline{};      ///< for the first answer; zero: the component's default

    subscribe_options() = default;
    /// Keeps the newest packet only: for states.
    static subscribe_options keep_latest();
    /// The newest `depth` packets.
    static subscribe_options keep_last(std::uint32_t depth);
    /// Every packet, or the end of the subscription. A publisher that awaits `send` waits while `depth` packets wait.
    static subscribe_options lossless(std::uint32_t depth);
    /// Every packet; the subscription ends at the first that would be lost. The publisher never waits.
    static subscribe_options disconnect(std::uint32_t depth);
};

namespace detail {

// Two gaps, one behind the other.
constexpr std::uint64_t gap_of(std::uint64_t first, std::uint64_t then) noexcept {
    return first == unknown_gap || then == unknown_gap ? unknown_gap : first + then;
}

} // namespace detail

/// Counts of the packets of a subscription, with the reason of each drop.
struct subscription_counts {
    std::uint64_t received = 0;         ///< packets that came
    std::uint64_t lost_at_provider = 0; ///< dropped there by the policy, on the way, or while the link was down
    std::uint64_t late = 0;             ///< of these, arrived behind later ones after all, and were dropped (udp)
    std::uint64_t lost_here = 0;        ///< dropped from the queue on this side by the policy
    std::uint64_t skipped = 0;          ///< left out by the rate limit
    std::uint64_t undecodable = 0;      ///< bytes that were no such packet
    std::uint64_t restarts = 0;         ///< gaps of unknown length: the provider restarted or forgot us
    std::uint64_t resumed = 0;          ///< sessions that went on by ticket
};

/// One subscription on the subscriber's side, without its types. Lives on its component's loop; held by the user's
/// subscription object, and known to its owner and its session.
class subscriber_core {
public:
    /// Throws errc::too_large where the unsubscribe packet is beyond what may be decoded.
    subscriber_core(std::shared_ptr<subscription_owner> to, std::string service, const packet_types& types,
                    subscribe_options options, bytes request);
    virtual ~subscriber_core();

    /// Completes when the provider has committed, or refused. Cancellation: terminal, unsubscribes.
    task<result<void>> begin();
    /// Ends it from this side: unsubscribes. Waiting coroutines get the end.
    void unsubscribe();
    /// The same with the user's unsubscribe packet; gives the provider's answer. errc::peer_lost where the provider is
    /// out of reach: it is left all the same. Cancellation: terminal, ends only the wait for the answer.
    task<result<bytes>> leave_with(bytes request, duration deadline);

    const std::string& service() const noexcept { return service_; }
    const packet_types& types() const noexcept { return types_; }
    const subscription_counts& counts() const noexcept { return counts_; }
    bool ended() const noexcept { return ended_.has_value(); }
    const failure& cause() const noexcept { return *ended_; }
    /// Whether packets can come now.
    bool connected() const noexcept { return established_; }

    /// What functions of a subscription that is none throw.
    [[noreturn]] static void throw_empty();

    // For sessions and links.
    wire::subscribe terms() const;
    /// The unsubscribe packet: the user's own, if there is one, with its defaults.
    const bytes& farewell() const noexcept { return farewell_; }
    bool takes_objects() const noexcept { return knows_type(); }
    void on_sent(subscription_session& over, std::uint64_t id);
    result<void> on_subscribed(wire::subscribed answer);
    void on_refused(const failure& why);
    result<void> on_packet(const packet_place& place, incoming_packet& packet);
    /// Frames of packets one behind the other, each with its time and nothing else before the packet: keeps those in
    /// front that are as the rule says, and returns their bytes. The others are for `on_packet`.
    std::size_t take_run(bytes_view frames);
    void on_session_end(const failure& cause);
    void on_ended(const failure& why, std::uint64_t lost);
    std::uint64_t id() const noexcept { return id_; }
    /// Whether a new session resumes it by ticket; else it is made anew there, with the subscribe packet.
    virtual bool resumes() const noexcept { return true; }

protected:
    virtual void take_response(bytes_view response) = 0;
    /// Whether it can take packets as objects of its type, where the provider is in this process.
    virtual bool knows_type() const noexcept { return false; }

    /// The oldest packet of `queue_` was decoded: takes it, and returns how many packets were lost before it, and when
    /// it was published.
    packet_origin take_packet() {
        if (queue_.front_trace() || detail::trace_here()) [[unlikely]]
            follow_trace();
        auto from = queue_.pop();
        if (gap_ != 0) [[unlikely]]
            from.lost_before = detail::gap_of(std::exchange(gap_, 0), from.lost_before);
        let_another_come();
        return from;
    }
    /// The oldest packet of `queue_` is no such packet: it is lost, and the next one reports that.
    void drop_undecodable(const error& why);
    waiter<>::operation wait_for_packet() noexcept { return packet_.wait(); }
    /// Ends it from this side with a cause: unsubscribes.
    void end_here(const failure& why);
    /// The subscribe packet, which every subscription over a new session has; may be changed.
    bytes& request() noexcept { return request_; }
    /// Its session has ended; another one is made.
    virtual void on_session_lost() {}
    /// The subscribe packet goes to this life of a provider.
    virtual void on_sent_to([[maybe_unused]] std::uint64_t incarnation) {}

    loop& on_;
    std::shared_ptr<subscription_owner> owner_;
    subscription_counts counts_;
    subscribe_options options_;
    const std::size_t capacity_;  // of the queue, in packets
    const std::size_t max_bytes_; // of the queue, but for its last packet
    receive_queue queue_;         // in this side's layout

private:
    bool has_room() const noexcept { return queue_.size() < capacity_ && queue_.bytes() < max_bytes_; }
    result<bool> admit(const packet_place& place, incoming_packet& packet);
    void note_received(std::size_t packets);
    void follow_trace();
    void finish(failure why);
    void drop_oldest();
    /// A packet takes no room any more.
    void let_another_come() {
        if (++consumed_ >= grant_at_) [[unlikely]]
            grant();
    }
    void grant();
    void count_undecodable(const error& why);
    void refuse_packets(const failure& why);
    void adapt_to(const std::vector<schema>& theirs, wire::subscribed& answer);
    void establish(const wire::subscribed& answer);

    std::string service_;
    const packet_types& types_;
    bytes request_;
    bytes farewell_;
    std::optional<failure> ended_;
    std::optional<failure> refused_;
    waiter<> packet_;
    waiter<> answer_;
    std::unique_ptr<adapter> adapter_;
    std::unique_ptr<adapter> farewell_adapter_; // of the answer to the unsubscribe packet
    subscription_session* session_ = nullptr;
    std::uint64_t id_ = 0;
    std::optional<wire::resumption> resume_;
    std::uint64_t next_sequence_ = 0;
    std::uint64_t lost_before_ = 0; // the next packet that arrives
    std::uint64_t gap_ = 0;         // before the next packet that is taken, besides what it says itself
    std::uint64_t consumed_ = 0;
    std::uint64_t grant_at_ = 0; // when so many are consumed
    std::uint64_t granted_at_first_ = 0;
    bool established_ = false;
    bool comparing_ = false; // the schema of the published packet was asked for
    held_budget held_room_;
    held_packets<packet_place> held_; // until it is established
};

} // namespace ise
