#pragma once
#include <ise/core/time.hpp>
#include <ise/core/trace_id.hpp>
#include <ise/packet/packet_object.hpp>
#include <ise/packet/shared_bytes.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

namespace ise {

class remote_subscriber;
class service_runtime;

/// Who subscribed, as the provider's callbacks see it.
struct subscriber_info {
    std::string peer;         ///< its path, or its address
    std::string who;          ///< its verified identity (docs/access.md); empty: unknown
    std::uint64_t number = 0; ///< of this subscriber within the publication
};

/// A packet that is being published: as a frame (`packet_frame`), as an object, or both, as its subscribers need it.
struct published_packet {
    published_packet() = default;
    published_packet(shared_bytes made, const trace_id& of) noexcept : frame(std::move(made)), trace(of) {}
    published_packet(shared_packet made, const trace_id& of) noexcept : object(std::move(made)), trace(of) {}

    shared_bytes frame;
    shared_packet object;
    std::uint64_t sequence = 0;
    wall_time published_at{};
    trace_id trace;
};

/// Packets that were not sent to a subscriber, by their reason, and subscribers that were ended.
struct publication_losses {
    std::uint64_t replaced = 0;       ///< keep the latest: a newer one came before it was taken
    std::uint64_t overrun = 0;        ///< keep the last N: more than N waited
    std::uint64_t too_many_bytes = 0; ///< four times session_bytes
    std::uint64_t too_large = 0;      ///< for what the subscriber accepts
    std::uint64_t ended = 0;          ///< subscribers that were too slow for a policy that drops nothing
};

/// Packets of a burst, adjacent in memory, that every subscriber takes. They are counted here, and appended to the
/// queues only when a queue is read, so that the cost of a packet does not depend on the number of subscribers.
struct common_run {
    std::size_t packets_left = 0; ///< for which each subscriber has room
    std::byte* next = nullptr;    ///< where the next frame goes; null: there is no run
    std::byte* end = nullptr;     ///< of the memory for frames
    std::byte* newest = nullptr;  ///< the last frame; null: none yet
    std::size_t reserved = 0;     ///< of memory, at the session of each subscriber

    bool takes(std::size_t frame) const noexcept {
        return packets_left > 0 && frame <= static_cast<std::size_t>(end - next) &&
               frame <= shared_bytes_maker::small_bytes;
    }
    /// Where that frame goes.
    std::byte* take(std::size_t frame) noexcept {
        --packets_left;
        newest = next;
        next += frame;
        return newest;
    }
};

/// What the subscribers of one publication share, and what they ask of it.
class subscriber_group {
public:
    /// Gives each subscriber its packets of the common run; before anything that looks at a queue.
    void settle() noexcept {
        if (run_.next) end_run();
    }

    service_runtime& runtime() const noexcept { return runtime_; }
    const std::string& name() const noexcept { return name_; }

    /// The object as a frame, for a subscriber that does not take objects any more. Throws what encoding throws.
    virtual shared_bytes frame_of(const shared_packet& object, std::uint64_t sequence, wall_time published_at,
                                  const trace_id& trace) = 0;
    /// Large packets are made in `memory` from now on: a subscriber can read them there.
    virtual void use(large_memory_source& memory) noexcept = 0;
    /// A publisher that waits for room may go on.
    virtual void room_made() = 0;
    /// Its session is gone, and it is kept for a while; until it is attached again, or vanishes.
    virtual void began_to_linger(remote_subscriber& who) = 0;
    virtual void stopped_lingering(remote_subscriber& who) noexcept = 0;
    /// It did not come back in time.
    virtual void vanish(remote_subscriber& who) = 0;

    publication_losses losses;
    std::uint64_t usual_id = 0;    ///< of a subscription: frames bear it, and most need no other
    std::size_t lossless = 0;      ///< subscribers
    std::size_t object_takers = 0; ///< subscribers

protected:
    virtual void end_run() noexcept = 0;
    common_run run_;

    subscriber_group(service_runtime& runtime, std::string name) : runtime_(runtime), name_(std::move(name)) {}
    ~subscriber_group() = default;

private:
    service_runtime& runtime_;
    std::string name_;
};

} // namespace ise
