#pragma once
#include <ise/core/time.hpp>

#include <fmt/format.h>

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <string>
#include <string_view>

namespace ise {

enum class log_level : std::uint8_t { debug, info, warning, error };

std::string_view name_of(log_level level) noexcept;

/// One thing that happened: a sentence, and what a program may want to filter by.
struct log_field {
    std::string_view name;
    std::string value;
};

struct log_record {
    wall_time at;
    log_level level = log_level::info;
    std::string_view component;
    std::string_view message;
    std::initializer_list<log_field> fields;
};

/// Where records go. Called from any thread; must not block for long. What it throws is dropped with the record.
using log_sink = std::function<void(const log_record&)>;

/// `2026-11-21T10:00:00.123Z warning atirma/xbee: the port is gone device=/dev/ttyUSB0`, one line, newline included; at
/// most 8 KiB and three dots, control characters as blanks.
std::string format_line(const log_record& record);

/// A sink that writes such lines to standard error, whole lines at a time.
log_sink log_to_stderr(log_level least = log_level::info);

class environment;

/// What a component logs with: its name, a level and a sink. A value; cheap to copy.
class logger {
public:
    logger() = default;
    logger(const environment& clock, std::string component, log_sink sink)
        : clock_(&clock), component_(std::move(component)), sink_(std::move(sink)) {}

    void debug(std::string_view message, std::initializer_list<log_field> fields = {}) const { write(log_level::debug, message, fields); }
    void info(std::string_view message, std::initializer_list<log_field> fields = {}) const { write(log_level::info, message, fields); }
    void warning(std::string_view message, std::initializer_list<log_field> fields = {}) const { write(log_level::warning, message, fields); }
    void error(std::string_view message, std::initializer_list<log_field> fields = {}) const { write(log_level::error, message, fields); }
    void write(log_level level, std::string_view message, std::initializer_list<log_field> fields) const;

    const std::string& component() const noexcept { return component_; }
    const log_sink& sink() const noexcept { return sink_; }

private:
    const environment* clock_ = nullptr;
    std::string component_;
    log_sink sink_;
};

} // namespace ise
