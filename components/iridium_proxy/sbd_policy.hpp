#pragma once
#include <components/boat/link_budget.hpp>
#include <components/boat/telecommand_tracker.hpp>

namespace atirma {

/// Telecommands over Iridium: one is given to the gateway at a time, the most urgent first. What the gateway has taken
/// is not sent again: it keeps it until the boat opens a session, and each message is paid for.
link_policy sbd_policy();

/// What one message costs.
std::uint64_t credits_of(std::size_t bytes, std::uint32_t bytes_per_credit) noexcept;

/// What is to be given to the gateway now. Nothing if the budget, in credits, does not suffice: it waits for the
/// next day or month (UTC) then, and those behind it, too.
std::optional<telecommand_tracker::due> next_within_budget(telecommand_tracker& of, tracker_time at,
                                                           const link_budget& budget, std::uint32_t bytes_per_credit);

} // namespace atirma
