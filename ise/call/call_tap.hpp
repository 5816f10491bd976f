#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/time.hpp>

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace ise {

class service_runtime;

/// A call that a component served, for whoever records it.
struct tapped_call {
    std::string service;
    std::string caller;   ///< its path and its address, for people
    wall_time asked_at{}; ///< when the request was read
    duration took{};      ///< until the answer
    duration deadline{};  ///< until its caller gives it up, from `asked_at` on; zero: never
    std::string outcome;  ///< "ok", or the name of an errc
    std::string message;  ///< of a failure
    bytes request;        ///< in the provider's layout
    bytes response;       ///< where the outcome is "ok"
};

/// The calls to the components of one loop, for those that are watched (`loop::common`). On the loop only.
class call_taps {
public:
    call_taps() = default;
    call_taps(const call_taps&) = delete;
    call_taps& operator=(const call_taps&) = delete;
    ~call_taps();

    /// Whether a component of this process is watched: without one, a call costs this look more.
    static bool any() noexcept { return watched_components.load(std::memory_order_relaxed) != 0; }

    /// Calls `observer` at the end of every call to that component, and of those to ISE's own services none.
    void watch(const service_runtime& component, std::function<void(tapped_call)> observer);
    bool watches(const service_runtime& component) const noexcept;
    void ignore(const service_runtime& component);

    /// A request began; `session` and `id` name it.
    void begin(const void* session, std::uint64_t id, tapped_call call, time_point at);
    /// It was answered: what of `tapped_call` was not known before. Nothing where its begin was not noted.
    void end(const void* session, std::uint64_t id, const service_runtime& component, time_point at,
             std::string outcome, std::string message, bytes response);

private:
    struct running {
        tapped_call call;
        time_point began;
    };
    static std::atomic<unsigned> watched_components;

    std::vector<std::pair<const service_runtime*, std::function<void(tapped_call)>>> observers_;
    std::map<std::pair<const void*, std::uint64_t>, running> calls_;
};

} // namespace ise
