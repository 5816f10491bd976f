#pragma once
#include <ise/core/bytes.hpp>
#include <ise/packet/schema.hpp>
#include <ise/session/contract.hpp>

#include <cstdint>
#include <string>

/// The runs of the actions that a component provides, for recorders and viewers.
namespace ise {

class dynamic_contract;
class service_host;

/// Something that happened to a run. Fields are only ever appended.
struct served_run {
    std::string action;    ///< its name
    std::uint64_t run = 0; ///< counted from 1 for each action; not the id by which a requester comes back
    std::string requester; ///< its path and its address, for people
    std::uint8_t part = 0; ///< 0: the goal was accepted; 1: feedback; 2: the result; 3: a `run_failure`
    bytes packet;          ///< of that part, in the layout of the component's own description
};

/// Publishes everything that happens to runs. A component provides it where it provides `ise.calls`
/// (`record_calls_variable`), for the same reason: it shows goals to every peer.
inline constexpr subscription<served_run> served_runs_service{"ise.runs"};

/// Provides the service where `records_calls`.
void provide_served_runs(service_host& of);

/// What recorders and viewers show of an action's runs: a packet with `run`, `requester` and one of `goal`, `feedback`,
/// `result` and `failure`. Only of an action.
schema schema_of_runs(const dynamic_contract& action);
/// A packet of that schema. errc::malformed for a part that is none.
bytes encode_run(const served_run& what);

} // namespace ise
