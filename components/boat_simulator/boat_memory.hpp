#pragma once
#include <components/boat/receipt.hpp>
#include <components/boat_simulator/simulated_boat.hpp>

#include <ise/database/database.hpp>

#include <span>

namespace atirma {

/// The part of the boat's state that survives a loss of power, in one file: its position and settings, the telecommands
/// that it has executed, and the packets that the shore has not acknowledged over GPRS or the radio, like the flash
/// memory of a tracker. Used on one loop; each call blocks for the time of the disk access.
class boat_memory {
public:
    static constexpr std::size_t kept_commands = simulator::simulated_boat::remembered_commands;

    /// "memory:NAME" as `database`. Of a damaged file, the readable part is kept. Errors: io_failed; malformed
    /// (only without `how`); invalid_argument for a file of a newer program.
    static ise::result<boat_memory> open(const std::string& file, ise::when_damaged how = ise::when_damaged());

    /// The state stored last; empty for a new file. Errors: io_failed, malformed.
    ise::result<std::optional<simulator::remembered_boat>> last();
    /// Stores the state with the telecommands that were executed since the state before: both, or neither.
    ise::result<void> keep(const simulator::remembered_boat& now, std::span<const acknowledgement> fresh);

    /// Oldest first.
    ise::result<std::vector<acknowledgement>> executed();

    /// The unacknowledged packets, oldest first; they are renumbered 1, 2, 3…
    ise::result<std::vector<ise::bytes>> take_unacknowledged();
    ise::result<void> put(std::uint32_t number, const ise::bytes& raw);
    /// All up to this number.
    ise::result<void> forget(std::uint32_t number);

    /// The same for the radio, by name: the packets without a receipt, in the order of their storage.
    ise::result<std::vector<ise::bytes>> not_receipted();
    ise::result<void> put(packet_name name, const ise::bytes& raw);
    ise::result<void> forget(const std::vector<packet_name>& names);

private:
    explicit boat_memory(ise::database opened) : disk_(std::move(opened)) {}
    ise::database disk_;
};

} // namespace atirma
