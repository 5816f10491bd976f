#pragma once
#include <ise/core/endpoint.hpp>
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>
#include <ise/core/time.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace ise {

class peer_channel;

/// Endpoints with commas between them.
std::string text_of(const std::vector<endpoint>& all);

/// Where a component is reached, and which life of it.
struct location {
    std::string path;                ///< empty: whoever listens there
    std::vector<endpoint> endpoints; ///< nearest first
    std::uint64_t epoch = 0;         ///< 0: any
    std::uint64_t incarnation = 0;   ///< 0: any
    std::int32_t priority = 0;       ///< in its role; the highest is preferred
    bool ready = true;               ///< false: it is registered, but stalled or stopping
};

/// Who is found under a path.
struct resolution {
    std::vector<location> members; ///< the holder of a name, or who serves a role, best first
    bool role = false;
};

/// Finds components by path. The name client is one; a fixed endpoint is another.
class resolver {
public:
    /// At least one member; errc::no_such_name if nobody holds the path or serves the role now,
    /// errc::name_server_lost if nobody can say.
    /// Cancellation: terminal.
    virtual task<result<resolution>> resolve(std::string path) = 0;
    /// The same, waiting until somebody is there, at most until `deadline`. Errors as `resolve`. Cancellation:
    /// terminal.
    virtual task<result<resolution>> resolve_when_present(std::string path, time_point deadline) = 0;
    /// Waits until another life than `than` is found under the path, at most until `deadline`: its incarnation, or 0
    /// where none was seen or nobody can say, perhaps at once. Cancellation: terminal.
    virtual task<std::uint64_t> next_life(std::string path, std::uint64_t than, time_point deadline) = 0;

    /// Why names cannot be looked up now, for people; empty if nothing is known against it.
    virtual std::string trouble() const { return {}; }

    /// From now on `who` hears of every change among those who serve the role (`peer_channel::on_members`; never from
    /// within this call), until `unfollow`.
    virtual void follow([[maybe_unused]] const std::string& role, [[maybe_unused]] peer_channel& who) {}
    virtual void unfollow([[maybe_unused]] const std::string& role, [[maybe_unused]] peer_channel& who) noexcept {}

protected:
    ~resolver() = default;
};

} // namespace ise
