#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/time.hpp>
#include <ise/session/contract.hpp>

#include <cstdint>
#include <string>

/// The calls that a component serves, for recorders.
namespace ise {

class environment;
class service_host;

/// A call that a component has served. Fields are only ever appended.
struct served_call {
    std::string service;  ///< its name
    std::string caller;   ///< its path and its address, for people
    wall_time asked_at{}; ///< when the request was read
    duration took{};      ///< until it was answered
    std::string outcome;  ///< "ok", or the name of an errc; "cancelled" where the caller gave it up
    std::string message;  ///< of a failure
    bytes request;        ///< in the layout of the component's own description
    bytes response;       ///< the same, where the outcome is "ok"
    duration deadline{};  ///< until its caller gives it up, from `asked_at` on; zero: never
};

/// Publishes every call that the component has served, but for those of ISE's own services. A component provides it
/// where the environment variable `record_calls_variable` is set and not 0: it shows requests to every peer.
inline constexpr subscription<served_call> served_calls_service{"ise.calls"};
inline constexpr const char* record_calls_variable = "ISE_RECORD_CALLS"; ///< see above

/// Whether the environment asks for it.
bool records_calls(const environment& env);
/// Provides the service where it does.
void provide_served_calls(service_host& of);

} // namespace ise
