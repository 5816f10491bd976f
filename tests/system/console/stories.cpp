#include <system/atirma/sea.hpp>

#include <components/gui_client/gui_client.hpp>

#include <ise/name_server/name_server.hpp>

#include <support/catch.hpp>

using namespace std::chrono_literals;
using namespace atirma;
using namespace atirma::console;

namespace {

ise::node_options quiet(bool names = false) {
    ise::node_options options;
    options.use_names = names;
    options.log = {};
    return options;
}

/// A console on a host of its own, as its windows see it.
struct desk {
    desk(ise::sim::world& world, const std::string& host, gui_client_options options, const std::string& path = "",
         bool names = false)
        : port(options.port) {
        ise::component_options where;
        where.listens = !path.empty();
        if (where.listens) where.listen = {ise::endpoint::parse("tcp://0.0.0.0:0").value()};
        std::map<std::string, std::string> variables;
        if (names) variables["ISE_NAME_SERVER"] = "tcp://" + world.host("ns").address() + ":7400";
        process = &world.host(host).start_process(
            "console",
            [options, where, path, names](ise::sim::process& here) -> std::shared_ptr<void> {
                auto node = std::make_shared<ise::node>(here, quiet(names));
                node->start<gui_client>(path, where, options);
                return node;
            },
            variables);
    }
    std::shared_ptr<const snapshot> see() const { return port->latest(); }
    const command_entry* last_command() const {
        auto all = see()->commands;
        return all->empty() ? nullptr : &all->back();
    }
    const alarm_entry* alarm_of(const std::string& key) {
        held = see();
        for (const auto& one : held->alarms)
            if (one.key == key) return &one;
        return nullptr;
    }
    std::shared_ptr<operator_port> port;
    std::shared_ptr<const snapshot> held;
    ise::sim::process* process = nullptr;
};

gui_client_options at_the_proxy() {
    gui_client_options options;
    options.proxies = {"tcp://shore:7411"};
    return options;
}

give_command set_mode(sailing_mode mode) {
    give_command made;
    made.command.kind = command_kind::set_mode;
    made.command.mode = mode;
    return made;
}

bool works(const desk& at) {
    return at.see()->boat.position && at.see()->boat.sailing && !at.see()->links.empty() &&
           at.see()->links[0].connected;
}

const std::vector<waypoint> triangle{
    {28.1530, -15.4480}, {28.1600, -15.4520}, {28.1545, -15.4580}, {28.1540, -15.4500}};

} // namespace

TEST_CASE("console: it finds the boat, shows where it is, and the list that it sails") {
    sea it;
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until([&] { return works(console) && console.see()->mission.complete && console.see()->links[0].xbee &&
                               console.see()->links[0].xbee->modem_ready; }, 5min));
    auto view = console.see();
    auto truth = it.boat().location_now();
    CHECK(view->boat.position->value.latitude_deg == Approx(truth.latitude_deg).margin(2e-4));
    CHECK(view->boat.sailing->value.mode == sailing_mode::automatic);
    CHECK(same(view->mission.points, it.boat().pilot().list()));
    CHECK(view->links[0].link == link_id::xbee);
    CHECK(view->links[0].packets > 0);
    CHECK(view->links[0].xbee->modem_ready);
    CHECK(view->track->size() >= 1);
    CHECK(view->parameters.size() == parameter_count);
}

TEST_CASE("console: a mode is set by a click, and a second console sees who did what") {
    sea it;
    desk one(it.world, "desk1", at_the_proxy()), two(it.world, "desk2", at_the_proxy());
    REQUIRE(it.until([&] { return works(one) && works(two); }));
    REQUIRE(one.port->act(set_mode(sailing_mode::hold)));
    REQUIRE(it.until([&] { return one.last_command() && is_over(one.last_command()->phase); }));
    CHECK(one.last_command()->phase == command_phase::done);
    CHECK(one.last_command()->own);
    CHECK(it.boat().pilot().mode() == sailing_mode::hold);
    REQUIRE(it.until([&] { return two.last_command() && two.last_command()->phase == command_phase::done; }));
    CHECK_FALSE(two.last_command()->own);
    CHECK(two.last_command()->id == one.last_command()->id);
    REQUIRE(it.until([&] { return two.see()->boat.sailing->value.mode == sailing_mode::hold; }));
    CHECK(one.see()->boat.sailing->value.mode == sailing_mode::hold);
}

TEST_CASE("console: a mission is uploaded, read back and compared, also over lossy air") {
    sea it(11);
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until([&] { return works(console); }));
    double loss = GENERATE(0.0, 0.3);
    it.user([loss](ise::component& self) -> ise::task<> {
        xbee_air_request lossy;
        lossy.extra_loss = loss;
        auto air = sea::air(self);
        co_await air.call(services::air_control, lossy, 5s);
    });
    upload_mission mission;
    mission.points = triangle;
    REQUIRE(console.port->act(mission));
    REQUIRE(it.until([&] { return is_running(console.see()->upload.phase); }));
    REQUIRE(it.until([&] { return !is_running(console.see()->upload.phase); }, 30min));
    INFO(console.see()->upload.text);
    CHECK(console.see()->upload.phase == upload_phase::verified);
    CHECK(same(it.boat().pilot().list(), triangle));
    CHECK(same(console.see()->mission.points, triangle));
    CHECK(console.see()->upload.done == triangle.size());
}

