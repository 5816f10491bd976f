#pragma once
#include <ise/instantiation/supervisor.hpp>

#include <cstdint>

namespace ise::instantiation {

/// Health probes: a component that is ready proves again and again that its port answers.
class prober {
public:
    prober(server_context& here, supervisor& instances) : here_(here), instances_(instances) {}

    /// To be called when an instance has become ready, or its terms have changed.
    void begin(const instance_ptr& one);

private:
    task<> follow(instance_ptr one, std::uint64_t life);

    server_context& here_;
    supervisor& instances_;
};

} // namespace ise::instantiation
