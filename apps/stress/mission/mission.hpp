#pragma once
#include "shore_stores.hpp"

#include <apps/stress/account.hpp>
#include <apps/stress/taps.hpp>
#include <apps/stress/troubles.hpp>

#include <ise/component/component.hpp>
#include <ise/component/node.hpp>

#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <queue>
#include <set>
#include <string>
#include <vector>

namespace atirma::stress {

struct mission_options {
    std::uint64_t seed = 1;
    ise::duration length = std::chrono::minutes(10);
    /// A serial line that is read along: "boat" and "shore" of the XBee, "iridium".
    struct line {
        std::string which, link, device;
    };
    std::vector<line> lines;
    std::string carrier_tcp, carrier_udp; ///< where the boat's calls go on to; empty: not
    std::vector<std::string> stores;      ///< of the communication nodes: see shore_stores
    std::string boat_memory;              ///< the file of the boat's computer
    /// An operator at a window of the console, and the file that is left when it has been told to leave.
    struct window {
        std::string name, file;
    };
    std::vector<window> windows;
    std::string page; ///< "127.0.0.1:8080": asked at the end what it has shown
    ise::endpoint names;
    std::string wind; ///< in words, for the report
    ise::duration max_start = std::chrono::minutes(3), max_calm = std::chrono::minutes(5);
    /// Tells who owns the processes: "ready tcp://… udp://…", "kill atirma/boat", "start atirma/boat",
    /// "stop database", "continue database", "leave NAME" of a window.
    std::function<void(const std::string&)> say;
};

/// A voyage on the real clock. The deployment runs in processes of somebody else, who kills and starts them as he is
/// told; here are those who read along on the boat's wires, the operators, the script, and what is known in the end.
class mission {
public:
    /// `world` outlives it.
    mission(ise::environment& world, ise::node_options terms, mission_options options);
    ~mission();

    /// Until the script is over and nothing is owed any more; blocks. False: it did not come so far, and `why()`
    /// says why.
    bool sail();
    const std::string& why() const noexcept { return trouble_; }

    // After `sail()`.
    account story();
    /// Of the instant at which nothing was owed any more, or at which it waited no longer: the boat sails on.
    const ledger::verdict& proof() const noexcept { return proof_; }

private:
    enum class task { leave, come, over };

    /// Does what the plan says, when it says it (script.cpp).
    class script final : public ise::component {
    public:
        explicit script(mission& of) : of_(of) {}

    private:
        struct event {
            ise::duration at{};
            std::function<void()> what;
        };
        ise::task<> run() override;
        ise::task<bool> see_the_boat();
        ise::task<> learn();
        void begin(const fault& what);
        void end(const fault& what);
        void take_sample();
        bool nothing_owed();
        bool windows_left();
        std::vector<event> timetable();

        mission& of_;
        std::map<trouble, std::size_t> open_;
    };

    bool work();
    /// False: what is stored cannot be read now.
    bool judge();
    void start_lines();
    void start_operator(std::size_t which);
    void stop_operator(std::size_t which);
    bool has_stopped(const std::vector<std::string>& paths) const;
    ise::component_options beside_script() const;
    ise::duration elapsed() const;
    void ask(task what);
    std::array<std::shared_ptr<console::operator_port>, operators> consoles();

    mission_options options_;
    shore_stores stores_;
    account told_;
    ledger book_;
    ledger::verdict proof_;
    std::set<packet_key> judged_; ///< what was on the primary's disk at that instant
    gprs_numbers numbers_;
    std::array<std::shared_ptr<console::operator_port>, operators> consoles_;
    std::string trouble_;
    ise::time_point began_;
    director* director_ = nullptr;
    std::mutex mutex_;
    std::condition_variable asked_;
    std::queue<task> tasks_;          ///< for the thread in `sail()`: a component cannot start another one
    std::unique_ptr<ise::node> node_; ///< its components use everything above
};

} // namespace atirma::stress
