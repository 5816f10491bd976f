#pragma once
#include <ise/deployment/checking.hpp>
#include <ise/instantiation/differences.hpp>

#include <string>
#include <vector>

namespace ise::deployment {

enum class action : std::uint8_t {
    start,
    change,  ///< parameters, while it runs
    restart, ///< it is started again, with what has changed
    stop,
};

std::string_view name_of(action what) noexcept;

/// One step from what runs to what is wanted.
struct step {
    action what = action::start;
    std::string path;
    std::string server;                                 ///< of the host
    instantiation::start_request request;               ///< but of a stop
    std::vector<instantiation::difference> differences; ///< of a change or a restart
    std::string reason;                                 ///< of a start or a stop, if there is one to tell
    bool alive = false;                                 ///< it runs, before a stop
    std::vector<std::size_t> after;                     ///< steps of the plan, by number, that have to be done before
};

struct step_plan {
    std::vector<step> steps;       ///< in their order
    std::vector<std::string> kept; ///< paths that are as they are wanted
    std::vector<problem> problems; ///< then nothing is to be done
};

/// What brings the hosts to what the file describes, which was completed (checking.hpp). Instances belong to a
/// deployment by its name; those of nobody or of others are never touched. `only`: components by their name in the file
/// or their path, with those that they come after, and nothing else is touched; none: all.
step_plan plan_up(const deployment& wanted, const std::vector<host_state>& hosts,
                  const std::vector<std::string>& only = {});

/// What ends all of a deployment, or `only` some: in the opposite order, what the file does not know (any more) first.
step_plan plan_down(const deployment& wanted, const std::vector<host_state>& hosts,
                    const std::vector<std::string>& only = {});

/// Of one step, for people: "start atirma/air on boat"; with the differences, each on a line, where `whole`.
std::string as_text(const step& of, bool whole);

} // namespace ise::deployment
