#pragma once
#include <ise/deployment/deployment.hpp>

#include <map>
#include <string>
#include <vector>

namespace ise::deployment {

/// What a host's instantiation server tells of itself.
struct host_state {
    std::string server; ///< its name: "boat" is ise/host/boat
    std::vector<instantiation::catalogue_type> types;
    std::vector<instantiation::instance_info> instances;
    std::map<std::string, instantiation::checked_start> checked; ///< what it has against what is wanted of it, by path

    const type_info* type(const std::string& name) const;
};

/// The one of a host of the file; null: there is none.
const host_state* state_of(const deployment& of, const std::string& host, const std::vector<host_state>& all);

/// Checks hosts, types, parameters and environment variables against what the hosts have, and completes the requests of
/// the components with their arguments. What is wrong is added to `problems`.
void complete(deployment& of, const std::vector<host_state>& hosts, std::vector<problem>& problems);

} // namespace ise::deployment
