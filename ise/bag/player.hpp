#pragma once
#include <ise/bag/difference.hpp>
#include <ise/bag/reader.hpp>
#include <ise/bag/recording.hpp>
#include <ise/component/node.hpp>
#include <ise/core/endpoint.hpp>
#include <ise/core/result.hpp>
#include <ise/core/time.hpp>

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ise::bag {

/// What of a recording is played, and how.
struct player_options {
    std::string file;
    std::vector<std::string> only;         ///< components or topics, each with those below it; none: all
    std::map<std::string, std::string> as; ///< other paths: `atirma/boat` or what lies below it, by prefix
    /// Components that are there, and are not played: recorded calls to them are made at their times, and what they
    /// answer and publish is compared with the recording. Calls of one of them to another are not made.
    std::vector<std::string> tested;
    /// Not compared: fields (`ignored_fields`), or all of a service ("communication_state/*").
    std::vector<std::string> ignored;
    double speed = 1;             ///< 2: twice as fast
    std::vector<endpoint> listen; ///< of each played component; none: as every component
    bool loop = false;            ///< begins again at the end
    duration delay =
        std::chrono::milliseconds(500);        ///< before the first message: others find the components until then
    duration settle = std::chrono::seconds(1); ///< after the last one, before `done()`: answers come until then

    /// In the virtual world (`replay_world`) everything outside of the tested components is as it was: recorded calls
    /// come from components with the paths of the callers, played components come and go when they did, and a call
    /// that a tested component makes and the recording does not have, or the other way round, is a difference.
    /// Called, on the node's thread, when a tested component came and went; null: a running system.
    std::function<void(const std::string& path, bool there)> on_tested;
    duration latency{}; ///< from played to tested components: what is to arrive is sent so much earlier
};

/// What was played so far.
struct player_counts {
    std::uint64_t packets = 0;  ///< published
    std::uint64_t answered = 0; ///< calls answered from the recording
    std::uint64_t unknown = 0;  ///< calls that the recording does not have: refused
    std::uint64_t called = 0;   ///< recorded calls that were made
    std::uint64_t compared = 0; ///< packets and answers of tested components
};

/// Plays a recording into the system of a node, real or virtual: for each recorded component one with its path, its
/// subscriptions and its calls. A call is answered as the same request was in the recording, in order and after the
/// same time, the last answer over and over; another request is refused. Used from the thread that the node is used
/// from.
///
///     ise::bag::player play(node, options);
///     REQUIRE(world.run_until([&] { return play.done(); }));
///     CHECK(!play.first_difference());
class player {
public:
    /// Starts the components on `in`, which must outlive it. Throws errc::io_failed, errc::malformed for a file that is
    /// none of ISE's, errc::invalid_argument where nothing is to be played, and the errors of `node::start`.
    player(node& in, player_options options);
    ~player();
    player(const player&) = delete;
    player& operator=(const player&) = delete;

    /// Whether everything was played; with `loop` never.
    bool done() const noexcept;
    /// Why it cannot go on: a damaged file.
    std::optional<failure> trouble() const;
    /// Of tested components; the first in the recording, not the first that was found.
    std::optional<difference> first_difference() const;
    player_counts counts() const noexcept;
    /// The paths of the components that are played.
    const std::vector<std::string>& paths() const noexcept;

private:
    struct shared;
    std::shared_ptr<shared> shared_;
};

} // namespace ise::bag
