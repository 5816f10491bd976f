#pragma once
#include <ise/core/result.hpp>
#include <ise/deployment/deployment.hpp>

#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace ise::deployment {

/// The content of a file, or why it cannot be read.
using file_reader = std::function<result<std::string>(const std::string& path)>;
/// Variables that were given beside the file: name and value.
using settings = std::vector<std::pair<std::string, std::string>>;

struct reading {
    deployment made;               ///< only where there is no problem
    std::vector<problem> problems; ///< by place, each thing once
};

/// Reads a deployment file with those that it includes, and puts its variables in. docs/deployment.md has the form.
/// Nobody is asked: types and parameters are checked elsewhere (checking.hpp).
reading read_deployment(const std::string& file, const file_reader& read, const settings& given);

} // namespace ise::deployment
