#pragma once
#include <ise/core/error.hpp>
#include <ise/core/task.hpp>

#include <cstdint>
#include <string_view>

namespace ise {

class component_runner;
namespace detail {
struct component_parts;
}

/// Where a component is in its life.
enum class component_state : std::uint8_t { starting, ready, stopping, stopped, failed };

/// "starting", "ready", "stopping", "stopped", "failed".
constexpr std::string_view name_of(component_state state) noexcept {
    switch (state) {
        case component_state::starting: return "starting";
        case component_state::ready: return "ready";
        case component_state::stopping: return "stopping";
        case component_state::stopped: return "stopped";
        case component_state::failed: return "failed";
    }
    return "?";
}

/// The interface of a component to its runner.
class runnable {
public:
    runnable() = default;
    virtual ~runnable() = default;
    runnable(const runnable&) = delete;
    runnable& operator=(const runnable&) = delete;

private:
    friend class component;
    friend class component_runner;
    friend struct detail::component_parts;

    virtual task<> run() = 0;
    virtual void on_name_lost(const failure& why) = 0;

    component_runner* runner_ = nullptr; // before it is started there is none
    bool announce_when_ready_ = false;
};

} // namespace ise
