#pragma once
#include <ise/core/time.hpp>

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <string>
#include <string_view>

namespace ise {

/// The severity of a record.
enum class log_level : std::uint8_t { debug, info, warning, error };

/// "debug", "info", "warning", "error".
std::string_view name_of(log_level level) noexcept;

/// A field of a record, for filtering.
struct log_field {
    std::string_view name; ///< short, such as `device`
    std::string value;     ///< as text
};

/// A record, as passed to a sink; its references are valid during the call.
struct log_record {
    wall_time at;                            ///< by the clock of the environment
    log_level level = log_level::info;       ///< its severity
    std::string_view component;              ///< the component's path
    std::string_view message;                ///< a sentence
    std::initializer_list<log_field> fields; ///< fields for filtering
};

/// The destination of records. Called from any thread; must not block for long. If it throws, the record is dropped.
using log_sink = std::function<void(const log_record&)>;

/// `2026-11-21T10:00:00.123Z warning atirma/xbee: the port is gone device=/dev/ttyUSB0`, one line, newline included; at
/// most 8 KiB and three dots, control characters as blanks.
std::string format_line(const log_record& record);

/// A sink that writes such lines to standard error, whole lines at a time.
log_sink log_to_stderr(log_level least = log_level::info);

class environment;

/// The logger of a component: its name, a level and a sink. A value; cheap to copy.
class logger {
public:
    logger() = default;
    /// `clock` outlives the logger; an empty sink drops everything.
    logger(const environment& clock, std::string component, log_sink sink)
        : clock_(&clock), component_(std::move(component)), sink_(std::move(sink)) {}

    /// Passes a record of this level to the sink, on the calling thread. Exceptions of the sink are ignored.
    void debug(std::string_view message, std::initializer_list<log_field> fields = {}) const {
        write(log_level::debug, message, fields);
    }
    /// At level info, as `debug`.
    void info(std::string_view message, std::initializer_list<log_field> fields = {}) const {
        write(log_level::info, message, fields);
    }
    /// At level warning, as `debug`.
    void warning(std::string_view message, std::initializer_list<log_field> fields = {}) const {
        write(log_level::warning, message, fields);
    }
    /// At level error, as `debug`.
    void error(std::string_view message, std::initializer_list<log_field> fields = {}) const {
        write(log_level::error, message, fields);
    }
    /// At the level given, as `debug`.
    void write(log_level level, std::string_view message, std::initializer_list<log_field> fields) const;

    /// The path in its records.
    const std::string& component() const noexcept { return component_; }
    /// The sink of its records.
    const log_sink& sink() const noexcept { return sink_; }

private:
    const environment* clock_ = nullptr;
    std::string component_;
    log_sink sink_;
};

} // namespace ise
