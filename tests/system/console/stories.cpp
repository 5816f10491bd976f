#include "console_desk.hpp"

#include <ise/name_server/name_server.hpp>

using namespace console_test;

TEST_CASE("console: it finds the boat, shows where it is, and the list that it sails") {
    sea it;
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until(
        [&] {
            return works(console) && console.see()->mission.complete && console.see()->links[0].xbee &&
                   console.see()->links[0].xbee->modem_ready;
        },
        5min));
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
    REQUIRE(it.until([&] {
        auto* alarm = console.alarm_of("proxy:tcp://shore:7411");
        return alarm && alarm->over_at;
    }));
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
    int count = 0;
    port->on_snapshot([&count] { ++count; });
    REQUIRE(world.run_until([&] { return count >= 3; }, 1min));
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
    options.name_servers = {names_at};
    desk one(world, "desk1", options, "atirma/console/anna", true);
    gui_client_options others;
    others.name_servers = {names_at};
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
    world.host("shore").start_process("gprs",
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
                                                      header.measured_at =
                                                          std::chrono::floor<std::chrono::milliseconds>(self.wall());
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
