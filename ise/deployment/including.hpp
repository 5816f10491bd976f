#pragma once
#include <ise/core/result.hpp>
#include <ise/deployment/value.hpp>

#include <functional>
#include <string>
#include <vector>

namespace ise::deployment {

/// The content of a file, or why it cannot be read.
using file_reader = std::function<result<std::string>(const std::string& path)>;

/// The table of a file, laid over those of the files that it includes (a path is meant from the file's own folder).
value load(const std::string& file, const file_reader& read, std::vector<problem>& problems);

} // namespace ise::deployment
