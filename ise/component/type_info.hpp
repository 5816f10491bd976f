#pragma once
#include <ise/component/parameter.hpp>

#include <string>
#include <vector>

namespace ise {

/// A service that components of a type have, for those who choose what to start.
struct type_service {
    std::string name;
    std::string kind;     ///< "request-response" or "subscription"
    bool provided = true; ///< else required of others
};

/// A component type as it is described: what a program answers to `--describe`, and what an instantiation server
/// tells. Packets: fields are only ever appended.
struct type_info {
    std::string name; ///< "boat-simulator"
    std::string description;
    std::string path; ///< where it is found unless it is told another; may be empty
    std::vector<parameter> parameters;
    std::vector<type_service> services;
    std::vector<std::string> variables; ///< environment variables that it reads and others may set
};

struct program_info {
    std::string program;
    std::string version;
    std::vector<type_info> types;
    bool shares_process = false; ///< several of its components may run in one process
};

} // namespace ise
