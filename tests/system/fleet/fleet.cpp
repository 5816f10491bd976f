// Many boats on one shore, on the virtual world: each has its own proxy and communication node, all call one gateway.
#include <components/boat/boat_names.hpp>
#include <components/boat/communication.hpp>
#include <components/boat_simulator/boat_simulator.hpp>
#include <components/communication_node/communication_node.hpp>
#include <components/gprs_proxy/gprs_gateway.hpp>
#include <components/gprs_proxy/gprs_proxy.hpp>

#include <ise/database/database.hpp>

#include <unit/name_server/system.hpp>

#include <fmt/format.h>

#include <map>
#include <set>

namespace fleet_test {

using namespace std::chrono_literals;
using namespace atirma;

class fleet {
public:
    explicit fleet(std::size_t boats) {
        static int made = 0;
        prefix_ = fmt::format("memory:fleet{}-", ++made);
        for (std::size_t number = 1; number <= boats; ++number) {
            names_of_boats.push_back(boat_name(number));
            disks_.push_back(std::make_unique<ise::database>(std::move(ise::database::open(disk(number), {}).value())));
        }
        names.start("shore", "shore", [this](ise::node& node) {
            gprs_gateway_options options;
            options.listen = {"tcp://0.0.0.0:7419"};
            node.start<gprs_gateway>("atirma/gprs", names_test::everywhere(), options);
            for (std::size_t number = 1; number <= names_of_boats.size(); ++number) start_shore_of(node, number);
        });
        names.start("sea", "boats", [this](ise::node& node) {
            for (std::size_t number = 1; number <= names_of_boats.size(); ++number) start_boat(node, number);
        });
    }

    const std::string& name(std::size_t number) const { return names_of_boats[number - 1]; }
    static std::string role(const std::string& boat) { return of_boat(std::string(communication_role), boat); }

    /// Subscribes to the role of each boat.
    void listen() {
        names.start_body("page", "page", [this](ise::component& self) -> ise::task<> {
            for (const auto& boat : names_of_boats)
                self.listen(self.at(role(boat)), services::telemetry,
                            [this, boat](const telemetry_packet& packet) { boots[boat][packet.boot] += 1; });
            for (;;) co_await self.sleep(1h);
        });
    }
    template <class Contract>
    ise::result<typename Contract::response_type> ask(const std::string& whom, const Contract& service,
                                                      typename Contract::request_type request,
                                                      const std::string& who = "ana") {
        std::optional<ise::result<typename Contract::response_type>> answer;
        names.start_body(who + std::to_string(++asked_), who,
                         [&answer, &service, request, whom](ise::component& self) -> ise::task<> {
                             auto there = self.at(whom);
                             auto got = co_await there.try_call(service, request, 20s);
                             answer = std::move(got);
                         });
        if (!world.run_until([&] { return answer.has_value(); }, 30s)) throw std::logic_error("a call did not end");
        names.world.run_for(1s);
        return std::move(*answer);
    }
    ise::result<authority_state> take(const std::string& boat) {
        authority_request request;
        request.action = authority_action::take;
        return ask(role(boat), services::authority, request);
    }
    ise::result<telecommand_reply> hold(const std::string& boat, std::uint32_t id) {
        telecommand_request request;
        request.id = id;
        commands::set_mode mode;
        mode.mode = sailing_mode::hold;
        request.command = mode;
        return ask(role(boat), services::telecommand, request);
    }
    /// A minute of telemetry of every boat, and none of another one.
    bool all_heard(std::uint64_t packets) {
        for (std::size_t number = 1; number <= names_of_boats.size(); ++number) {
            const auto& heard = boots[name(number)];
            if (heard.size() != 1 || heard.begin()->first != number || heard.begin()->second < packets) return false;
        }
        return true;
    }

    names_test::system names;
    ise::sim::world& world = names.world;
    std::vector<std::string> names_of_boats;
    std::map<std::string, std::map<std::uint16_t, std::uint64_t>>
        boots;                                                    ///< packets by boot, which is the boat's number
    std::map<std::string, std::multiset<std::uint32_t>> executed; ///< ids of telecommands, without pings

private:
    std::string disk(std::size_t number) const { return prefix_ + name(number); }

