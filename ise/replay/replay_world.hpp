#pragma once
#include <ise/bag/difference.hpp>
#include <ise/bag/player.hpp>
#include <ise/component/component.hpp>
#include <ise/component/node_options.hpp>
#include <ise/core/log.hpp>
#include <ise/core/time.hpp>
#include <ise/sim/world.hpp>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ise {

/// A component under test in a replay: the real one, not changed for it.
struct replayed_component {
    std::string path; ///< as in the recording
    /// Makes it, each time that the recording has it come.
    std::function<std::unique_ptr<component>()> make;
    /// Roles, parameters and so on. Default of `listen`: tcp on any port.
    component_options options;
    /// Has it in this host of the world, whose files it reads. Default: a host of its own.
    std::string host;
};

/// How a recording is replayed.
struct replay_options {
    std::vector<replayed_component> components; ///< at least one
    /// What is not compared: fields that differ from run to run, such as random numbers: "store" or "links.last_heard"
    /// of every packet, "telemetry/store" of one service, "communication_state/*" for all of a service.
    std::vector<std::string> ignored;
    std::vector<std::string> only;                ///< components and topics that are played and compared; none: all
    std::string out;                              ///< a recording of what the components did now; empty: none
    log_sink log;                                 ///< of the components; empty: nothing is logged
    std::function<void(double part)> on_progress; ///< 0 to 1, now and then
};

/// What came of a replay.
struct replay_report {
    std::optional<bag::difference> first_difference; ///< nothing: the components did what the recording has
    bag::player_counts counts;
    duration length{};      ///< of the recording
    std::uint64_t hash = 0; ///< over everything that happened in the world: equal replays have equal hashes
};

/// A virtual world into which recordings are replayed: what came to components from outside comes to them again at the
/// recorded times, and what they answer, publish and ask is compared with the recording. The wall clock is that of the
/// recording. A test of a failure at sea:
///
///     ise::replay_world world;
///     ise::replay_options options;
///     options.components = {{"atirma/navigator", [] { return std::make_unique<navigator>(); }, {}, {}}};
///     auto report = world.play("failure.mcap", options);
///     CHECK(!report.first_difference);
///
/// Faults, files of hosts and other processes are prepared as in every `sim::world`. Hosts of its own: "names",
/// "outside", and one for each component, named by its path.
class replay_world : public sim::world {
public:
    using sim::world::world;

    /// Replays one recording, once in a world. Returns when everything of the recording was played and the answers had
    /// a second to come. Throws errc::io_failed and errc::malformed for the file, errc::invalid_argument where it has
    /// nothing of the components or for a second recording, errc::timed_out, and the errors of `node::start`.
    replay_report play(const std::string& file, const replay_options& options);

private:
    bool played_ = false;
};

} // namespace ise
