#include <ise/core/log.hpp>

#include <ise/core/environment.hpp>

#include <fmt/chrono.h>

#include <unistd.h>

namespace ise {

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
        bool bare = !field.value.empty() && field.value.find_first_of(" \"=\n") == std::string::npos;
        line += bare ? fmt::format(" {}={}", field.name, field.value) : fmt::format(" {}=\"{}\"", field.name, field.value);
    }
    // One record is one line, whatever a peer's text holds.
    for (char& letter : line)
        if (static_cast<unsigned char>(letter) < 0x20) letter = ' ';
    line += '\n';
    return line;
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
    sink_(record);
}

} // namespace ise
