// The whole of A-Tirma on two hosts from its file: it is changed while the boat sails, loses processes, and goes down.
// Both hosts are instantiation servers of one machine: they listen on loopback only until they can ask for credentials,
// so nobody would reach one in another network namespace.
#include "two_hosts.hpp"

#include <asio/io_context.hpp>
#include <asio/ip/tcp.hpp>
#include <system/instantiation/host.hpp>

#include <fmt/format.h>

#include <array>
#include <test_folders.hpp>

using namespace deployment_test;
using host_test::lives;
using host_test::marked;
using host_test::wait_until;
using ise_test::Contains;

namespace {

/// A harbour with A-Tirma's file, on a clock that runs faster.
struct harbour : two_hosts {
    harbour() {
        install("atirma");
        std::vector<asio::ip::tcp::acceptor> all;
        for (auto& port : ports) { // all are open at once, so that no two are the same
            all.emplace_back(context, asio::ip::tcp::endpoint(asio::ip::address_v4::loopback(), 0));
            port = all.back().local_endpoint().port();
        }
    }

    asio::io_context context;
    std::array<unsigned short, 6> ports{}; ///< on which nobody listens

    /// The demo, with something else laid over it. The second host plays both of the shore's.
    std::string demo(const std::string& name, const std::string& over = "", const std::string& of = "atirma") {
        file("base.toml",
             fmt::format("include = '" ISE_SOURCE_DIR "/apps/atirma/{}.toml'\n[variables]\nfolder = '{}'\n"
                         "page = {}\ngprs = {}\ncarrier = {}\nhook = {}\ngateway = {}\nspeedup = 20\n"
                         "[hosts.shore-1]\nserver = 'shore'\n[hosts.shore-2]\nserver = 'shore'\n"
                         "[defaults]\nready-within = '120s'\n",
                         of, (folder() / "ports").string(), ports[0], ports[1], ports[2], ports[3], ports[4]));
        return file(name, "include = 'base.toml'\n" + over);
    }
    int pid(const std::string& path) { return state(path)["process_id"]; }
    /// Waits until telemetry that is new comes over a link, else the radio.
    void hears_the_boat(const std::string& by = "atirma/shore/xbee") {
        auto heard = json_of({"--wait", "--timeout", "240s", "echo", by, "telemetry", "--no-last", "-n", "1"});
        CHECK(heard.is_object());
    }
    json truth() {
        return json_of({"--wait", "--timeout", "120s", "echo", "atirma/boat", "ground_truth", "--no-last", "-n", "1"});
    }
};

} // namespace

TEST_CASE("the demo comes up on two hosts, is changed while it sails, and goes down leaving nothing") {
    harbour in;
    auto file = in.demo("demo.toml");
    auto text = in.up(file);
    INFO(text);
    auto air = text.find("start atirma/air on boat"), boat = text.find("start atirma/boat on boat"),
         proxy = text.find("start atirma/shore/xbee on shore"), node = text.find("start atirma/shore/node-1 on shore"),
         page = text.find("start atirma/page on shore");
    CHECK(air < boat);
    CHECK(air < proxy);
    CHECK(proxy < node);
    CHECK(node < page);
    CHECK(page != std::string::npos);
    in.hears_the_boat();

    int before = in.pid("atirma/boat");
    auto windy = in.demo(
        "windy.toml",
        "[components.boat.parameters]\nwind-speed = 11\nwind-from = 90\n[components.air.parameters]\nloss = 0.1\n");
    CHECK(in.done({"diff", windy}) == "change atirma/air on boat\n    loss: 0 -> 0.1\nchange atirma/boat on boat\n    "
                                      "wind-speed: 6 -> 11\n    wind-from: 45 -> 90\n");
    in.up(windy);
    CHECK(in.pid("atirma/boat") == before);
    CHECK(in.json_of({"param", "get", "atirma/air", "loss"})["values"][0] == "0.1");
    CHECK(in.json_of({"call", "atirma/air", "air_control", "{}"})["extra_loss"] == 0.1);
    wait_until([&] { return in.truth()["wind_speed_mps"] > 9; }); // gusts come and go

    ise_test::program listener({"ise", "--name-server", in.name_server(), "--timeout", "120s", "echo", "atirma/boat",
                                "ground_truth", "--losses"});
    REQUIRE(json::parse(listener.read_line())["packet"].is_object());
    auto moved =
        in.demo("moved.toml", "[components.boat]\nhost = 'shore-2'\n[components.boat.parameters]\nwind-speed = "
                              "11\nwind-from = 90\n[components.air.parameters]\nloss = 0.1\n");
    CHECK_THAT(in.up(moved), Contains("stop atirma/boat on boat (it moves to shore)") &&
                                 Contains("start atirma/boat on shore (it moves from boat)"));
    // Whoever listened follows, and is told that there is a gap, whose length nobody knows.
    while (!json::parse(listener.read_line())["lost_before"].is_null()) {}
    listener.signal(SIGINT);
    CHECK(listener.wait().exit_code == 0);
    in.hears_the_boat();

    in.done({"down", moved});
    CHECK(marked().empty());
    CHECK(host_test::zombies() == 0);
    CHECK(in.json_of({"ps"}).empty());
    CHECK(in.left_behind().empty());
}

