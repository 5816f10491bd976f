#include <ise/core/log.hpp>

#include <ise/core/environment.hpp>

#include <fmt/chrono.h>

#include <unistd.h>

#include <array>
#include <cstdint>
#include <optional>
#include <utility>

namespace ise {
namespace {

constexpr std::size_t longest_line = 8 * 1024;

// Bare where it can be read so, else quoted, so that no value looks like further fields.
void append_value(std::string& line, std::string_view value) {
    if (!value.empty() && value.find_first_of(" \"=\\\n\t\r") == std::string_view::npos) {
        line += value;
        return;
    }
    line += '"';
    for (char letter : value.substr(0, longest_line)) {
        if (letter == '"' || letter == '\\') line += '\\';
        line += letter;
    }
    line += '"';
}

// The character at the start of a text and its length; nothing where there is no UTF-8.
std::optional<std::pair<char32_t, std::size_t>> character_at(std::string_view text) {
    auto first = static_cast<unsigned char>(text.front());
    if (first < 0x80) return std::pair(char32_t{first}, std::size_t{1});
    std::size_t length = first >= 0xc2 && first <= 0xdf ? 2 : (first & 0xf0) == 0xe0 ? 3 : first >= 0xf0 && first <= 0xf4 ? 4 : 0;
    if (length == 0 || text.size() < length) return std::nullopt;
    char32_t letter = first & (0x7fu >> length);
    for (std::size_t i = 1; i < length; ++i) {
        auto next = static_cast<unsigned char>(text[i]);
        if ((next & 0xc0) != 0x80) return std::nullopt;
        letter = letter << 6 | (next & 0x3fu);
    }
    constexpr std::array<char32_t, 5> least{0, 0, 0x80, 0x800, 0x10000};
    if (letter < least[length] || letter > 0x10ffff || (letter >= 0xd800 && letter <= 0xdfff)) return std::nullopt;
    return std::pair(letter, length);
}

// What a terminal obeys, or does not show: controls, directions, joiners, line ends, tags.
bool is_unseen(char32_t letter) {
    auto within = [letter](char32_t first, char32_t last) { return letter >= first && letter <= last; };
    return within(0x80, 0x9f) || letter == 0xad || within(0x200b, 0x200f) || within(0x2028, 0x202e) ||
           within(0x2060, 0x206f) || letter == 0xfeff || within(0xfff9, 0xfffb) || within(0xe0000, 0xe0fff);
}

// One line that can be read, whatever a peer's text holds, of bounded length.
std::string readable(std::string_view line) {
    std::string shown;
    while (!line.empty()) {
        if (shown.size() > longest_line) return shown + "...";
        auto letter = character_at(line);
        if (!letter) shown += fmt::format("\\x{:02x}", static_cast<unsigned char>(line.front()));
        else if (letter->first < 0x20 || letter->first == 0x7f) shown += ' ';
        else if (is_unseen(letter->first)) shown += fmt::format("\\u{{{:x}}}", static_cast<std::uint32_t>(letter->first));
        else shown += line.substr(0, letter->second);
        line.remove_prefix(letter ? letter->second : 1);
    }
    return shown;
}

} // namespace

std::string_view name_of(log_level level) noexcept {
    switch (level) {
        case log_level::debug: return "debug";
        case log_level::info: return "info";
        case log_level::warning: return "warning";
        case log_level::error: return "error";
    }
    return "?";
}

std::string format_line(const log_record& record) {
    auto milliseconds = std::chrono::floor<std::chrono::milliseconds>(record.at);
    auto seconds = std::chrono::floor<std::chrono::seconds>(milliseconds);
    auto line = fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03}Z {:<7} {}: {}", fmt::gmtime(std::chrono::system_clock::to_time_t(seconds)),
                            (milliseconds - seconds).count(), name_of(record.level), record.component, record.message);
    for (const auto& field : record.fields) {
        line += fmt::format(" {}=", field.name);
        append_value(line, field.value);
    }
    return readable(line) + '\n';
}

log_sink log_to_stderr(log_level least) {
    return [least](const log_record& record) {
        if (record.level < least) return;
        auto line = format_line(record);
        [[maybe_unused]] auto written = ::write(STDERR_FILENO, line.data(), line.size()); // a full disk must not stop the boat
    };
}

void logger::write(log_level level, std::string_view message, std::initializer_list<log_field> fields) const {
    if (!sink_) return;
    log_record record;
    record.at = clock_->wall();
    record.level = level;
    record.component = component_;
    record.message = message;
    record.fields = fields;
    try {
        sink_(record);
    } catch (...) { // a sink that fails must not stop what it tells about
    }
}

} // namespace ise
