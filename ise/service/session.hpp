#pragma once
#include <ise/core/waiter.hpp>
#include <ise/net/connection.hpp>
#include <ise/service/incoming_calls.hpp>
#include <ise/service/pending_call.hpp>
#include <ise/service/schema_exchange.hpp>
#include <ise/wire/messages.hpp>

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ise {

class service_host;
class subscriber_core;
class provided_subscriptions;
class reply_window;
struct departure;

/// What two components say to each other over one connection, in both directions: the calls and subscriptions that
/// this side asked for, and those that it serves. Symmetric: who connected makes no difference.
class session final : public net::connection::user, public std::enable_shared_from_this<session> {
public:
    session(service_host& host, std::shared_ptr<net::connection> connection, std::weak_ptr<link> owner);
    ~session();

    /// Begins to read.
    void start();

    net::connection& wire() noexcept { return *connection_; }
    service_host& host() noexcept { return host_; }
    loop& host_loop() noexcept;
    bool open() const noexcept { return connection_->open(); }
    const std::string& peer_name() const noexcept { return connection_->peer_name(); }
    /// Who calls over it, for people: a caller without a name within this host is at no address but that of the side it called.
    std::string caller_name() const;
    const net::session_peer& peer() const noexcept { return connection_->terms().peer; }
    schema_exchange& schemas() noexcept { return schemas_; }

    /// Sends a request; false where too much is pending (the call is untouched). Throws what writing it throws, and
    /// errc::too_large where the peer would not take it.
    bool send(pending_call& call, outgoing_packet request);
    /// Calls of this side that are not answered yet.
    std::size_t pending_calls() const noexcept { return slots_.size() - free_slots_.size(); }
    /// Nobody waits for this call any more.
    void abandon(pending_call& call);

    /// Answers a call of the peer.
    void reply(std::uint64_t id, outgoing_packet response) { incoming_.reply(id, response); }
    void refuse(std::uint64_t id, const failure& why) { incoming_.refuse(id, why); }
    incoming_calls& incoming() noexcept { return incoming_; }
    /// What the peer was answered, over this session and those before.
    reply_window& replies();
    /// The same, or null where it has numbered no call.
    reply_window* known_replies() const noexcept { return replies_.get(); }

    /// Tells a subscriber of ours that its subscription is over, and how many packets it does not get for that.
    void end_provided(std::uint64_t subscription, const failure& why, std::uint64_t lost);
    /// A subscription has moved to another session, or its publication has gone.
    void forget_provided(std::uint64_t subscription);

    void subscribe(subscriber_core& subscriber);
    void unsubscribe(subscriber_core& subscriber);
    /// The same with a packet of its user, whose answer is for `waiting`.
    void unsubscribe(subscriber_core& subscriber, bytes_view farewell, departure* waiting);
    void forget_departure(std::uint64_t id) noexcept { departures_.erase(id); }
    /// Bytes held for the peer's subscriptions.
    std::size_t& subscriber_bytes();
    /// Our subscription of that number, if it is still there.
    subscriber_core* find_subscriber(std::uint64_t id) const noexcept;
    /// Grants more packets to the provider.
    void grant(const subscriber_core& subscriber, std::uint64_t total);

    /// The services of the peer that this side has called over it, or is subscribed to; each once, by name.
    std::vector<std::string> used_services() const;

    /// Ends it, saying why.
    void finish(failure why, duration grace) { connection_->finish(std::move(why), grace); }

private:
    result<void> on_frame(const wire::frame& received) override;
    provided_subscriptions& provided();
    result<void> takes_answers() const;
    void on_closed(const failure& cause) override;

    // A service as this side introduced it to the peer.
    struct introduced {
        std::string name;
        const packet_types* types;
        std::unique_ptr<adapter> response;   // where the peer's response differs from ours
        bool adapting = false;               // its schema was asked for; replies wait
        std::vector<std::pair<std::uint64_t, kept_packet>> held;
    };
    struct slot {
        pending_call* call = nullptr;
        std::uint32_t generation = 0;
        std::uint32_t service = 0;
    };

    std::uint32_t number_of(const pending_call& call);
    /// Null where nobody waits for it any more.
    slot* find_slot(std::uint64_t id) noexcept;
    pending_call& free_slot(slot& of);
    pending_call* take_slot(std::uint64_t id);
    result<void> on_reply(const wire::frame& received);
    result<void> on_error(const wire::frame& received);
    result<void> on_answers(const wire::frame& received);
    void introduce(std::uint32_t number);
    result<void> on_subscribed(const wire::frame& received);
    result<void> on_packet(const wire::frame& received);
    result<void> on_ended(const wire::frame& received);
    void on_unsubscribed(const wire::frame& received);
    void complete(pending_call& call, introduced& service, incoming_packet response);

    service_host& host_;
    std::shared_ptr<net::connection> connection_;
    std::weak_ptr<link> owner_;
    schema_exchange schemas_;
    incoming_calls incoming_;
    std::unique_ptr<provided_subscriptions> provided_; // once the peer has subscribed
    std::shared_ptr<reply_window> replies_;

    std::vector<std::unique_ptr<introduced>> introduced_;
    std::vector<slot> slots_;
    std::vector<std::uint32_t> free_slots_;
    std::size_t held_reply_bytes_ = 0;
    std::map<std::uint64_t, subscriber_core*> subscribers_; // by subscription id
    std::map<std::uint64_t, departure*> departures_;         // by subscription id
    std::uint64_t next_subscription_ = 1;
};

/// A subscriber that left and waits for the provider's answer.
struct departure {
    departure(session& over, std::uint64_t subscription)
        : answered(over.host_loop(), [this] { answered.resume(); }), over_(over.weak_from_this()), id_(subscription) {}
    ~departure() {
        if (auto held = over_.lock()) held->forget_departure(id_);
    }
    departure(const departure&) = delete;
    departure& operator=(const departure&) = delete;

    waiter<> answered;
    std::optional<result<bytes>> outcome;

private:
    std::weak_ptr<session> over_;
    std::uint64_t id_;
};

} // namespace ise