TEST_CASE("kill -9 of any process of the demo heals as its policy says") {
    harbour in;
    auto file = in.demo("demo.toml");
    in.up(file);
    in.hears_the_boat();
    for (const char* path : {"atirma/boat", "atirma/air", "atirma/shore/xbee", "atirma/shore/node-1", "atirma/page"}) {
        int pid = in.pid(path);
        host_test::send_signal(pid, SIGKILL);
        wait_until([&] { // in one answer: between two it may end
            auto state = in.state(path);
            return state["state"] == "ready" && state["process_id"] != pid;
        });
        CHECK(in.state(path)["restarts"] == 1);
    }
    in.hears_the_boat();

    int boat = in.pid("atirma/boat");
    in.crash("boat");
    CHECK(lives(boat));
    in.hears_the_boat(); // nobody needs it for that
    in.open("boat");
    CHECK_THAT(in.up(file), Contains("nothing to do"));
    CHECK(in.pid("atirma/boat") == boat);

    in.crash_name_server();
    in.start_name_server();
    in.done({"--wait", "--timeout", "60s", "describe", "--names", "atirma/page"});
    in.hears_the_boat();
    wait_until([&] { return in.ise({"ps"}).exit_code == 0 && in.json_of({"ps"}).size() == 12; });
    CHECK_THAT(in.up(file), Contains("nothing to do"));
    CHECK(in.pid("atirma/boat") == boat);

    in.done({"down", file});
    CHECK(marked().empty());
    CHECK(in.left_behind().empty());
}

TEST_CASE("a fleet comes up from its file, and each boat is heard over each of its links") {
    harbour in;
    for (const char* boat : {"boat-2", "boat-3"})
        REQUIRE(ise_test::run_program(
                    {"atirma", "keys", "new", (in.folder() / "ports" / boat).string() + ".key", "--boat", boat})
                    .exit_code == 0);
    auto file = in.demo("fleet.toml",
                        fmt::format("[variables]\nboats = 3\nfleet = {}\niridium-period = 10\nfleet-key = '{}'\n",
                                    in.ports[5], (in.folder() / "ports" / "boat-{n}.key").string()),
                        "fleet");
    in.up(file);
    for (const char* boat : {"atirma", "boat-2", "boat-3"})
        for (const char* link : {"xbee", "gprs", "iridium"}) {
            INFO(boat << " over " << link);
            in.hears_the_boat(fmt::format("{}/shore/{}", boat, link));
        }
    in.done({"down", file});
    CHECK(marked().empty());
}

TEST_CASE("A-Tirma's file with a database in place of its nodes' files can be used") {
    harbour in;
    auto file = in.demo("shared.toml", "", "postgresql");
    CHECK_THAT(in.done({"validate", file}), Contains("atirma with 12 components on 3 hosts"));
    auto plan = in.json_of({"diff", file});
    for (const auto& step : plan["steps"]) CHECK(step["action"] == "start");
    CHECK(plan["steps"].size() == 12);
}
