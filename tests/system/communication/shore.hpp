// The shore of a boat on the virtual world: name server, two communication nodes with a disk each, a scripted proxy for
// each link, operators and a subscriber of the role.
#pragma once
#include <components/boat/telecommand_service.hpp>
#include <components/boat/telemetry_follower.hpp>
#include <components/boat_simulator/simulated_boat.hpp>
#include <components/communication_node/communication_node.hpp>

#include <ise/database/database.hpp>

#include <unit/name_server/system.hpp>

#include <array>
#include <deque>
#include <map>
#include <memory>
#include <set>

namespace communication_test {

using namespace std::chrono_literals;
using namespace atirma;

/// A packet's name: boot and sequence.
using packet_key = std::pair<std::uint16_t, std::uint32_t>;
inline packet_key key_of(const telemetry_packet& packet) { return {packet.boot, packet.sequence}; }

/// The boat and the air, which no process of the shore takes with it.
struct boat_at_sea {
    /// Its clock is set by GPS, and begins at `begin`.
    explicit boat_at_sea(utc_time begin);

    struct link {
        bool up = true;
        bool publishes = true;                ///< its proxy; else only who keeps its packets hears of them
        bool acknowledges = false;            ///< the boat keeps what it sends until it is told that it is kept
        std::deque<telemetry_packet> waiting; ///< of what it sends
        std::uint32_t commands = 0;           ///< that arrived over it
        std::uint32_t lose = 0;               ///< so many that the link counts as delivered are lost on the air
    };
    telemetry_packet make(link_id over, utc_time at);
    link& over(link_id which) { return links[static_cast<std::size_t>(which)]; }
    acknowledgement execute(ise::bytes_view raw, link_id from, utc_time now);

    std::array<link, link_count> links;
    utc_time begin;
    simulator::simulated_boat boat;
    std::uint32_t sequence = 0;
    std::map<std::uint32_t, int> executed; ///< telecommands that changed something, by id
    std::set<packet_key> acknowledged;
    std::vector<std::uint32_t> epochs; ///< of what it obeyed, in order
};

/// A proxy that does what proxies do, over a link that the test switches.
class scripted_proxy final : public ise::component {
public:
    scripted_proxy(link_id link, boat_at_sea& boat) : link_(link), boat_(boat) {}

private:
    ise::task<> run() override;
    ise::task<> acknowledge();
    void pass();
    bool give();
    utc_time clock() const { return std::chrono::floor<std::chrono::milliseconds>(wall()); }

    link_id link_;
    boat_at_sea& boat_;
    std::optional<telecommand_service> commands_;
    std::set<packet_key> told_;
    ise::publication<ise::subscription<telemetry_packet>> telemetry_;
};

/// Who subscribes to the role.
struct listener {
    std::vector<packet_key> heard; ///< in the order in which it was told
    std::set<packet_key> known;
    std::uint64_t twice = 0;
    std::optional<utc_time> current; ///< newest of what is no history
    std::uint64_t backwards = 0;     ///< times that it would have moved back
    std::vector<telecommand_status> states;
    std::vector<authority_state> authorities;
};

class shore {
public:
    explicit shore(std::uint64_t seed = 1, bool two = true);

    /// Starts a node again, or for the first time.
    void start_node(const std::string& name);
    ise::sim::process& process(const std::string& name) { return *processes_.at(name); }
    void crash(const std::string& name) { process(name).crash(); }
    /// In order, as by SIGTERM.
    void stop(const std::string& name) { running_.at(name)->stop(); }
    void start_proxy(link_id link);
    /// What a node says of itself.
    communication_state state(const std::string& name) const;
    bool serves(const std::string& name) const { return state(name).serving; }
    /// Packets on that node's disk.
    std::set<packet_key> on_disk(const std::string& name);
    /// From now on that disk takes nothing, or does again.
    void fill_disk(const std::string& name, bool full);
    /// The disks are files in that folder, for nodes that are started from then on; those of the virtual world else.
    void use_files(std::string folder) { folder_ = std::move(folder); }
    std::string disk_of(const std::string& name) const;
    /// Keeps a copy of that disk, and puts it back while its node is down.
    void back_up(const std::string& name);
    void restore(const std::string& name);
    /// Whether that disk has something that the other one has not: a backup put back would lose it.
    bool knows_alone(const std::string& name, const std::string& other);

    /// Once a second the boat sends a packet over the link, and over each further one as well.
    void sends_every_second(std::vector<link_id> over);
    void stop_sending() { ++sending_; }

    listener& listen(const std::string& whom = std::string(communication_role), const std::string& from = "page");

    /// Something done by an operator; operators have a path "test/NAME" and stay connected.
    using job = std::function<ise::task<>(ise::component&)>;
    void let(const std::string& who, job what);
    /// A call of an operator, to its end.
    template <class Contract>
    ise::result<typename Contract::response_type> ask(const std::string& who, const Contract& service,
                                                      typename Contract::request_type request,
                                                      ise::duration deadline = 20s,
                                                      std::string whom = std::string(communication_role)) {
        std::optional<ise::result<typename Contract::response_type>> answer;
        let(who, [&answer, &service, request, deadline, whom](ise::component& self) -> ise::task<> {
            auto there = self.at(whom);
            auto got = co_await there.try_call(service, request, deadline);
            answer = std::move(got);
        });
        if (!world.run_until([&] { return answer.has_value(); }, deadline + 10s))
            throw std::logic_error("a call did not end");
        return std::move(*answer);
    }
    ise::result<authority_state> authority(const std::string& who, authority_action action, bool confirmed = false,
                                           std::string to = {}, std::string whom = std::string(communication_role));
    ise::result<telecommand_reply> command(const std::string& who, telecommand_request request,
                                           ise::duration deadline = 20s,
                                           std::string whom = std::string(communication_role)) {
        return ask(who, services::telecommand, std::move(request), deadline, std::move(whom));
    }
    bool until(const std::function<bool()>& done, ise::duration within = 2min) { return world.run_until(done, within); }

    names_test::system names;
    ise::sim::world& world = names.world;
    boat_at_sea boat{std::chrono::floor<std::chrono::milliseconds>(world.wall_start)};
    communication_node_options terms; ///< of both nodes, before they are started

private:
    struct operator_desk {
        std::deque<job> jobs;
    };
    std::set<std::string> rows_on(const std::string& name, const std::string& sql);

    std::string prefix_, folder_;
    std::map<std::string, std::unique_ptr<ise::database>> disks_; // held, as the nodes come and go
    std::map<std::string, std::unique_ptr<ise::database>> backups_;
    std::map<std::string, communication_node*> nodes_;
    std::map<std::string, ise::node*> running_;
    std::map<std::string, ise::sim::process*> processes_;
    std::map<std::string, std::shared_ptr<operator_desk>> operators_;
    std::vector<std::unique_ptr<listener>> listeners_;
    bool two_;
    std::uint64_t sending_ = 0;
};

inline telecommand_request adds_waypoint(std::uint32_t id, double latitude = 28.16) {
    telecommand_request made;
    made.id = id;
    made.command = commands::waypoint_add{{latitude, -15.45}};
    return made;
}

inline const std::string one = "shore/one", two = "shore/two";

} // namespace communication_test
