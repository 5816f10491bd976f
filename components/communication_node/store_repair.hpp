#pragma once
#include <components/communication_node/kept_telemetry.hpp>
#include <components/communication_node/node_telecommands.hpp>

#include <string>

namespace atirma {

/// Restores into the present store what is intact in a damaged one that was set aside: the other node may not have all
/// of it. Waits as long as the disk fails. Cancellation: terminal.
ise::task<> restore_intact(std::string file, node_context& here, store_keeper& store, kept_telemetry& telemetry,
                           node_authority& authority, node_telecommands& telecommands);

} // namespace atirma
