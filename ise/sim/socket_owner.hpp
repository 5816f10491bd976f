#pragma once
#include <ise/sim/flow.hpp>
#include <ise/sim/machine.hpp>
#include <ise/sim/network.hpp>
#include <ise/sim/resource.hpp>
#include <ise/sim/world_core.hpp>

#include <memory>
#include <system_error>
#include <vector>

namespace ise {
class loop;
}

namespace ise::sim {

/// A process as its sockets and the ends of its serial lines know it.
class socket_owner {
public:
    /// False once it has ended.
    bool running() const noexcept { return running_; }

    /// @cond
    // For the world's parts.
    world_core& world() const noexcept { return world_; }
    network& net() const noexcept { return net_; }
    machine& here() const noexcept { return here_; }
    virtual std::shared_ptr<flow> flow_of(const loop& on) const = 0;
    std::error_code begin_operation() { return world_.faults().begin(); }
    void attach(const std::shared_ptr<resource>& what) {
        if (resources_.size() == resources_.capacity()) // now and then
            std::erase_if(resources_, [](const auto& each) { return each.expired(); });
        resources_.push_back(what);
    }

protected:
    socket_owner(world_core& world, network& net, machine& here) : world_(world), net_(net), here_(here) {}
    ~socket_owner() = default;

    std::vector<std::weak_ptr<resource>> resources_;
    bool running_ = true;
    /// @endcond

private:
    world_core& world_;
    network& net_;
    machine& here_;
};

} // namespace ise::sim
