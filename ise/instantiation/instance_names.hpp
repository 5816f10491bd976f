#pragma once
#include <ise/instantiation/supervisor.hpp>
#include <ise/service/remote.hpp>

#include <cstdint>
#include <set>
#include <string>

namespace ise::instantiation {

/// What the name server knows of instances: whether a name is free, when an instance is ready, and that its process has
/// ended.
class instance_names {
public:
    instance_names(server_context& here, supervisor& instances, remote name_server)
        : here_(here), instances_(instances), name_server_(std::move(name_server)) {}

    /// Throws errc::name_taken with who holds it, or errc::name_server_lost. Cancellation: terminal.
    task<> check_free(std::string path);
    /// Waits until nobody holds the name, as long as that life is starting: the name of a process that was killed lives
    /// as long as its lease. Cancellation: terminal.
    task<> wait_until_free(instance_ptr one, std::uint64_t life);
    /// A process has ended: its names need not wait for the end of its lease.
    void free_those_of(const std::string& mark);
    /// Returns when that life is ready, which its supervision is told, or is not starting any more. Cancellation:
    /// terminal.
    task<> follow_readiness(instance_ptr one, std::uint64_t life);

private:
    task<> free_now(std::string mark);
    task<std::string> obstacle_of(instance_ptr one);

    server_context& here_;
    supervisor& instances_;
    remote name_server_;
    std::multiset<std::string> freeing_; // marks of ended processes, until the name server knows
};

} // namespace ise::instantiation
