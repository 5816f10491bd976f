#pragma once
#include "account.hpp"
#include "taps.hpp"
#include "troubles.hpp"

#include <components/boat_simulator/boat_simulator.hpp>
#include <components/communication_node/communication_node.hpp>
#include <components/web_server/web_component.hpp>

#include <ise/component/node.hpp>
#include <ise/name_server/name_server.hpp>
#include <ise/sim/world.hpp>

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace atirma::stress {

struct voyage_options {
    std::uint64_t seed = 1;
    ise::duration length = std::chrono::hours(10);
    std::string wind_csv;       ///< the content of a recorded series; empty: seeded
    std::string record;         ///< a recording of packets and calls of the whole deployment; empty: none
    double xbee_range_m = 2000; ///< from the beach; beyond, nothing is heard
    /// Called with each sample, for what only this machine can measure; `tracks`: bytes that the
    /// consoles' tracks take.
    std::function<void(const sample& taken, std::size_t tracks)> on_sample;
    /// Called after every ten virtual seconds, and while everybody waits for what was owed at the end; 0 to 1.
    std::function<void(double part)> on_progress;
};

/// The whole deployment of A-Tirma on the virtual clock, its troubles by the plan, and everything that the report
/// tells. The components are the ones that run at sea, found by their names; the script touches only what lies around
/// them.
class voyage {
public:
    static constexpr int samples_wanted = 40;

    explicit voyage(voyage_options options);

    /// The whole length, then calm until all links have brought what was owed, half an hour at most.
    void sail();
    /// After `sail()`; reads the disks anew each time.
    ledger::verdict judge();

    /// After `sail()`: everything that there is to tell.
    account story();

    const voyage_options& options() const noexcept { return options_; }
    const ledger& book() const noexcept { return book_; }
    ise::database& disk(std::size_t node) { return disks_.at(node); }
    std::string_view log() const noexcept { return log_; }
    ise::sim::world& world() noexcept { return world_; }

private:
    struct place {
        ise::sim::process* process = nullptr;
        ise::component* component = nullptr;
    };
    using maker = std::function<ise::component&(ise::node&, ise::component_options)>;

    void start(const std::string& path, const std::string& host, maker make);
    void start_names();
    void start_recorder();
    void start_sea();
    void start_shore();
    void start_people();
    void schedule();
    void later(ise::duration at, std::function<void()> what);
    void back_up(std::size_t node);
    void set_back(std::size_t node);
    void begin(const fault& what);
    void end(const fault& what);
    void down(const std::string& path);
    void up(const std::string& path);
    void watch_range();
    void take_sample(ise::duration at);
    void record(const ise::log_record& said);
    void start_operator(std::size_t which);
    template <class Component>
    Component* at(const std::string& path) const {
        return static_cast<Component*>(places_.at(path).component);
    }
    bool nothing_owed();
    ise::node_options node_options(bool names = true);

    voyage_options options_;
    account told_;
    ledger book_;
    std::pmr::string log_{memory_apart()};
    std::array<std::shared_ptr<console::operator_port>, operators> consoles_;
    gprs_numbers numbers_;
    std::vector<ise::database> disks_;             // held open: they outlive the components
    std::map<std::size_t, ise::database> backups_; // of the nodes
    std::string disk_prefix_;
    std::map<std::string, place> places_;
    std::map<trouble, std::size_t> open_; // episodes that are not over
    bool names_fresh_ = true, out_of_range_ = false;
    std::size_t range_episode_ = 0, boat_lives_ = 0, still_to_come_ = 0;
    ise::sim::world world_;
    director* director_ = nullptr;
    ise::node* recording_ = nullptr;
};

} // namespace atirma::stress
