#include <components/xbee/at_command.hpp>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

namespace atirma::xbee {
namespace {

using enum at_access;
constexpr std::uint64_t u16 = 0xFFFF, u32 = 0xFFFFFFFF, u64 = ~std::uint64_t{0};

constexpr std::array<at_info, 40> table{{
    {at("AP"), 1, read_write, 0, 2, 1, "API mode: 0 transparent, 1 plain, 2 escaped"},
    {at("BD"), 4, read_write, 0, u32, 3, "baud rate code"},
    {at("CT"), 2, read_write, 2, 0x28F, 0x64, "command mode time-out, 100 ms"},
    {at("GT"), 2, read_write, 2, 0xCE4, 0x3E8, "guard time of +++, ms"},
    {at("DH"), 4, read_write, 0, u32, 0, "destination of transparent mode, high half"},
    {at("DL"), 4, read_write, 0, u32, u16, "destination of transparent mode, low half"},
    {at("SH"), 4, read_only, 0, u32, 0, "address, high half"},
    {at("SL"), 4, read_only, 0, u32, 0, "address, low half"},
    {at("MY"), 2, read_write, 0, u16, 0xFFFE, "network address"},
    {at("ID"), 8, read_write, 0, u64, 0x7FFF, "network id: modems of different ones do not hear each other"},
    {at("CH"), 1, read_only, 0, 0xFF, 0, "channel"},
    {at("NI"), 0, read_write, 0, 20, 0, "node identifier, text"},
    {at("NT"), 2, read_write, 0, 0xFC, 0x82, "node discovery time-out, 100 ms"},
    {at("NO"), 1, read_write, 0, 3, 0, "node discovery options"},
    {at("NP"), 2, read_only, 0, u16, 0x0100, "largest payload, bytes"},
    {at("DD"), 4, read_write, 0, u32, 0x00050000, "device type"},
    {at("VR"), 2, read_only, 0, u16, 0x1061, "firmware version"},
    {at("HV"), 2, read_only, 0, u16, 0x1D43, "hardware version"},
    {at("R#"), 1, read_only, 0, 0xFF, 0, "cause of the last reset"},
    {at("RR"), 1, read_write, 0, 0xF, 0xA, "retries of a unicast"},
    {at("MT"), 1, read_write, 0, 0xF, 3, "further transmissions of a broadcast"},
    {at("PL"), 1, read_write, 0, 4, 4, "power level"},
    {at("TR"), 2, read_write, 0, u16, 0, "transmissions that exhausted their retries"},
    {at("TA"), 2, read_write, 0, u16, 0, "acknowledgements that did not come"},
    {at("ER"), 2, read_write, 0, u16, 0, "packets heard with errors"},
    {at("GD"), 2, read_write, 0, u16, 0, "good packets heard"},
    {at("DB"), 1, read_only, 0, 0xFF, 0, "strength of the last packet heard, -dBm"},
    {at("RC"), 1, read_only, 0, 0xFF, 0, "strength on the channel, -dBm"},
    {at("TP"), 2, read_only, 0, u16, 0, "temperature, °C, signed"},
    {at("DC"), 1, read_only, 0, 0x64, 0, "used part of the allowed duty cycle, %"},
    {at("%V"), 2, read_only, 0, u16, 0, "supply voltage, mV"},
    {at("EE"), 1, read_write, 0, 1, 0, "encryption"},
    {at("SO"), 1, read_write, 0, 0xFF, 0, "sleep options"},
    {at("RO"), 1, read_write, 0, 0xFF, 3, "silence that ends a packet of transparent mode, characters"},
    {at("WR"), 0, action, 0, 0, 0, "write parameters to memory"},
    {at("RE"), 0, action, 0, 0, 0, "restore the factory's parameters"},
    {at("AC"), 0, action, 0, 0, 0, "apply queued changes"},
    {at("CN"), 0, action, 0, 0, 0, "leave command mode"},
    {at("FR"), 0, action, 0, 0, 0, "restart"},
    {at("ND"), 0, action, 0, 0, 0, "discover nodes"},
}};

constexpr std::array<power_level, 5> levels{
    {{0, 1, "1 mW"}, {1, 23, "23 mW"}, {2, 100, "100 mW"}, {3, 158, "158 mW"}, {4, 315, "315 mW"}}};

} // namespace

std::span<const at_info> at_commands() noexcept { return table; }

const at_info* find_at(at_name name) noexcept {
    for (char& c : name) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    auto found = std::find_if(table.begin(), table.end(), [&](auto& info) { return info.name == name; });
    return found == table.end() ? nullptr : &*found;
}

ise::bytes at_value(std::uint64_t value, std::size_t size) {
    ise::bytes out;
    for (std::size_t i = std::min<std::size_t>(size, 8); i-- > 0;)
        out.push_back(static_cast<std::byte>((value >> (8 * i)) & 0xFF));
    return out;
}

std::optional<std::uint64_t> at_number(ise::bytes_view value) noexcept {
    if (value.empty() || value.size() > 8) return std::nullopt;
    std::uint64_t number = 0;
    for (std::byte b : value) number = (number << 8) | std::to_integer<std::uint64_t>(b);
    return number;
}

std::optional<int> temperature_c(ise::bytes_view value) noexcept {
    auto number = at_number(value);
    if (!number || value.size() != 2) return std::nullopt;
    return static_cast<std::int16_t>(*number);
}

std::span<const power_level> power_levels() noexcept { return levels; }

double power_dbm(std::uint8_t level) noexcept {
    return 10 * std::log10(levels[std::min<std::size_t>(level, 4)].milliwatts);
}

} // namespace atirma::xbee
