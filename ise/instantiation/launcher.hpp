#pragma once
#include <ise/instantiation/installed_types.hpp>
#include <ise/instantiation/shared_processes.hpp>

#include <cstdint>
#include <string>

namespace ise::instantiation {

/// Starts the processes of instances: their own, or through `shared_processes`.
class launcher {
public:
    launcher(server_context& here, installed_types& types, state_keeper& state, supervisor& instances,
             instance_names& names, shared_processes& shared)
        : here_(here), types_(types), state_(state), instances_(instances), names_(names), shared_(shared) {}

    /// A process for that life of an instance; returns when it is ready or not starting any more. Its supervision is
    /// told what comes of it. Cancellation: terminal; a process that was started goes on.
    task<> launch(instance_ptr one, std::uint64_t life);
    /// Makes the plan of an instance that has none, since its program did not describe itself when it was taken over.
    /// Returns without one after 30 s, in its next life, or when no program has its type. Cancellation: terminal.
    task<> plan_later(instance_ptr one, std::uint64_t life);
    /// Takes over the process that an instance has for itself. False: it has ended.
    bool adopt(const instance_ptr& one, const saved_instance& before);

private:
    task<> launch_alone(instance_ptr one, std::uint64_t life);
    machine::end_handler end_handler_of(const instance_ptr& one, const std::string& mark, std::uint64_t life);

    server_context& here_;
    installed_types& types_;
    state_keeper& state_;
    supervisor& instances_;
    instance_names& names_;
    shared_processes& shared_;
};

} // namespace ise::instantiation
