#pragma once
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>
#include <ise/core/time.hpp>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace ise {

/// A key as a store has it.
struct store_entry {
    std::string key, value;
    std::uint64_t created = 0; ///< revision in which the key appeared; a later life of the key has a higher one
    std::uint64_t changed = 0; ///< revision of the value
};

/// A key that has changed.
struct store_change {
    store_entry entry; ///< if it is gone: its key, and when (`changed`)
    bool gone = false;
};

/// All keys at one moment.
struct store_snapshot {
    std::vector<store_entry> entries;
    std::uint64_t revision = 0; ///< changes after it are not in it
};

/// Writes or erases one key if nobody else has changed it.
struct store_step {
    std::string key, value;
    std::uint64_t expected = 0; ///< `changed` as it must be; 0: the key must be absent
    std::uint64_t lease = 0;    ///< the key goes with it; 0: stays
    bool erase = false;         ///< else it is written
};

/// What has become of a step.
struct store_outcome {
    bool done = false;          ///< false: another has changed the key, and nothing was written
    std::uint64_t revision = 0; ///< at which the key is as it was left, or was found
};

/// What several name servers share: keys with revisions, each written under a condition, and leases that take keys with
/// them. `shared_names` decides what the keys mean. Used on one loop; it outlives its operations.
///
/// Errors of all operations: errc::timed_out, errc::unreachable and errc::peer_lost where it cannot be said whether the
/// store acted; errc::refused with its words where it refuses; errc::no_such_name where a lease is over.
/// Cancellation: terminal; a write may have happened.
class name_store {
public:
    virtual ~name_store() = default;

    /// All keys, as the majority of the store has them now; errors as above. Cancellation: terminal.
    virtual task<result<store_snapshot>> read() = 0;
    /// Each step by itself, together in one revision, at most `max_steps`, no key twice; errors as
    /// above. Cancellation: terminal; the steps may have been done.
    virtual task<result<std::vector<store_outcome>>> write(std::vector<store_step> steps) = 0;
    /// The revision of the store, if a majority of it answers; errors as above. One below a revision that was seen
    /// before means that the store was restored from a backup. Cancellation: terminal.
    virtual task<result<std::uint64_t>> probe() = 0;

    /// A lease of a number that was never used; errors as above. Cancellation: terminal; it may have been made.
    virtual task<result<void>> grant(std::uint64_t lease, duration length) = 0;
    /// Renews a lease by its length, counted from when the store reads the request. errc::no_such_name: it is over;
    /// errc::timed_out: no answer in that time, it may be renewed. Cancellation: terminal.
    virtual task<result<void>> keep(std::uint64_t lease, duration within) = 0;
    /// Ends a lease and its keys; errors as above. Cancellation: terminal.
    virtual task<result<void>> revoke(std::uint64_t lease) = 0;

    /// Reports changes after `revision` in their order, with the revision up to which they are complete, until the
    /// store is lost. errc::superseded: it does not know them any more, `read` anew. Cancellation: terminal.
    virtual task<failure> follow(std::uint64_t revision,
                                 std::function<void(const std::vector<store_change>&, std::uint64_t)> on_changes) = 0;

    /// Ends `follow`, whose changes do not come any more: it returns as if the connection were lost.
    virtual void end_watch() = 0;

    static constexpr std::size_t max_steps = 100;
    static constexpr duration patience =
        std::chrono::milliseconds(1500); ///< for one answer, where nothing else is said
};

} // namespace ise
