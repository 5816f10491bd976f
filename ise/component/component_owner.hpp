#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/time.hpp>
#include <ise/naming/registrar.hpp>

namespace ise {

/// The node as those who run its components know it. From any thread.
class component_owner {
public:
    /// The node's own.
    virtual ise::loop& loop() noexcept = 0;
    /// Used on that loop, but for `confirmed()`. Null where the node uses no names.
    virtual registrar* names() const noexcept = 0;
    /// A peer wants to hear from a component this often.
    virtual void watch_sooner(duration heartbeat) = 0;
    virtual void stop_all() = 0;
    /// A component has stopped.
    virtual void on_stopped() = 0;

protected:
    ~component_owner() = default;
};

} // namespace ise
