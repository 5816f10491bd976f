#pragma once
#include <ise/core/error.hpp>

#include <stdexcept>
#include <string>

namespace ise::cli {

/// What the program's end says to a script; README.md and `ise --help` list them.
enum class exit_code : int {
    ok = 0,
    failed = 1,       ///< the component was reached and said no, or failed
    usage = 2,        ///< the command line makes no sense
    not_reached = 3,  ///< no name server, no such name or service, no answer in time
    mismatch = 4,     ///< JSON or packets that do not fit
    no_output = 5,    ///< the answer could not be written
    interrupted = 130 ///< Ctrl-C before the answer
};

exit_code code_of(errc why) noexcept;

/// Why a command ends without its answer: what happened, and what to do about it.
class problem : public std::runtime_error {
public:
    problem(exit_code code, std::string name, const std::string& message, std::string advice = {})
        : std::runtime_error(message), name_(std::move(name)), advice_(std::move(advice)), code_(code) {}
    explicit problem(const failure& why, std::string advice = {});

    exit_code code() const noexcept { return code_; }
    /// For programs: "timed_out", "usage"…
    const std::string& name() const noexcept { return name_; }
    const std::string& advice() const noexcept { return advice_; }
    /// "not_executed" or "unknown", where it is a call that failed.
    const std::string& executed() const noexcept { return executed_; }
    problem& of_call(execution state);

private:
    std::string name_;
    std::string advice_;
    std::string executed_;
    exit_code code_;
};

} // namespace ise::cli
