#pragma once
#include <ise/bag/reader.hpp>
#include <ise/bag/recording.hpp>
#include <ise/component/node.hpp>
#include <ise/core/endpoint.hpp>
#include <ise/core/result.hpp>
#include <ise/core/time.hpp>

#include <cstdint>
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
    /// answer and publish is compared with the recording.
    std::vector<std::string> tested;
    double speed = 1;             ///< 2: twice as fast
    std::vector<endpoint> listen; ///< of each played component; none: as every component
    bool loop = false;            ///< begins again at the end
    duration delay =
        std::chrono::milliseconds(500);        ///< before the first message: others find the components until then
    duration settle = std::chrono::seconds(1); ///< after the last one, before `done()`: answers come until then
};

/// The first thing that a tested component did otherwise than in the recording.
struct difference {
    std::string topic;
    std::uint64_t number = 0; ///< of the packet or call on its topic, from 0 on
    std::string recorded;     ///< JSON; empty: there was no such packet
    std::string now;          ///< JSON or a failure; empty: there was no such packet
    /// "atirma/boat/position, packet 4: {…} in the recording, {…} now".
    std::string text() const;
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
/// subscriptions and its calls. A call is answered as the same request was in the recording, in order, the last answer
/// over and over; another request is refused. Used from the thread that the node is used from.
///
///     ise::bag::player play(node, {.file = "failure.mcap", …});
///     REQUIRE(world.run_until([&] { return play.done(); }));
///     REQUIRE(!play.first_difference());
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
    std::optional<difference> first_difference() const; ///< of tested components
    player_counts counts() const noexcept;
    /// The paths of the components that are played.
    const std::vector<std::string>& paths() const noexcept;

private:
    struct shared;
    std::shared_ptr<shared> shared_;
};

} // namespace ise::bag
