#pragma once
#include <ise/database/database.hpp>

#include <ise/core/result.hpp>
#include <ise/core/time.hpp>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace ise::mqtt {

/// A message that must not be lost.
struct queued_message {
    std::uint64_t number = 0; ///< unique, growing
    std::string topic;
    std::string payload;
    bool retain = false;
    wall_time published{}; ///< in ISE
};

struct queue_limits {
    std::uint64_t disk_bytes = std::uint64_t{256} << 20; ///< beyond it the oldest are dropped
    std::size_t memory_bytes = std::size_t{16} << 20; ///< not on disk, as it is full; beyond it the newest are dropped
    std::size_t window = 256;                         ///< messages that are sent and not confirmed
    /// Payloads of the newest messages of topics of which only these count; beyond it a topic keeps its last one.
    std::size_t newest_bytes = std::size_t{128} << 20;
};

/// The messages for a broker, in order, until each is confirmed. Those that are confirmed at once are only in memory;
/// `store` writes the others to a database, from where a later life of the process takes them. Bounded. Used on one
/// loop; `store` and `next` block while the disk works.
class outgoing_queue {
public:
    /// Opens the queue that an earlier process left in `db`, which was opened with `bridge_schema` and must outlive
    /// it. Errors: those of the database.
    static result<outgoing_queue> open(database& db, queue_limits limits = queue_limits());

    struct entry {
        queued_message what;
        time_point came{};
        bool on_disk = false;
        bool sent = false;
        bool sent_before = false; ///< over a connection that ended: the broker may have it
        bool from_disk = false;   ///< it waited there, perhaps since an earlier life of the process
    };

    /// A message has come; it gets its number. The times of `wall` keep numbers apart over lives.
    void push(queued_message what, time_point now, wall_time wall);
    /// The next number, for messages that go without the queue.
    std::uint64_t take_number(wall_time wall);
    /// The next message to be sent, or null: all are sent, or as many as the window has room for. Valid until the
    /// queue is used again. The caller calls `sent` or `done` for it.
    const entry* next();
    void sent(std::uint64_t number);  ///< the one that `next` returned
    void done(std::uint64_t number);  ///< confirmed, or given up
    void again(std::uint64_t number); ///< to be sent anew
    /// The connection has ended: what was not confirmed is sent again.
    void lost();

    /// Writes what came before `older_than` and is not confirmed, and removes what is. Errors: those of the database;
    /// the messages stay in memory, and it can be called again.
    result<void> store(time_point older_than);

    std::uint64_t waiting() const noexcept { return ready_.size() + beyond_ + fresh_.size(); }
    std::uint64_t disk_bytes() const noexcept { return disk_bytes_; }
    std::uint64_t dropped() const noexcept { return dropped_; }

private:
    using entries = std::deque<entry>;
    outgoing_queue(database& db, queue_limits limits) : db_(&db), limits_(limits) {}
    void refill();
    void put_ready(entry one);
    entries::iterator find(std::uint64_t number) noexcept;
    void drop(std::uint64_t number, std::uint64_t bytes);
    static std::size_t size_of(const queued_message& one) noexcept;

    database* db_;
    queue_limits limits_;
    std::uint64_t last_number_ = 0;
    entries ready_;                        // the oldest
    std::uint64_t ready_until_ = 0;        // the highest number that was ever there
    std::uint64_t beyond_ = 0;             // on disk only, behind these
    entries fresh_;                        // behind those, in memory only
    std::vector<std::uint64_t> confirmed_; // still on disk
    std::uint64_t confirmed_bytes_ = 0;
    std::size_t in_flight_ = 0;
    std::size_t memory_bytes_ = 0; // of what is not on disk
    std::uint64_t disk_bytes_ = 0;
    std::uint64_t dropped_ = 0;
};

/// The tables of `outgoing_queue` and `call_journal` (database::open).
extern const std::span<const std::string_view> bridge_schema;

} // namespace ise::mqtt
