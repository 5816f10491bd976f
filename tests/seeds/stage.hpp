#pragma once
#include "journal.hpp"
#include "ledger.hpp"
#include "plan.hpp"
#include "press.hpp"
#include "sabotage.hpp"
#include "weather.hpp"

#include <functional>
#include <map>
#include <string>
#include <vector>

namespace seeds {

class actor;
class contender;

/// Who was granted which name under which epoch: never two of them the same.
class name_book {
public:
    explicit name_book(journal& events) : journal_(events) {}
    /// `who` holds the path, as far as `told_by` knows.
    void holds(const std::string& path, std::uint64_t epoch, std::uint64_t incarnation, const std::string& told_by) {
        auto& known = granted_[{path, epoch}];
        if (known == incarnation) return;
        if (known != 0)
            return journal_.broken("'{}' is held under epoch {} by two: lives {:x} and {:x} ({})", path, epoch, known,
                                   incarnation, told_by);
        known = incarnation;
        journal_.note("'{}' is held under epoch {} by life {:x} ({})", path, epoch, incarnation, told_by);
        journal_.tally("grants of names");
    }

private:
    journal& journal_;
    std::map<std::pair<std::string, std::uint64_t>, std::uint64_t> granted_;
};

enum class phase : std::uint8_t {
    stormy, ///< traffic and faults
    calm,   ///< traffic without faults: all calls are answered
    quiet,  ///< nothing new is said; what is on its way arrives
};

/// A subscription that lives, to be looked at from outside of its coroutine.
struct reader {
    const reading* model = nullptr; ///< null: not subscribed yet
    std::string who, provider;
    bool by_name = true;
    bool waiting = false; ///< for a packet: it has taken all that came
    std::function<bool()> connected;
    std::function<void()> finish;
};

/// What all parts of a run share. The world comes last: what it destroys at its end tells the others.
struct stage {
    stage(std::uint64_t seed, sabotage with, bool verbose)
        : plan(seed), planted(with), events(world, verbose), calls(events, world, sky, planted), names(events),
          world(seed) {}

    seeds::plan plan;
    sabotage planted;
    std::map<std::uint64_t, census> coroutines; ///< by life of a process
    seeds::journal events;
    weather sky;
    ledger calls;
    press papers;
    name_book names;
    seeds::phase now = phase::stormy;
    std::vector<actor*> actors; ///< as they came: what is looked at in another order leaves another trace
    std::vector<contender*> contenders;
    std::vector<reader*> readers;
    ise::sim::world world;
};

} // namespace seeds