TEST_CASE("console: an upload is cancelled between two waypoints, and says what the boat has") {
    sea it;
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until([&] { return works(console); }));
    upload_mission mission;
    mission.points = triangle;
    REQUIRE(console.port->act(mission));
    REQUIRE(it.until([&] { return console.see()->upload.done == 1; }, 10min));
    REQUIRE(console.port->act(cancel_upload()));
    REQUIRE(it.until([&] { return console.see()->upload.phase == upload_phase::cancelled; }, 10min));
    CHECK(console.see()->upload.text.find("of 4 waypoints") != std::string::npos);
    auto sent = it.boat().pilot().list().size();
    CHECK(sent < triangle.size());
    REQUIRE(it.until([&] { return console.see()->mission.complete && console.see()->mission.points.size() == sent; },
                     5min));
}

TEST_CASE("console: a parameter is pending while it is under way, then the boat's word stands") {
    sea it;
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until([&] { return works(console); }));
    auto tack = [&] { return console.see()->parameters[static_cast<std::size_t>(parameter_id::time_to_next_tack)]; };
    give_command set;
    set.command.kind = command_kind::set_parameter;
    set.command.parameter = parameter_id::time_to_next_tack;
    set.command.value = 45;
    REQUIRE(console.port->act(set));
    REQUIRE(it.until([&] { return tack().pending == 45.0f; }));
    REQUIRE(it.until([&] { return tack().confirmed == 45.0f && !tack().pending; }));
    CHECK(it.boat().pilot().parameter(parameter_id::time_to_next_tack) == 45.0f);
    set.command.value = 99999;
    REQUIRE(console.port->act(set));
    REQUIRE(it.until([&] { return !tack().problem.empty(); }));
    CHECK(tack().confirmed == 45.0f);
    CHECK(console.last_command()->phase == command_phase::refused);
}

TEST_CASE("console: the modem's power is set, and a value that is none is refused with the reason") {
    sea it;
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until([&] { return works(console); }));
    set_xbee_parameter power;
    power.path = "tcp://shore:7411";
    power.name = "power_level";
    power.value = 1;
    REQUIRE(console.port->act(power));
    REQUIRE(it.until([&] { return console.see()->links[0].xbee && console.see()->links[0].xbee->power_level == 1; }));
    power.value = 9;
    REQUIRE(console.port->act(power));
    REQUIRE(it.until([&] { return console.see()->links[0].xbee_answer.find("not 9") != std::string::npos; }));
}

TEST_CASE("console: a proxy that is killed is shown as lost, and a command given meanwhile arrives once it is back") {
    sea it;
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until([&] { return works(console); }));
    it.proxy_process().crash();
    REQUIRE(it.until([&] { return !console.see()->links[0].connected; }));
    REQUIRE(it.until([&] { return console.alarm_of("proxy:tcp://shore:7411") != nullptr; }));
    REQUIRE(console.port->act(set_mode(sailing_mode::station_keep)));
    it.world.run_for(20s);
    REQUIRE(console.last_command());
    CHECK_FALSE(is_over(console.last_command()->phase));
    it.proxy_process().restart();
    REQUIRE(it.until([&] { return is_over(console.last_command()->phase); }, 5min));
    CHECK(console.last_command()->phase == command_phase::done);
    CHECK(it.boat().pilot().mode() == sailing_mode::station_keep);
    REQUIRE(it.until([&] { return console.see()->links[0].connected; }));
    REQUIRE(console.alarm_of("proxy:tcp://shore:7411"));
    CHECK(console.alarm_of("proxy:tcp://shore:7411")->over_at);
    REQUIRE(console.port->act(acknowledge_alarm{}));
    REQUIRE(it.until([&] { return console.alarm_of("proxy:tcp://shore:7411") == nullptr; }));
}

TEST_CASE("console: a command that cannot be given fails with its reason, and nothing hangs") {
    ise::sim::world world(3);
    gui_client_options nowhere;
    desk console(world, "desk", nowhere);
    REQUIRE(world.run_until([&] { return console.see()->number > 0; }));
    REQUIRE(console.port->act(set_mode(sailing_mode::hold)));
    REQUIRE(world.run_until([&] { return console.last_command() != nullptr; }, 1min));
    CHECK(console.last_command()->phase == command_phase::failed);
    CHECK(console.last_command()->text.find("no link") != std::string::npos);
    upload_mission mission;
    mission.points = triangle;
    REQUIRE(console.port->act(mission));
    REQUIRE(world.run_until([&] { return console.see()->upload.phase == upload_phase::failed; }, 1min));
    gui_client_options away;
    away.proxies = {"tcp://nobody:7411"};
    desk other(world, "other", away);
    REQUIRE(world.run_until([&] { return other.see()->number > 0; }));
    auto soon = set_mode(sailing_mode::hold);
    soon.valid_s = 30;
    REQUIRE(other.port->act(soon));
    REQUIRE(world.run_until([&] { return other.last_command() && is_over(other.last_command()->phase); }, 5min));
    CHECK(other.last_command()->phase == command_phase::failed);
    CHECK_FALSE(other.see()->links.empty());
    CHECK_FALSE(other.see()->links[0].trouble.empty());
}

