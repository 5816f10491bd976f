#pragma once
#include "surveyed.hpp"
#include "target.hpp"

namespace ise::cli {

struct survey_options {
    std::string prefix;
    bool leases = false; ///< the name server is asked for the length of old ones
};

/// Asks the name server who is there and each of them how it is, many at once. One that does not answer is told as
/// such and does not hold up the others. problem(not_reached) without a name server.
task<std::vector<surveyed>> survey(context& in, survey_options options);

/// One component, asked how it is: round trip, clock and figures. The failures of `remote::try_call`, and
/// errc::no_such_service from a version without.
struct pulse {
    health_report told;
    duration round_trip{};
    duration clock_ahead{};
};
task<result<pulse>> ask_health(context& in, remote who, duration limit);

/// "as of …; 3 components answered within 2 ms, 1 did not": the age of such an answer.
std::string show_age(const context& in, const std::vector<surveyed>& all);

} // namespace ise::cli
