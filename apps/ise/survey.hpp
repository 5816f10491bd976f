#pragma once
#include "target.hpp"

#include <ise/component/health.hpp>
#include <ise/component/introspection.hpp>
#include <ise/core/error.hpp>
#include <ise/naming/services.hpp>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace ise::cli {

/// A registered component as it was found when it was asked.
struct surveyed {
    naming::listed_name name;            ///< as the name server knows it
    duration lease{};                    ///< of its node; zero: not asked
    std::optional<component_info> about; ///< nothing: it did not answer, and `why` and `trouble` say so
    std::optional<health_report> health; ///< nothing too where it is of a version that has no such service
    errc why{};
    std::string trouble;
    time_point answered_at{};
    duration answered_after{}; ///< round trip of the last question
    duration clock_ahead{};    ///< of its host's clock, against ours; only with `health`
    duration clock_doubt{};    ///< half of that round trip
};

/// The other end of a session, as a component tells it: "atirma/boat (tcp://10.0.0.2:4711)", or only an address.
struct session_peer {
    std::string path; ///< empty: anonymous
    std::string address;

    bool looks_only() const { return path.starts_with(looker_prefix); }
    /// "tcp"
    std::string over() const { return address.substr(0, address.find("://")); }
};
inline session_peer peer_of(const std::string& message) {
    auto from = message.rfind(" (");
    if (from == message.npos || !message.ends_with(')')) return {{}, message};
    return {message.substr(0, from), message.substr(from + 2, message.size() - from - 3)};
}

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
    health_report report;
    duration round_trip{};
    duration clock_ahead{};
};
task<result<pulse>> ask_health(context& in, remote who, duration limit);

/// "as of …; 3 components answered within 2 ms, 1 did not": the age of such an answer.
std::string show_age(const context& in, const std::vector<surveyed>& all);

} // namespace ise::cli
