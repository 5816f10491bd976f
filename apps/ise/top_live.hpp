#pragma once
#include "survey.hpp"
#include "terminal.hpp"

#include <memory>
#include <vector>

namespace ise::cli {

/// `ise top` on a terminal, until the user ends it or the terminal is closed. Keys are answered also while components
/// are asked, and a name server that is lost is shown and asked again. `first` was surveyed just now. Cancellation:
/// terminal; the terminal is as it was then, too.
task<> top_live(context& in, survey_options what, duration every, std::vector<surveyed> first,
                std::unique_ptr<terminal> on);

} // namespace ise::cli
