#include <components/boat/raw_payload.hpp>

#include <components/boat/hex_digit.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

namespace atirma {
namespace {

constexpr std::string_view hex_mark = "hex:";

ise::failure wrong(std::string why) { return ise::failure(ise::errc::invalid_argument, std::move(why)); }

} // namespace

ise::result<ise::bytes> payload_bytes(std::string_view text) {
    ise::bytes made;
    if (!text.starts_with(hex_mark)) {
        auto raw = ise::as_bytes(text);
        made.assign(raw.begin(), raw.end());
    } else {
        std::optional<int> high;
        for (char c : text.substr(hex_mark.size())) {
            if (c == ' ') continue;
            auto value = hex_digit(c);
            if (value < 0) return wrong(fmt::format("payload: '{}' is no hexadecimal digit", c));
            if (high) made.push_back(static_cast<std::byte>(*high << 4 | value));
            high = high ? std::nullopt : std::optional(value);
        }
        if (high) return wrong("payload: the last byte has one hexadecimal digit only");
    }
    if (made.empty()) return wrong("payload is empty: give a text, or hex: and pairs of hexadecimal digits");
    if (made.size() > max_raw_bytes)
        return wrong(fmt::format("payload is {} bytes; {} fit a frame", made.size(), max_raw_bytes));
    return made;
}

std::string payload_text(ise::bytes_view raw) {
    std::string text;
    for (auto byte : raw) text += static_cast<char>(byte);
    bool printable = std::ranges::all_of(text, [](char c) { return c >= ' ' && c <= '~'; });
    if (printable && !text.starts_with(hex_mark)) return text;
    text = hex_mark;
    for (auto byte : raw) text += fmt::format("{:02X}", std::to_integer<unsigned>(byte));
    return text;
}

} // namespace atirma
