// Two consoles, two communication nodes: everybody sees the same, and one commands.
#include <system/communication/shore.hpp>

#include <components/gui_client/gui_client.hpp>
#include <components/gui_client/mission.hpp>

using namespace communication_test;
using namespace atirma::console;
using enum authority_action;

namespace {

/// A shore with both nodes, and a console for each of two operators.
struct crew : shore {
    explicit crew(std::uint64_t seed = 1) : shore(seed) {
        start_node(one);
        start_node(two);
        REQUIRE(until([&] { return serves(one) && serves(two) && state(one).peer_lives; }, 30s));
        sends_every_second({link_id::xbee});
    }
    std::shared_ptr<operator_port> console(const std::string& name) {
        gui_client_options options;
        options.space = "shore";
        options.name_servers = {ise::endpoint::parse("tcp://" + world.host("ns").address() + ":7400").value()};
        auto port = options.port;
        consoles[name] = &names.start(name, name, [name, options](ise::node& node) {
            node.start<gui_client>("shore/console/" + name, names_test::everywhere(), options);
        });
        REQUIRE(until([&] { return port->latest()->authority.known && port->latest()->boat.position; }, 2min));
        return port;
    }
    std::map<std::string, ise::sim::process*> consoles;
};

/// The last that an operator gave: the nodes themselves ping the boat when the authority has changed.
const command_entry* last_of(const snapshot& seen) {
    const command_entry* last = nullptr;
    for (const auto& one : *seen.commands)
        if (one.what != "ping") last = &one;
    return last;
}

give_command adds(double latitude, taking how) {
    give_command made;
    made.command = commands::waypoint_add{{latitude, -15.45}};
    made.authority = how;
    return made;
}

/// All that both must agree on.
void check_same(const snapshot& a, const snapshot& b) {
    CHECK(a.authority.state.holder == b.authority.state.holder);
    CHECK(a.authority.state.epoch == b.authority.state.epoch);
    CHECK(a.boat.position->value == b.boat.position->value);
    CHECK(a.boat.position->measured_at == b.boat.position->measured_at);
    CHECK(a.track->size() == b.track->size());
    CHECK(a.mission.points == b.mission.points);
    REQUIRE(a.commands->size() == b.commands->size());
    for (std::size_t i = 0; i < a.commands->size(); ++i) {
        CHECK((*a.commands)[i].id == (*b.commands)[i].id);
        CHECK((*a.commands)[i].phase == (*b.commands)[i].phase);
        CHECK((*a.commands)[i].what == (*b.commands)[i].what);
    }
}

} // namespace

