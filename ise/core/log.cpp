#include <ise/core/log.hpp>

#include <ise/core/environment.hpp>
#include <ise/core/readable.hpp>
#include <ise/core/time_text.hpp>

#include <fmt/chrono.h>

#include <unistd.h>

#include <utility>

namespace ise {
namespace {

// Bare where it can be read so, else quoted, so that no value looks like further fields.
void append_value(std::string& line, std::string_view value) {
    if (!value.empty() && value.find_first_of(" \"=\\\n\t\r") == std::string_view::npos) {
        line += value;
        return;
    }
    line += '"';
    for (char letter : value.substr(0, max_readable)) {
        if (letter == '"' || letter == '\\') line += '\\';
        line += letter;
    }
    line += '"';
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
    auto line =
        fmt::format("{} {:<7} {}: {}", iso_8601(record.at, 3), name_of(record.level), record.component, record.message);
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
        // A full disk must not stop the boat. (The length is an `unsigned` on Windows.)
        [[maybe_unused]] auto written = ::write(STDERR_FILENO, line.data(), static_cast<unsigned>(line.size()));
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
