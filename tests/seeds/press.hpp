#pragma once
#include "journal.hpp"
#include "packets.hpp"
#include "sabotage.hpp"

#include <ise/subscription/subscriber_core.hpp>

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace seeds {

/// What has been published in a run, by publication (one life of a service of one component).
class press {
public:
    struct publication {
        std::string by;          ///< component
        std::uint64_t began = 0; ///< packets whose publishing has begun
        std::uint64_t published = 0;
        std::vector<ise::time_point> at; ///< when, by number
        bool open = true;
    };

    std::uint64_t opened(const std::string& by);
    void closed(std::uint64_t life) { all_.at(life).open = false; }
    /// The number of the next packet, before it is given to the library and after.
    std::uint64_t begin(std::uint64_t life) { return all_.at(life).began = all_.at(life).published + 1; }
    void end(std::uint64_t life, ise::time_point now) {
        auto& of = all_.at(life);
        ++of.published;
        of.at.push_back(now);
    }

    const publication& at(std::uint64_t life) const { return all_.at(life); }
    bool knows(std::uint64_t life) const { return all_.contains(life); }
    /// The publication of a component that is open; 0: none, or several, as while a name changes hands.
    std::uint64_t current(const std::string& by) const;

private:
    std::map<std::uint64_t, publication> all_;
    std::map<std::string, std::set<std::uint64_t>> by_component_;
    std::uint64_t last_ = 0;
};

/// One subscription as its subscriber sees it, checked packet by packet: in order, nothing twice, nothing missing that
/// is not counted, from the moment when `subscribe` completed.
class reading {
public:
    reading(journal& events, ise::sim::world& world, const press& published, sabotage& planted, std::string who,
            std::string provider, const ise::subscribe_options& terms, ise::duration linger,
            const std::map<std::string, std::set<std::string>>& rivalled);

    /// `subscribe` has completed.
    void committed();
    void packet(const beat& got, std::optional<std::uint64_t> lost_before, const ise::subscription_counts& counts);
    void ended(const ise::failure& why, const ise::subscription_counts& counts);
    /// Nothing is published any more, and everything has had time to arrive: it has, or it was counted.
    void finish(const ise::subscription_counts& counts, bool queue_empty);

    std::uint64_t life() const noexcept { return life_; }

private:
    void check_first(std::uint64_t life, std::uint64_t number, std::optional<std::uint64_t> lost_before,
                     const ise::subscription_counts& counts);
    void check_next(std::uint64_t number, std::uint64_t lost_before, const ise::subscription_counts& counts);
    void note_life(std::uint64_t life, std::optional<std::uint64_t> lost_before);
    bool limited() const noexcept { return terms_.min_interval > ise::duration{}; }

    journal& journal_;
    ise::sim::world& world_;
    const press& press_;
    sabotage& planted_;
    std::string who_, provider_;
    ise::subscribe_options terms_;
    ise::duration linger_;
    const std::map<std::string, std::set<std::string>>& rivalled_; // of these, who holds the name changes to and fro
    std::uint64_t life_at_begin_, published_at_begin_;
    std::uint64_t life_at_commit_ = 0, published_at_commit_ = 0;
    std::uint64_t life_ = 0, number_ = 0;
    std::uint64_t first_ = 0;               // what it counts from, in its first life
    std::uint64_t received_ = 0, lost_ = 0; // since then
    std::uint64_t all_received_ = 0, all_lost_ = 0, unknown_gaps_ = 0, resumed_ = 0;
    std::map<std::uint64_t, std::uint64_t> newest_; // by life
    std::uint64_t held_number_ = 0;                 // for the sabotage
};

} // namespace seeds