TEST_CASE(
    "console: two consoles agree on the boat, on who commands it and on what it was told, also over a fail-over") {
    crew it(3);
    auto anna = it.console("anna"), ben = it.console("ben");
    CHECK(anna->latest()->authority.state.holder.empty());
    CHECK(anna->latest()->nodes.size() == 2);
    // A command without the authority is refused, with what to do.
    REQUIRE(anna->act(adds(28.161, taking::no)));
    REQUIRE(it.until([&] { return last_of(*anna->latest()) && is_over(last_of(*anna->latest())->phase); }));
    CHECK(last_of(*anna->latest())->phase == command_phase::refused);
    CHECK(last_of(*anna->latest())->text.find("nobody holds the authority") != std::string::npos);
    // Taken on the way.
    REQUIRE(anna->act(adds(28.162, taking::if_free)));
    REQUIRE(it.until([&] { return last_of(*anna->latest())->phase == command_phase::done; }));
    CHECK(anna->latest()->authority.mine());
    REQUIRE(it.until([&] { return ben->latest()->authority.state.holder == "shore/console/anna"; }));
    REQUIRE(it.until([&] { return last_of(*ben->latest()) && last_of(*ben->latest())->phase == command_phase::done; }));
    CHECK(last_of(*ben->latest())->asked_by == "shore/console/anna");
    CHECK(last_of(*ben->latest())->what == last_of(*anna->latest())->what);
    // Whoever finds it held is refused, and asks.
    REQUIRE(ben->act(adds(28.163, taking::if_free)));
    REQUIRE(it.until([&] { return last_of(*ben->latest())->phase == command_phase::refused; }));
    change_authority change;
    change.request.action = ask;
    REQUIRE(ben->act(change));
    auto asked = [&] {
        auto seen = anna->latest();
        return std::ranges::any_of(seen->alarms,
                                   [](const auto& alarm) { return alarm.key == "authority:asked" && !alarm.over_at; });
    };
    REQUIRE(it.until(asked));
    change.request.action = hand_over;
    change.request.to = "shore/console/ben";
    REQUIRE(anna->act(change));
    REQUIRE(it.until([&] { return ben->latest()->authority.mine() && !anna->latest()->authority.mine(); }));
    CHECK_FALSE(asked());

    it.crash(one);
    REQUIRE(it.until([&] { return it.serves(two); }, 1min));
    REQUIRE(ben->act(adds(28.164, taking::no)));
    REQUIRE(it.until([&] { return last_of(*ben->latest())->phase == command_phase::done; }, 2min));
    auto lost = [&] {
        auto seen = anna->latest();
        return std::ranges::any_of(seen->alarms, [](const auto& alarm) { return alarm.key == "node:shore/one"; });
    };
    REQUIRE(it.until(lost, 1min));
    it.start_node(one);
    REQUIRE(it.until([&] { return it.serves(one); }, 1min));
    it.stop_sending();
    it.world.run_for(20s);
    CHECK(it.boat.boat.pilot().list().size() == 2);
    // The refusals are only known to who got them: they were never given.
    auto a = *anna->latest(), b = *ben->latest();
    auto given = [](const snapshot& seen) {
        auto kept = std::make_shared<std::vector<command_entry>>(*seen.commands);
        std::erase_if(*kept, [](const auto& command) { return command.phase == command_phase::refused; });
        std::ranges::sort(*kept, {}, &command_entry::id);
        return kept;
    };
    a.commands = given(a);
    b.commands = given(b);
    check_same(a, b);
}

TEST_CASE(
    "console: a telecommand to the nodes' role takes the link that is alive, whichever brought the newest packet") {
    crew it(5);
    auto anna = it.console("anna");
    it.sends_every_second({link_id::gprs});
    it.boat.over(link_id::xbee).up = false;
    it.world.run_for(2min);
    it.boat.over(link_id::xbee).up = true; // its last words come late, and it hears nothing any more
    it.sends_every_second({link_id::xbee});
    it.world.run_for(3s);
    it.boat.over(link_id::xbee).up = false;
    it.sends_every_second({link_id::gprs});
    give_command asks;
    asks.command = commands::get_parameter();
    asks.via = std::string(communication_role);
    asks.valid_s = 120;
    REQUIRE(anna->act(asks));
    REQUIRE(it.until([&] { return last_of(*anna->latest()) && is_over(last_of(*anna->latest())->phase); }, 5min));
    CHECK(last_of(*anna->latest())->phase == command_phase::done);
    CHECK(last_of(*anna->latest())->link == link_id::gprs);
}

TEST_CASE("console: one that starts late has the track and the last position from the nodes, with their true age") {
    crew it(9);
    auto anna = it.console("anna");
    it.world.run_for(2min);
    it.stop_sending();
    it.world.run_for(10min); // the boat is silent
    auto ben = it.console("ben");
    REQUIRE(it.until([&] { return ben->latest()->track->size() == anna->latest()->track->size(); }, 2min));
    auto seen = ben->latest();
    CHECK(seen->track->size() > 100);
    CHECK(seen->boat.position->measured_at == anna->latest()->boat.position->measured_at);
    CHECK(seen->at - seen->boat.position->measured_at >= 10min);
    CHECK(seen->at - *seen->boat.last_heard >= 9min);
    auto silent = [&] {
        auto now = ben->latest();
        return std::ranges::any_of(now->alarms, [](const auto& one) { return one.key == "no_data"; });
    };
    CHECK(it.until(silent, 1min));
}
