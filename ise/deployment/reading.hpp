#pragma once
#include <ise/deployment/deployment.hpp>
#include <ise/deployment/including.hpp>
#include <ise/deployment/variables.hpp>

#include <string>
#include <vector>

namespace ise::deployment {

struct reading {
    deployment made;               ///< only where there is no problem
    std::vector<problem> problems; ///< by place, each thing once
};

/// Reads a deployment file with those that it includes, and puts its variables in. docs/deployment.md has the form.
/// Nobody is asked: types and parameters are checked elsewhere (checking.hpp).
reading read_deployment(const std::string& file, const file_reader& read, const settings& given);

} // namespace ise::deployment
