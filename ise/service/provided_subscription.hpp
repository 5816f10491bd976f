#pragma once
#include <ise/net/outbox.hpp>
#include <ise/service/publication_core.hpp>
#include <ise/service/waiting_packets.hpp>
#include <ise/wire/messages.hpp>

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

namespace ise {

class session;

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
    /// A lossless one that is connected and full: a publisher that waits waits for it.
    bool holds_up() const noexcept;
    bool take(net::outbox& out, std::size_t quantum) override;
    /// Goes on at `next`, the first packet that did not arrive: of a lossless one, what was sent in vain goes again.
    void resume_at(std::uint64_t next);
    /// Packets that did not arrive and are not sent any more if it ends now.
    std::uint64_t unsent() const noexcept { return queue_.size() + beyond_; }

    const wire::ticket& ticket() const noexcept { return ticket_; }
    std::uint64_t id() const noexcept { return id_; }
    session* over() const noexcept { return session_; }
    const subscriber_info& info() const noexcept { return info_; }
    std::uint64_t dropped() const noexcept { return dropped_; }
    std::size_t queued() const noexcept { return queue_.size(); }
    bool loses_nothing() const noexcept { return policy_ == wire::overflow::lossless || policy_ == wire::overflow::disconnect; }

private:
    friend class publication_core;
    void wake();
    waiting_packets::stretch pop(std::size_t most);
    void keep(const waiting_packets::stretch& sent);
    void forget_arrived();
    std::size_t held() const noexcept { return queue_.cost() + sent_packets_.cost(); }
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
    waiting_packets sent_packets_; // lossless: not known to have arrived
    std::size_t resent_ = 0;       // of queue_, at its front: they do not count towards the depth
    std::uint64_t beyond_ = 0;     // packets that did not fit; of one that loses nothing
    std::uint64_t sent_ = 0;
    std::uint64_t dropped_ = 0;
    std::uint32_t skipped_ = 0; // since the last packet that was queued
    time_point next_allowed_{};
    time_point full_since_ = time_point::max(); // lossless: nothing was taken since
    subscriber_info info_;
    std::unique_ptr<timer> linger_;
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
    void refuse(std::uint64_t id, const failure& why, std::uint64_t lost = 0);

    session& session_;
    std::map<std::uint64_t, entry> by_id_;
    std::size_t held_bytes_ = 0;
};

} // namespace ise
