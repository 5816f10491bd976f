#pragma once
#include <ise/replay/replay_world.hpp>

#include <string>

namespace atirma::stress {

/// Replays the recording of a voyage into its two communication nodes, with empty stores: `voyage_options::record`.
/// The other components, from the proxies to the consoles, are played. `out`: a recording of what the nodes did now;
/// empty: none. Errors as of `replay_world::play`.
ise::replay_report replay_nodes(const std::string& file, const std::string& out, ise::log_sink log = {});

} // namespace atirma::stress
