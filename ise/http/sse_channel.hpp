#pragma once
#include <ise/http/sse_event.hpp>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace ise {

/// Where one client's text goes. At most one `write` is under way at a time.
class sse_sink {
public:
    using written = std::function<void(std::error_code)>;

    virtual ~sse_sink() = default;
    /// Sends `text`; `done` is called once, possibly before `write` returns; after `close`, perhaps never.
    virtual void write(std::shared_ptr<const std::string> text, written done) = 0;
    /// Ends the client's connection; a write under way may still call back.
    virtual void close() noexcept = 0;
};

/// What one client may hold back, and how many clients there may be.
struct sse_limits {
    std::size_t max_clients = 2000;
    std::size_t max_queued_bytes = 256 * 1024; ///< per client; beyond it the queue gives way to a new snapshot
    unsigned max_stuck_ticks = 6;              ///< ticks that one write may take before its client is dropped
};

/// Counted since the channel was made.
struct sse_statistics {
    std::uint64_t accepted = 0;
    std::uint64_t refused = 0; ///< beyond max_clients
    std::uint64_t published = 0;
    std::uint64_t resynchronised = 0; ///< times a slow client's queue was replaced by a snapshot
    std::uint64_t events_skipped = 0; ///< events that were in those queues
    std::uint64_t dropped_slow = 0;   ///< clients whose write did not move for max_stuck_ticks
    std::uint64_t shared = 0;         ///< clients that were given a snapshot that another one had been given before
    std::uint64_t left = 0;           ///< clients that went away or whose connection failed
};

/// One stream of server-sent events to any number of clients. Each new client first receives a snapshot; a slow
/// one never slows another, and holds a bounded amount of memory. Clients that know nothing share the text of one
/// snapshot, made once a tick, and are then told what came since. No thread of its own: everything, the sinks'
/// callbacks included, happens on the server's loop.
class sse_channel {
public:
    /// What a new client receives first. `last_event_id` is what it had seen (empty: nothing); the source may
    /// answer with only what came after. What stands before the id's last ':' names the life of the source: of another
    /// one nothing is known. Called on the server's loop, also for a client that fell behind.
    using snapshot_source = std::function<sse_event(std::string_view last_event_id)>;

    explicit sse_channel(snapshot_source snapshot, sse_limits limits = sse_limits());
    ~sse_channel();
    sse_channel(const sse_channel&) = delete;
    sse_channel& operator=(const sse_channel&) = delete;

    /// Takes a client over; false (and nothing is written) where the channel is full or closed.
    bool add(std::shared_ptr<sse_sink> sink, std::string_view last_event_id);
    /// The client behind `sink` is gone. Unknown sinks are ignored.
    void remove(const sse_sink* sink) noexcept;

    /// Sends to every client. The text is built once.
    void publish(const sse_event& event);
    /// Sends a comment to idle clients, so that dead ones are noticed, and drops those that are stuck: so many.
    /// To be called at a steady pace by the owner, such as every 10 s (an HTTP server closes streams that
    /// were silent for `http_stream_times::silent`).
    std::uint64_t tick();
    /// Ends every client; later ones are refused.
    void close() noexcept;

    std::size_t clients() const noexcept;
    const sse_statistics& statistics() const noexcept;

private:
    struct implementation;
    std::shared_ptr<implementation> self_; // callbacks of sinks hold it weakly
};

/// The event as it stands on the wire (an `id:`, an `event:` and `data:` lines, and an empty line).
std::string encode_event(const sse_event& event);

} // namespace ise
