// The demo on two hosts that share no network but a wire between them.
#include "two_hosts.hpp"

#include <system/instantiation/host.hpp>

#include <optional>
#include <test_folders.hpp>

using namespace deployment_test;
using host_test::marked;
using ise_test::Contains;

namespace {

/// The boat, its radio and the page of A-Tirma's file, with addresses at which the other host reaches them.
std::string apart(const two_hosts& in, const std::string& boat_on, int wind_speed = 6) {
    auto listen = [](const std::string& host) {
        return "ready-within = '120s'\nlisten = ['tcp://" + networks::address(host) + ":0']\n";
    };
    return "include = '" ISE_SOURCE_DIR "/apps/atirma/atirma.toml'\n[variables]\nfolder = '" +
           (in.folder() / "ports").string() + "'\npage = 0\nspeedup = 20\n[hosts.shore-1]\nserver = 'shore'\n" +
           "[hosts.shore-2]\nserver = 'shore'\n[components.air]\n" + listen("boat") + "[components.boat]\nhost = '" +
           (boat_on == "boat" ? "boat" : "shore-1") + "'\nafter = 'air'\n" + listen(boat_on) +
           "[components.boat.parameters]\ngprs = ''\niridium-serial = ''\nwind-speed = " + std::to_string(wind_speed) +
           "\n[components.'shore/xbee']\n" + listen("shore") + "[components.'shore/xbee'.parameters]\nstore = ''\n" +
           "[components.page]\nafter = 'shore/xbee'\n" + listen("shore") +
           "[components.page.parameters]\ntelemetry = 'atirma/shore/xbee'\n";
}

const std::vector<std::string> parts{"air", "boat", "shore/xbee", "page"};

} // namespace

TEST_CASE(
    "the demo comes up on two networks from one file, a component moves to the other, and nothing is left behind") {
    std::optional<networks> wire;
    try {
        wire.emplace();
        for (const char* host : {"boat", "shore"}) wire->dig(host, two_hosts::port_of(host));
    } catch (const std::runtime_error& why) {
        WARN("skipped: " << why.what());
        return;
    }
    two_hosts in(&*wire);
    in.install("atirma");
    auto hears_the_boat = [&] {
        CHECK(in.json_of(
                    {"--wait", "--timeout", "240s", "echo", "atirma/shore/xbee", "telemetry", "--no-last", "-n", "1"})
                  .is_object());
    };
    in.up(in.file("demo.toml", apart(in, "boat")), parts);
    CHECK(in.state("atirma/boat")["host"] == "boat");
    CHECK(in.state("atirma/page")["host"] == "shore");
    hears_the_boat();
    in.done({"param", "set", "atirma/boat", "wind-speed", "9"});

    auto moved = in.file("moved.toml", apart(in, "shore", 9));
    auto words = wire->inside("shore");
    words.insert(words.end(), {ISE_BINARY_DIR "/bin/ise", "--name-server", in.name_server(), "--timeout", "240s",
                               "echo", "atirma/boat", "ground_truth", "--losses"});
    ise_test::program listener(words);
    REQUIRE(json::parse(listener.read_line())["packet"].is_object());
    CHECK_THAT(in.up(moved, parts), Contains("stop atirma/boat on boat (it moves to shore)") &&
                                        Contains("start atirma/boat on shore (it moves from boat)"));
    // The boat's next life has packets of its own: a gap whose length nobody knows.
    while (!json::parse(listener.read_line())["lost_before"].is_null()) {}
    listener.signal(SIGINT);
    listener.wait();
    CHECK(in.state("atirma/boat")["host"] == "shore");
    hears_the_boat();

    in.done({"down", moved});
    CHECK(marked().empty());
    CHECK(in.json_of({"ps"}).empty());
    CHECK(in.left_behind().empty());
}
