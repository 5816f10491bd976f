#pragma once
#include "command.hpp"

#include <optional>
#include <string>

namespace ise::cli {

struct learn_options {
    std::optional<duration> length; ///< nothing: until Ctrl-C
    std::string out;                ///< the file; empty: standard output
    bool force = false;             ///< in place of a file that is there
};

/// problem("exists") where the file is there and must not be replaced: before anybody waits for ten minutes.
void check_learned_file(const learn_options& options);

/// Looks at the system again and again until the time is over or Ctrl-C, then writes the policy. problem("unexpected")
/// if the result is not what was seen; problem("nothing_seen") where there is nothing to allow: such a policy would
/// forbid everything.
task<> learn_access(context& in, learn_options options);

} // namespace ise::cli
