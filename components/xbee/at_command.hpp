#pragma once
#include <components/xbee/frame.hpp>

#include <cstdint>
#include <optional>
#include <span>

namespace atirma::xbee {

enum class at_access : std::uint8_t { read_only, read_write, action };

/// A command of the XBee 868 Pro.
struct at_info {
    at_name name;
    std::uint8_t size; ///< bytes of the value, big-endian; 0 for text and actions
    at_access access;
    std::uint64_t minimum;
    std::uint64_t maximum;
    std::uint64_t initial;
    std::string_view meaning;
};

std::span<const at_info> at_commands() noexcept;
/// Case does not matter. Nothing for a command that is not in the table.
const at_info* find_at(at_name name) noexcept;

/// A value as its command carries it, and back (at most 8 bytes; nothing if there are none or more).
ise::bytes at_value(std::uint64_t value, std::size_t size);
std::optional<std::uint64_t> at_number(ise::bytes_view value) noexcept;
/// TP: two bytes, signed.
std::optional<int> temperature_c(ise::bytes_view value) noexcept;

/// Power levels 0 … 4. Public drivers disagree about the milliwatts; the module's data sheet ends at 315.
struct power_level {
    std::uint8_t level;
    double milliwatts;
    std::string_view label;
};
std::span<const power_level> power_levels() noexcept;
double power_dbm(std::uint8_t level) noexcept;

} // namespace atirma::xbee
