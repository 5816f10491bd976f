#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/function_ref.hpp>
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>
#include <ise/core/waiter.hpp>
#include <ise/packet/adapt.hpp>
#include <ise/packet/packet_object.hpp>
#include <ise/packet/shared_bytes.hpp>
#include <ise/service/contract.hpp>

#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ise {

class service_host;
class session;
class provided_subscription; // and what it takes to send: no user of a publication needs to know
class provided_subscriptions;
namespace wire {
struct subscribe;
struct subscribed;
} // namespace wire

/// Who subscribed, as the provider's callbacks see it.
struct subscriber_info {
    std::string peer;          ///< its path, or its address
    std::uint64_t number = 0;  ///< of this subscriber within the publication
};

/// A packet that is being published: as a frame (`packet_frame`), as an object, or both, as its subscribers need it.
struct published_packet {
    shared_bytes frame;
    shared_packet object;
    bool has_frame = false;
    std::uint64_t sequence = 0;
};

/// Packets that were not sent to a subscriber, by their reason, and subscribers that were ended.
struct publication_losses {
    std::uint64_t replaced = 0;  ///< keep the latest: a newer one came before it was taken
    std::uint64_t overrun = 0;   ///< keep the last N: more than N waited
    std::uint64_t too_many_bytes = 0; ///< max_subscriber_bytes of its session
    std::uint64_t too_large = 0; ///< for what the subscriber accepts
    std::uint64_t ended = 0;     ///< subscribers that were too slow for a policy that drops nothing
};

/// One provided subscription service, without its types: numbers packets, keeps the last one, and gives each
/// subscriber what its policy says. A packet is encoded once, however many subscribe, and never where all of them are in
/// this process and know its type: they share it as it is.
class publication_core {
public:
    publication_core(service_host& host, std::string name, const packet_types& types);
    ~publication_core();

    const std::string& name() const noexcept { return name_; }
    const packet_types& types() const noexcept { return types_; }
    service_host& host() noexcept { return host_; }

    /// Whether a packet that can be shared as an object should be: somebody takes it so, or nobody takes anything. Who needs
    /// a frame gets it from the object.
    bool wants_object() const noexcept;
    /// Encodes a packet once for all subscribers, as a frame that is completed when it is published.
    shared_bytes share(function_ref<void(buffer&)> write_packet);
    /// Publishes to all subscribers; never blocks.
    void publish(published_packet packet);
    /// Publishes to those that `wants` names; for the others it is skipped, which is no loss. It is no last value.
    void publish_to(published_packet packet, function_ref<bool(const subscriber_info&)> wants);
    /// Whether every lossless subscriber that is connected has room for one more packet.
    bool has_room() const noexcept;
    /// Waits until it has.
    task<> wait_for_room();

    std::size_t subscribers() const noexcept;
    std::uint64_t published() const noexcept { return sequence_; }
    /// Packets that wait to be sent, at all subscribers.
    std::size_t queued() const noexcept;
    const publication_losses& losses() const noexcept { return losses_; }

    /// Decides over a subscriber; gives the encoded response.
    using acceptor = std::function<result<bytes>(bytes_view request, const adapter* adapt, const subscriber_info&)>;
    using remover = std::function<bytes(bytes_view request, const adapter* adapt, const subscriber_info&)>;
    acceptor accept;
    remover removed;

    /// Ends all subscriptions: the service is withdrawn.
    void stop(const failure& why);
    /// The component stops: subscribers are let go without being told that it is over, so that they go on with
    /// the next life of the component.
    void let_go();

private:
    friend class provided_subscriptions;
    friend class provided_subscription;
    /// Where it fails, `lost` is how many packets the subscriber has missed for good.
    result<provided_subscription*> subscribe(session& from, const wire::subscribe& terms, const adapter* adapt, bool takes_objects, wire::subscribed& answer,
                                             std::uint64_t& lost);
    result<provided_subscription*> resume(provided_subscription& who, const wire::subscribe& terms, bool takes_objects, wire::subscribed& answer,
                                          std::uint64_t& lost);
    failure cannot_resume(const wire::subscribe& terms, std::uint64_t& lost) const;
    bytes unsubscribe(provided_subscription& who, bytes_view request, const adapter* adapt);
    void end(provided_subscription& who, const failure& why);
    void vanish(provided_subscription& who);
    void drop(provided_subscription& who);
    subscriber_info take_out(provided_subscription& who);
    void room_made();
    time_point held_up_until(provided_subscription& who, time_point since) const;
    void end_holding_up(time_point since);
    void began_to_linger(provided_subscription& who);
    void begin_packet(published_packet& packet);
    shared_bytes frame_of(const shared_packet& object, std::uint64_t sequence);
    std::optional<published_packet> last_packet(bool as_object);
    void end_too_slow(const std::vector<std::uint64_t>& numbers);

    service_host& host_;
    std::string name_;
    const packet_types& types_;
    std::list<provided_subscription*> lingering_; // oldest first; before them, who leave it when they go
    std::list<provided_subscription> all_;
    shared_bytes_maker maker_;
    std::optional<published_packet> last_;
    std::uint64_t usual_id_ = 0; // of a subscription: frames bear it, and most need no other
    std::uint64_t sequence_ = 0; // of the last packet published; the first has 1
    std::uint64_t next_number_ = 1;
    std::vector<waiter<>*> waiting_; // for room
    std::size_t lossless_ = 0;
    std::size_t object_takers_ = 0; // of all_
    bool selective_ = false;        // packets were published for some only
    publication_losses losses_;
    std::optional<failure> stopped_;
};

} // namespace ise