TEST_CASE("console: a port without a component takes no actions, and its last snapshot stays") {
    ise::sim::world world(3);
    gui_client_options options;
    auto port = options.port;
    CHECK_FALSE(port->act(cancel_upload()));
    CHECK(port->latest()->number == 0);
    desk console(world, "desk", options);
    REQUIRE(world.run_until([&] { return port->latest()->number > 0; }));
    int told = 0;
    port->on_snapshot([&told] { ++told; });
    REQUIRE(world.run_until([&] { return told >= 3; }, 1min));
    port->on_snapshot({});
    for (std::size_t i = 0; i < operator_port::max_actions; ++i) REQUIRE(port->act(acknowledge_alarm{}));
    CHECK_FALSE(port->act(acknowledge_alarm{})); // nobody has taken them yet
    world.run_for(1s);
    CHECK(port->act(acknowledge_alarm{}));
    console.process->crash();
    CHECK_FALSE(port->act(acknowledge_alarm{}));
    CHECK(port->latest()->number > 0);
}

TEST_CASE("console: proxies are found as they come, other consoles are seen, and a lost name server is said") {
    ise::sim::world world(5);
    auto* names = &world.host("ns").start_process("names", [](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quiet());
        ise::component_options where;
        where.listen = {ise::endpoint::parse("tcp://0.0.0.0:7400").value()};
        where.registers = false;
        ise::name_server_options fresh;
        fresh.fresh = true;
        node->start<ise::name_server>(std::string(ise::naming::server_path), where, fresh);
        return node;
    });
    auto names_at = ise::endpoint::parse("tcp://" + world.host("ns").address() + ":7400").value();
    gui_client_options options;
    options.name_server = names_at;
    desk one(world, "desk1", options, "atirma/console/anna", true);
    gui_client_options others;
    others.name_server = names_at;
    desk two(world, "desk2", others, "atirma/console/ben", true);
    auto present = [&](const std::string& path) {
        auto all = one.see()->present;
        return std::find_if(all->begin(), all->end(), [&](const auto& it) { return it.path == path; }) != all->end();
    };
    REQUIRE(world.run_until([&] { return present("atirma/console/ben") && present("atirma/console/anna"); }, 1min));
    for (const auto& each : *one.see()->present) {
        CHECK(each.console);
        CHECK(each.self == (each.path == "atirma/console/anna"));
    }
    CHECK(one.see()->links.empty());
    CHECK(one.see()->finding.reached);
    // A proxy of a link that was not there before.
    world.host("shore").start_process(
        "gprs",
        [](ise::sim::process& here) -> std::shared_ptr<void> {
            auto node = std::make_shared<ise::node>(here, quiet(true));
            ise::component_options where;
            where.listen = {ise::endpoint::parse("tcp://0.0.0.0:0").value()};
            node->start(
                "atirma/shore/gprs",
                [](ise::component& self) -> ise::task<> {
                    auto out = self.publish(services::telemetry);
                    packet_header header;
                    for (;;) {
                        ++header.sequence;
                        header.measured_at = std::chrono::floor<std::chrono::milliseconds>(self.wall());
                        location here_it_is;
                        here_it_is.quality = fix_quality::gps;
                        here_it_is.latitude_deg = 28.15;
                        telemetry_body body = here_it_is;
                        telemetry_packet packet;
                        packet.link = link_id::gprs;
                        packet.sequence = header.sequence;
                        packet.measured_at = packet.received_at = header.measured_at;
                        packet.raw = encode_telemetry(header, body);
                        out(packet);
                        co_await self.sleep(1s);
                    }
                },
                where);
            return node;
        },
        {{"ISE_NAME_SERVER", names_at.text()}});
    REQUIRE(world.run_until([&] { return one.see()->boat.position && two.see()->boat.position; }, 1min));
    CHECK(one.see()->links[0].path == "atirma/shore/gprs");
    CHECK(one.see()->links[0].link == link_id::gprs);
    CHECK_FALSE(one.see()->links[0].takes_commands);
    auto packets = one.see()->links[0].packets;
    names->crash();
    REQUIRE(world.run_until([&] { return !one.see()->finding.reached; }, 1min));
    world.run_for(10s);
    CHECK(one.alarm_of("names"));
    CHECK(one.see()->links[0].packets > packets); // what was found goes on
    names->restart();
    REQUIRE(world.run_until([&] { return one.see()->finding.reached && present("atirma/console/ben"); }, 1min));
}
