#pragma once
#include <ise/session/contract.hpp>

#include <cstdint>
#include <string>
#include <vector>

/// What an instantiation server asks of a process that runs several components, each on a thread of its own. Packets:
/// fields are only ever appended.
namespace ise::process_host {

struct start_request {
    std::vector<std::string> words; ///< as a program takes them after `run`: a type, its options and parameters
};

struct start_response {
    std::uint64_t number = 0; ///< of this life of the component, within the process
};

struct stop_request {
    std::string path;
};

struct stop_response {};

struct components_request {};

/// A component that runs or has run here.
struct hosted {
    std::string path;
    std::uint64_t number = 0; ///< of its last life
    bool over = false;
    bool stuck = false;  ///< it was stopped, but a thread of it did not come back
    std::string failure; ///< why it failed, if it did
};

struct components_response {
    std::vector<hosted> components;
};

/// Starts a component; it is told as soon as it runs, perhaps before it is ready. errc::refused says what of the words,
/// or of the host, does not allow it.
inline constexpr request_response<start_request, start_response> start{"ise.process.start"};
/// Asks one to stop; `components` tells when it has.
inline constexpr request_response<stop_request, stop_response> stop{"ise.process.stop"};
inline constexpr request_response<components_request, components_response> components{"ise.process.components"};

} // namespace ise::process_host
