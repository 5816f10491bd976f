#pragma once
#include <ise/core/endpoint.hpp>
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>
#include <ise/service/dispatcher.hpp>
#include <ise/session/contract.hpp>

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace ise {

/// What a node tells the name server of one of its components.
struct registration {
    std::string path;
    std::uint64_t incarnation = 0;
    std::string type;  ///< of the component, for people
    std::string state; ///< "ready", "stalled"…
    std::vector<endpoint> endpoints;
    std::vector<service_description> services; ///< provided and required
    std::map<std::string, std::int32_t> roles; ///< that it serves, with its priority
    std::string waits_for;                     ///< for people; empty: nothing, or not for long
};

/// Keeps the names of a node's components: registers them, renews the node's lease, withdraws them. Lives on the node's
/// own loop, so that a busy component does not lose its name.
class registrar {
public:
    virtual ~registrar() = default;

    /// Completes when the name is granted, with its epoch. errc::name_taken says who holds it. While the name server
    /// does not answer, or has no room, it goes on trying, on its own, also after `deadline` (errc::name_server_lost).
    /// Cancellation: terminal, ends only the wait: it goes on trying until `withdraw`.
    virtual task<result<std::uint64_t>> enroll(registration who, duration deadline) = 0;
    /// Services or state have changed.
    virtual void update(registration who) = 0;
    /// Its state for people: "ready", "stalled"…
    virtual void set_state(const std::string& path, std::uint64_t incarnation, std::string_view state) = 0;
    /// Gives the name up; completes when the server knows, or does not answer. Cancellation: terminal, ends only the
    /// wait. This and the two before do nothing where a component of another incarnation (a random number of its life)
    /// has the name by now.
    virtual task<> withdraw(std::string path, std::uint64_t incarnation) = 0;
    /// For the end of the node: completes when the server knows of all that were withdrawn, or does not answer.
    /// Cancellation: terminal, ends only the wait.
    virtual task<> farewell() = 0;
    /// Whether the lease of the granted names holds now, as far as this side knows; from any thread.
    virtual bool confirmed() const noexcept = 0;

    /// Tells when a name was granted later than `enroll` waited, or again (epoch), has to wait until it is granted
    /// again (0), or was lost to another holder (failure). The path may be another life's by now.
    std::function<void(const registration& of, result<std::uint64_t> epoch)> on_change;
};

} // namespace ise
