#pragma once
#include <ise/core/result.hpp>
#include <ise/session/conversation.hpp>
#include <ise/subscription/subscriber_core.hpp>

#include <map>
#include <memory>
#include <set>
#include <string>

namespace ise {

/// The subscriptions of this side over one session: their numbers, and whose packet it is that came.
class outgoing_subscriptions final : public subscription_session {
public:
    explicit outgoing_subscriptions(conversation& over);

    void subscribe(subscriber_core& subscriber);
    conversation& over() noexcept override { return over_; }
    void unsubscribe(subscriber_core& subscriber, bytes_view farewell, std::weak_ptr<departure> waiting) override;
    void grant(const subscriber_core& subscriber, std::uint64_t total) override;
    subscriber_core* find(std::uint64_t id) const noexcept override;

    result<void> on_subscribed(const net::carried_frame& received);
    result<void> on_packet(const net::carried_frame& received);
    result<void> on_ended(const net::carried_frame& received);
    void on_unsubscribed(const net::carried_frame& received);
    void on_session_end(const failure& cause);

    /// Adds the names of the services that are subscribed to.
    void add_used(std::set<std::string>& names) const;

private:
    result<void> on_one(const wire::frame_header& header, bytes_view body, passed_object* object);

    conversation& over_;
    const std::uint8_t known_flags_;                               // of packets, as both sides agreed
    std::map<std::uint64_t, subscriber_core*> subscribers_;        // by subscription id
    std::map<std::uint64_t, std::weak_ptr<departure>> departures_; // by subscription id; those that somebody waits for
    std::uint64_t next_id_ = 1;
};

} // namespace ise
