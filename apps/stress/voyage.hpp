#pragma once
#include "director.hpp"
#include "ledger.hpp"
#include "operator_seat.hpp"
#include "plan.hpp"
#include "taps.hpp"

#include <components/boat_simulator/boat_simulator.hpp>
#include <components/communication_node/communication_node.hpp>
#include <components/storage/database.hpp>
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
#include <vector>

namespace atirma::stress {

struct voyage_options {
    std::uint64_t seed = 1;
    ise::duration length = std::chrono::hours(10);
    std::string wind_csv;          ///< the content of a recorded series; empty: seeded
    double xbee_range_m = 2000;    ///< from the beach; beyond, nothing is heard
    /// Called with each sample, for what only this machine can measure; `own`: heap blocks of the ledger, which grows.
    std::function<void(ise::duration at, std::size_t own)> on_sample;
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

    struct episode {
        ise::duration from{}, until{}; ///< until < from: not over
        std::string what;
        std::optional<link_id> link;
    };
    struct sample {
        ise::duration at{};
        std::size_t waiting = 0;       ///< in the scheduler: timers, waits, what is under way
        std::size_t sessions = 0;      ///< of all components
        std::size_t gprs_waiting = 0, xbee_queued = 0; ///< at the boat
        std::array<std::uint64_t, 2> packets{}, unseen{}, held{}, open{}; ///< of the nodes
        bool whole = true;             ///< nothing is down
    };
    struct shown_page {
        std::uint64_t received = 0, duplicates = 0, malformed = 0;
    };

    const voyage_options& options() const noexcept { return options_; }
    const voyage_plan& script() const noexcept { return plan_; }
    const std::vector<episode>& episodes() const noexcept { return episodes_; }
    const std::vector<sample>& samples() const noexcept { return samples_; }
    const std::array<operator_record, operators>& operator_records() const noexcept { return operators_; }
    const ledger& book() const noexcept { return book_; }
    ise::duration calm() const noexcept { return calm_; }  ///< after the end, until nothing was owed any more
    ise::wall_time wall(ise::duration at) const { return world_.wall_start + at; }
    shown_page page() const;
    const simulator::simulated_boat& boat() const { return *boat_->boat(); }
    /// Of that node's disk, in the order of the boat's measurements.
    std::vector<telemetry_packet> packets(std::size_t node = 0);
    database& disk(std::size_t node) { return disks_.at(node); }
    /// Warnings and errors of the components, with how often they came.
    const std::map<std::string, std::uint64_t>& complaints() const noexcept { return complaints_; }
    const std::string& log() const noexcept { return log_; }
    ise::sim::world& world() noexcept { return world_; }

private:
    struct place {
        ise::sim::process* process = nullptr;
        ise::component* component = nullptr;
    };
    using maker = std::function<ise::component&(ise::node&, ise::component_options)>;

    void start(const std::string& path, const std::string& host, maker make);
    void start_names();
    void start_sea();
    void start_shore();
    void start_people();
    void schedule();
    void begin(const fault& what);
    void end(const fault& what);
    void down(const std::string& path);
    void up(const std::string& path);
    void watch_range();
    void take_sample(ise::duration at);
    void record(const ise::log_record& said);
    communication_node* node(std::size_t which);
    std::set<packet_key> on_disk(std::size_t which);
    bool nothing_owed();
    ise::node_options node_options(bool names = true);
    static std::string path_of(trouble what);

    voyage_options options_;
    voyage_plan plan_;
    ledger book_;
    std::string log_;
    std::map<std::string, std::uint64_t> complaints_;
    std::vector<episode> episodes_;
    std::vector<sample> samples_;
    std::array<operator_record, operators> operators_;
    gprs_numbers numbers_;
    std::vector<database> disks_; // held open: they outlive the components
    std::string disk_prefix_;
    std::map<std::string, place> places_;
    std::map<trouble, std::size_t> open_; // episodes that are not over
    bool names_fresh_ = true, out_of_range_ = false;
    std::size_t range_episode_ = 0;
    ise::duration calm_{};
    ise::sim::world world_;
    boat_simulator* boat_ = nullptr;
    director* director_ = nullptr;
};

} // namespace atirma::stress
