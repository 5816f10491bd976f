#pragma once
#include <ise/core/result.hpp>
#include <ise/session/held_packets.hpp>
#include <ise/subscription/publication_core.hpp>
#include <ise/subscription/remote_subscriber.hpp>

#include <cstdint>
#include <map>
#include <memory>
#include <utility>
#include <vector>

namespace ise {

/// The subscriptions of one session's peer.
class incoming_subscriptions final : public subscriber_line {
public:
    incoming_subscriptions(conversation& over, const publication_directory& services)
        : subscriber_line(over), services_(services), asked_bytes_{over.runtime().options().held_bytes()} {}
    ~incoming_subscriptions();
    incoming_subscriptions(const incoming_subscriptions&) = delete;
    incoming_subscriptions& operator=(const incoming_subscriptions&) = delete;

    result<void> on_subscribe(const net::carried_frame& received);
    result<void> on_unsubscribe(const net::carried_frame& received);
    result<void> on_credit(const net::carried_frame& received);
    void on_session_end();
    /// The access policy has changed: subscriptions that it denies now end.
    void review();
    /// Ends every one.
    void end_all(const failure& why);
    void end(std::uint64_t id, const failure& why, std::uint64_t lost) override;
    void forget(std::uint64_t id) noexcept override { by_id_.erase(id); }
    std::size_t size() const noexcept { return by_id_.size(); }

private:
    void settle_all() noexcept override;
    // A request to subscribe whose schemas are being compared: it takes of the session's bytes as long as it is held.
    struct asked {
        asked(wire::subscribe what, std::size_t size, held_budget& of)
            : terms(std::move(what)), bytes(size), budget(of) {
            budget.take(bytes);
        }
        asked(const asked&) = delete;
        asked& operator=(const asked&) = delete;
        ~asked() { budget.give_back(bytes); }

        wire::subscribe terms;
        const std::size_t bytes;
        held_budget& budget;
    };
    struct entry {
        std::shared_ptr<publication_core> publication;
        std::shared_ptr<asked> comparing; // while schemas are compared
        remote_subscriber* who = nullptr; // null as long
        std::unique_ptr<adapter> unsubscribe;
    };
    void end_each(const std::vector<std::pair<std::uint64_t, failure>>& over_now);
    /// Null where it has left meanwhile.
    std::shared_ptr<asked> compared(std::uint64_t id, const std::weak_ptr<asked>& which) const;
    void admit(std::uint64_t id, wire::subscribe terms, const std::vector<schema>* theirs, bool takes_objects);
    const publication_directory& services_;
    held_budget asked_bytes_; // of all whose schemas are being compared
    std::map<std::uint64_t, entry> by_id_;
};

} // namespace ise
