#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/function_ref.hpp>
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>
#include <ise/core/waiter.hpp>
#include <ise/net/outbox.hpp>
#include <ise/packet/adapt.hpp>
#include <ise/packet/shared_bytes.hpp>
#include <ise/service/contract.hpp>
#include <ise/service/waiting_packets.hpp>
#include <ise/wire/messages.hpp>

#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ise {

class service_host;
class session;
class publication_core;
class provided_subscriptions;

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

/// One subscriber at the provider: its queue, its policy, and the session it is reached over, if any.
class provided_subscription final : public net::publication_source {
public:
    provided_subscription(publication_core& of, const wire::subscribe& terms, subscriber_info info, bool takes_objects);
    ~provided_subscription();

    void attach(session& over, std::uint64_t id);
    /// The session is gone; packets go on being kept by the policy until it comes back or the linger is over.
    void detach();
    /// Its session is destroyed without having ended, as its loop has.
    void let_go(const session& of);
    bool attached() const noexcept { return session_ != nullptr; }

    /// False: the queue is full, and the policy is to end it then.
    bool offer(const published_packet& packet);
    /// Whether it is given objects, where there are any; else frames.
    void take_objects(bool wanted) noexcept;
    /// A packet was published that is not meant for this one.
    void pass() noexcept { ++skipped_; }
    void grant(std::uint64_t total);
    bool has_room() const noexcept;
    bool take(net::outbox& out, std::size_t quantum) override;

    const wire::ticket& ticket() const noexcept { return ticket_; }
    std::uint64_t id() const noexcept { return id_; }
    session* over() const noexcept { return session_; }
    const subscriber_info& info() const noexcept { return info_; }
    std::uint64_t dropped() const noexcept { return dropped_; }
    std::size_t queued() const noexcept { return queue_.size(); }

private:
    friend class publication_core;
    void wake();
    waiting_packets::stretch pop(std::size_t most);
    void popped(const waiting_packets::stretch& taken) noexcept;
    void put_alone(net::outbox& out);
    void drop_oldest(std::uint64_t& reason);
    bool full(std::size_t more) const noexcept;
    void put_object(net::outbox& out);
    void write_objects();
    void stop_lingering();
    bool may_send() const noexcept;

    publication_core& publication_;
    session* session_ = nullptr;
    std::uint64_t id_ = 0;
    wire::ticket ticket_{};
    bool takes_objects_ = false;
    wire::overflow policy_;
    std::size_t depth_;
    std::uint64_t credit_;     // lossless: total granted
    duration min_interval_;
    waiting_packets queue_;
    std::uint64_t sent_ = 0;
    std::uint64_t dropped_ = 0;
    std::uint32_t skipped_ = 0; // since the last packet that was queued
    time_point next_allowed_{};
    time_point full_since_ = time_point::max(); // lossless: nothing was taken since
    subscriber_info info_;
    std::unique_ptr<timer> linger_;
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
    bool wants_object() const noexcept { return object_takers_ > 0 || all_.empty(); }
    /// Encodes a packet once for all subscribers, as a frame that is completed when it is published.
    shared_bytes share(function_ref<void(buffer&)> write_packet);
    /// Publishes to all subscribers; never blocks.
    void publish(published_packet packet);
    /// Publishes to those that `wants` names; for the others it is skipped, which is no loss. It is no last value.
    void publish_to(published_packet packet, function_ref<bool(const subscriber_info&)> wants);
    /// Whether every lossless subscriber has room for one more packet.
    bool has_room() const noexcept;
    /// Waits until it has.
    task<> wait_for_room();

    std::size_t subscribers() const noexcept { return all_.size(); }
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
    result<provided_subscription*> subscribe(session& from, const wire::subscribe& terms, const adapter* adapt, bool takes_objects, wire::subscribed& answer);
    bytes unsubscribe(provided_subscription& who, bytes_view request, const adapter* adapt);
    void end(provided_subscription& who, const failure& why);
    void vanish(provided_subscription& who);
    void drop(provided_subscription& who);
    subscriber_info take_out(provided_subscription& who);
    void room_made();
    void end_stalled();
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
    publication_losses losses_;
    std::optional<failure> stopped_;
};

/// The subscriptions of one session's peer.
class provided_subscriptions {
public:
    explicit provided_subscriptions(session& owner) : session_(owner) {}
    ~provided_subscriptions();
    provided_subscriptions(const provided_subscriptions&) = delete;
    provided_subscriptions& operator=(const provided_subscriptions&) = delete;

    result<void> on_subscribe(const wire::frame& received);
    result<void> on_unsubscribe(const wire::frame& received);
    result<void> on_credit(const wire::frame& received);
    void on_session_end();
    void forget(std::uint64_t id) { by_id_.erase(id); }
    std::size_t size() const noexcept { return by_id_.size(); }
    /// What is held for all of them together.
    std::size_t& held_bytes() noexcept { return held_bytes_; }

private:
    struct entry {
        std::shared_ptr<publication_core> publication;
        provided_subscription* who = nullptr; // null while schemas are compared
        std::unique_ptr<adapter> unsubscribe;
    };
    void admit(std::uint64_t id, wire::subscribe terms, const std::vector<schema>* theirs, bool takes_objects);
    void refuse(std::uint64_t id, const failure& why);

    session& session_;
    std::map<std::uint64_t, entry> by_id_;
    std::size_t held_bytes_ = 0;
};

} // namespace ise
