#pragma once
#include "journal.hpp"
#include "packets.hpp"
#include "sabotage.hpp"
#include "weather.hpp"

#include <ise/core/result.hpp>

#include <map>
#include <set>
#include <unordered_map>
#include <vector>

namespace seeds {

/// What a caller knows of its call when it makes it.
struct call_terms {
    std::string service;
    std::string caller;              ///< component, for people
    std::string target;              ///< path or endpoint
    std::uint64_t life = 0;          ///< of the caller's process
    std::string from, to;            ///< hosts
    std::vector<std::string> any_of; ///< of a role: the hosts of all who serve it, `to` among them
    std::string component;           ///< the target's path, however it is reached; empty: not one of the plan
    bool by_name = false;
    bool over_session = false; ///< back over the session of a request: ends with that
    ise::time_point deadline;  ///< as it holds: nested calls have the smaller one
    ise::duration work{};      ///< of the handler and its nested calls, at most
    bool fails = false;        ///< the handler was asked to throw
    std::uint64_t check = 0;   ///< what the answer shall say
    std::uint64_t parent = 0;  ///< the call whose handler makes this one
};

/// All calls of a run and what must hold for them: each ends exactly once, in time, and with what really happened; a
/// request runs at most once, and never where its caller was told that it did not; where nothing was disturbed there is
/// an answer.
class ledger {
public:
    ledger(journal& events, ise::sim::world& world, const weather& sky, sabotage& planted)
        : journal_(events), world_(world), weather_(sky), planted_(planted) {}

    std::uint64_t open(call_terms terms);
    void given_up(std::uint64_t id);
    void outcome(std::uint64_t id, const ise::result<done>& got);
    /// The caller's coroutine or callback is destroyed; no outcome can come.
    void dropped(std::uint64_t id);

    void run_began(std::uint64_t id, const std::string& where);
    void run_ended(std::uint64_t id);

    /// The caller's process ended in order: every call of it has had its outcome.
    void life_ended(std::uint64_t life, const std::string& who);
    /// The caller's process was killed: its calls end with it.
    void life_lost(std::uint64_t life);
    /// A process was frozen until now: what was due meanwhile comes late.
    void thawed(std::uint64_t life) { thawed_[life] = world_.now(); }
    /// Everything is over.
    void finish();

    /// Others took this path: whoever listens at its first holder's endpoint may have stopped.
    std::map<std::string, std::set<std::string>> rivalled; // and on which hosts

    std::size_t open_calls(std::uint64_t life) const;
    std::uint64_t made() const noexcept { return last_; }

private:
    struct record {
        call_terms terms;
        ise::time_point began;
        ise::time_point ran{};
        std::optional<ise::time_point> given_up;
        int runs = 0, runs_ended = 0;
        bool over = false, lost = false;
        bool denied = false; // the caller was told that it did not run
    };
    void check_failure(std::uint64_t id, record& of, const ise::failure& why);
    bool undisturbed(const record& of) const;
    /// Nothing has disturbed these two, or one and whoever the call may reach, since the call was made.
    bool calm(const std::string& one, const record& of) const;
    /// The handler that made the call was cancelled, or may have been.
    bool handler_cancelled(const record& of) const;
    std::string name(std::uint64_t id, const record& of) const;

    journal& journal_;
    ise::sim::world& world_;
    const weather& weather_;
    sabotage& planted_;
    std::unordered_map<std::uint64_t, record> records_;
    std::map<std::uint64_t, std::set<std::uint64_t>> open_; // by life
    std::map<std::uint64_t, ise::time_point> thawed_;
    std::uint64_t last_ = 0;
};

} // namespace seeds