    void start_shore_of(ise::node& node, std::size_t number) {
        const auto& boat = name(number);
        gprs_proxy_options proxy;
        proxy.listen = {"tcp://127.0.0.1:0"};
        proxy.shore.boat_id = boat;
        proxy.store_at = role(boat);
        node.start<gprs_proxy>(of_boat("atirma/shore/gprs", boat), names_test::everywhere(), proxy);
        communication_node_options kept;
        kept.file = disk(number);
        kept.role = role(boat);
        kept.proxies = {{link_id::gprs, of_boat("atirma/shore/gprs", boat)}};
        node.start<communication_node>(of_boat("atirma/shore/node-1", boat), names_test::everywhere(), kept);
    }
    void start_boat(ise::node& node, std::size_t number) {
        const auto& boat = name(number);
        boat_simulator_options options;
        options.port.device.clear();
        options.gprs = "tcp://shore:7419";
        options.uplink.id = boat;
        options.boot = static_cast<std::uint16_t>(number);
        options.seed = number;
        options.truth_period = 10s;
        options.on_executed = [this, boat](const acknowledgement& answer) {
            if (answer.kind != command_kind::ping) executed[boat].insert(answer.id);
        };
        node.start<boat_simulator>(of_boat("atirma/boat", boat), names_test::everywhere(), options);
    }

    std::string prefix_;
    std::vector<std::unique_ptr<ise::database>> disks_; // held, as the nodes come and go
    int asked_ = 0;
};

void check_apart(std::size_t boats, ise::duration within) {
    fleet it(boats);
    it.listen();
    REQUIRE(it.world.run_until([&] { return it.all_heard(5); }, within));

    // The same operator and the same telecommand's id: authority and telecommand of one boat never reach another.
    const auto last = it.name(boats), before = it.name(boats - 1);
    auto holder = it.take(last);
    REQUIRE(holder);
    REQUIRE(it.hold(last, 7));
    auto refused = it.hold(before, 7);
    REQUIRE_FALSE(refused);
    CHECK(refused.error().message().find("authority") != std::string::npos);
    REQUIRE(it.world.run_until([&] { return it.executed[last].contains(7); }, 1min));
    it.world.run_for(30s);
    std::erase_if(it.executed, [](const auto& one) { return one.second.empty(); });
    REQUIRE(it.executed.size() == 1);
    CHECK(it.executed[last] == std::multiset<std::uint32_t>{7});
    CHECK(it.all_heard(5));
    for (const auto& boat : {std::string(first_boat), before}) {
        auto look = it.ask(it.role(boat), services::authority, authority_request());
        REQUIRE(look);
        CHECK(look->holder.empty());
    }
}

TEST_CASE("fleet: three boats on one shore, each with its own telemetry, authority and telecommands") {
    check_apart(3, 1min);
}

TEST_CASE("fleet: three hundred boats on one shore, each with its own telemetry, authority and telecommands") {
    check_apart(300, 2min);
}

TEST_CASE("fleet: the gateway closes a connection that names no boat, and relays the others") {
    fleet it(2);
    it.listen();
    std::vector<gprs_gateway_state> seen;
    it.names.start_body("viewer", "viewer", [&seen](ise::component& self) -> ise::task<> {
        self.listen(self.at("atirma/gprs"), services::gprs_gateway,
                    [&seen](const gprs_gateway_state& state) { seen.push_back(state); });
        for (;;) co_await self.sleep(1h);
    });
    REQUIRE(it.world.run_until([&] { return it.all_heard(2); }, 1min));
    // A boat that the shore does not know tries again and again.
    it.names.start("stranger", "stranger", [](ise::node& node) {
        boat_simulator_options options;
        options.port.device.clear();
        options.gprs = "tcp://shore:7419";
        options.uplink.id = "nobody";
        node.start<boat_simulator>("nobody/boat", names_test::everywhere(), options);
    });
    REQUIRE(it.world.run_until([&] { return !seen.empty() && seen.back().refused >= 1; }, 1min));
    CHECK(seen.back().trouble.find("'nobody'") != std::string::npos);
    std::set<std::string> relayed;
    for (const auto& one : seen.back().calls) relayed.insert(one.boat);
    CHECK(relayed == std::set<std::string>{"atirma", "boat-2"});
    auto before = it.boots;
    REQUIRE(it.world.run_until([&] { return it.all_heard(before["boat-2"][2] + 3); }, 1min));
}

} // namespace fleet_test
