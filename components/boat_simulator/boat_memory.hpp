#pragma once
#include <components/boat/receipt.hpp>
#include <components/boat_simulator/simulated_boat.hpp>
#include <components/storage/database.hpp>

namespace atirma {

/// What the boat's computer keeps over the loss of its power, in one file: where it was and what it was told, which
/// telecommands it has executed, and the packets that the shore has not acknowledged over GPRS or the radio, as a
/// tracker keeps them in its flash. Used on one loop; each call blocks for as long as the disk takes.
class boat_memory {
public:
    static constexpr std::size_t kept_commands = simulator::simulated_boat::remembered_commands;

    /// "memory:NAME" as `database`. Of a damaged file, what can still be read is kept. Errors: io_failed; malformed
    /// (only without `how`); invalid_argument for a file of a newer program.
    static ise::result<boat_memory> open(const std::string& file, when_damaged how = when_damaged());

    /// As it was kept last; nothing in a new file. Errors: io_failed, malformed.
    ise::result<std::optional<simulator::remembered_boat>> last();
    ise::result<void> keep(const simulator::remembered_boat& now);

    /// Oldest first.
    ise::result<std::vector<acknowledgement>> executed();
    ise::result<void> add_executed(const acknowledgement& one);

    /// The packets that were not acknowledged, oldest first; from now on they bear the numbers 1, 2, 3…
    ise::result<std::vector<ise::bytes>> take_unacknowledged();
    ise::result<void> put(std::uint32_t number, const ise::bytes& raw);
    /// All up to this number.
    ise::result<void> forget(std::uint32_t number);

    /// The same for the radio, by name: the packets that were not receipted, in the order in which they were put.
    ise::result<std::vector<ise::bytes>> not_receipted();
    ise::result<void> put(packet_name name, const ise::bytes& raw);
    ise::result<void> forget(const std::vector<packet_name>& names);

private:
    explicit boat_memory(database opened) : disk_(std::move(opened)) {}
    database disk_;
};

} // namespace atirma
