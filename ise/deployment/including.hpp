#pragma once
#include <ise/deployment/reading.hpp>

namespace ise::deployment {

/// The table of a file, laid over those of the files that it includes (a path is meant from the file's own folder).
value load(const std::string& file, const file_reader& read, std::vector<problem>& problems);

} // namespace ise::deployment
