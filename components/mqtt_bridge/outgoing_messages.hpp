#pragma once
#include <components/mqtt_bridge/bridge_context.hpp>
#include <components/mqtt_bridge/broker_session.hpp>
#include <components/mqtt_bridge/outgoing_queue.hpp>

#include <ise/database/database.hpp>

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace ise::mqtt {

/// What the bridge has for the broker, over all connections: the newest messages of topics, the queue of those of which
/// each counts, and answers to requests. Sends while a session is there, and what was not confirmed again over the
/// next. Used on the component's loop.
class outgoing_messages {
public:
    /// What a broker keeps beside packets: a schema, or nothing in place of what it retained.
    struct plain_message {
        std::string topic, payload;
        std::string content_type;
        std::vector<std::pair<std::string, std::string>> user;
    };

    /// Opens the queue in `disk`, which was opened with `bridge_schema`. Errors: those of the database.
    static result<std::shared_ptr<outgoing_messages>> open(std::shared_ptr<bridge_context> in,
                                                           std::shared_ptr<database> disk);

    /// A packet of a topic of which each counts.
    void push(queued_message packet);
    /// A packet of a topic of which the newest counts.
    void put(queued_message packet);
    void put_plain(plain_message what);
    /// The broker shall forget what it retained: behind the packets of the queue, or now.
    void forget(const std::string& topic, bool behind_queue);
    void answer(message what);

    /// A connection is there. `to` lives until `close`; `online` goes first.
    void begin(broker_session& to, message online);
    /// What must be sent anew over a new connection, and what waits.
    void resume();
    /// The connection is closed: nothing is sent any more.
    void close() noexcept { session_ = nullptr; }
    /// Behind `close`: what was not confirmed waits again.
    void end();
    /// As `session_events::confirmed`.
    void on_confirmed(int token, const std::optional<failure>& why, bool later);

    /// Sends what the broker takes now.
    void pump();
    /// Writes what came before `older_than` to disk.
    void store(time_point older_than);

    /// Enters what waits and what was dropped.
    void count_into(bridge_status& to) const;

private:
    /// The newest message of a topic of which only that counts.
    struct newest_message {
        queued_message what;
        time_point came{};
        std::string content_type;
        std::vector<std::pair<std::string, std::string>> user; // beside those of every packet
        bool plain = false;                                    // no packet: a schema, or nothing any more
        bool waiting = false, in_flight = false;
    };
    struct none {};
    using sent_message = std::variant<none, std::string, std::uint64_t, message>; // topic, number, answer

    outgoing_messages(std::shared_ptr<bridge_context> in, std::shared_ptr<database> disk, outgoing_queue queue)
        : in_(std::move(in)), disk_(std::move(disk)), queue_(std::move(queue)) {}
    void enter(newest_message one);
    message packet_message(const queued_message& what, time_point came, bool sent_before, bool from_disk);
    bool send(const message& what, sent_message as);
    void settle(const sent_message& what);
    void refuse(sent_message what, const failure& why);

    std::shared_ptr<bridge_context> in_;
    std::shared_ptr<database> disk_; // the queue points to it
    outgoing_queue queue_;
    broker_session* session_ = nullptr;
    time_point connected_at_{};
    time_point not_before_{};                      // the broker wants no queued message until then
    std::map<std::string, newest_message> newest_; // by topic
    std::size_t newest_bytes_ = 0;                 // of their payloads
    std::deque<std::string> waiting_;              // topics of these, as they became so
    std::deque<message> answers_;                  // that wait
    std::map<int, sent_message> sent_;             // by token
    std::uint64_t told_dropped_ = 0;
    bool told_full_ = false;
};

} // namespace ise::mqtt
