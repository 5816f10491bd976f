#pragma once
#include <ise/instantiation/limits.hpp>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace ise::instantiation {

/// What is started: the file and its words, nothing of a shell.
struct launch_order {
    std::string program;
    std::vector<std::string> words;                             ///< without the program's name
    std::vector<std::pair<std::string, std::string>> variables; ///< the whole environment
    std::string output_file;                                    ///< both streams go there
    std::uint64_t max_output_bytes = 256 << 10;                 ///< of that file, and of an older one beside it
    std::string mark;                                           ///< in its environment, and so in that of all it starts
    resource_limits limits;
    std::string user; ///< whose process it is; empty: that of the one who starts it
};

} // namespace ise::instantiation
