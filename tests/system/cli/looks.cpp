// The commands that look at a whole system, and those that measure it.
#include "port.hpp"

#include <support/catch.hpp>
#include <support/terminal_program.hpp>

#include <atomic>
#include <csignal>
#include <test_folders.hpp>
#include <thread>

using cli_test::port;
using ise_test::Contains;
using ise_test::run_program;
using ise_test::start_options;
using ise_test::terminal_program;

namespace {

using namespace std::chrono_literals;

struct sample {
    ise::wall_time measured_at{};
    std::uint32_t number = 0;
};
inline constexpr ise::subscription<sample> samples{"samples"};
inline constexpr ise::subscription<sample> early{"early"};
// What the boats need, as they need it and not.
inline constexpr ise::request_response<cli_test::set_mode, cli_test::mode_set> beeper{"beeper"};
inline constexpr ise::request_response<cli_test::route, cli_test::route_set> other_beeper{"beeper"};

ise::task<> beep(ise::component& self) {
    self.provide(beeper, [](cli_test::set_mode) { return cli_test::mode_set{true, "beep"}; });
    co_await self.sleep(1h);
}
ise::task<> honk(ise::component& self) {
    self.provide(other_beeper, [](cli_test::route) { return cli_test::route_set{}; });
    co_await self.sleep(1h);
}
ise::task<> watch_boat(ise::component& self) {
    self.require(cli_test::position);
    auto boat = self.at("atirma/boat");
    auto fixes = co_await boat.subscribe(cli_test::position);
    co_await self.ready();
    for (;;) {
        auto packet = co_await fixes.next();
        if (!packet) co_return;
    }
}
ise::task<> take_samples(ise::component& self) {
    auto out = self.publish(samples);
    auto from_tomorrow = self.publish(early);
    for (std::uint32_t number = 0;; ++number) {
        co_await self.sleep(2ms);
        out(sample{self.wall(), number});
        from_tomorrow(sample{self.wall() + 24h, number});
    }
}

void start(port& in, const std::string& path, ise::task<> (*body)(ise::component&)) {
    auto& one = in.boats->start(path, body);
    one.wait(one.ready());
}

// Machines that run many tests take their time.
std::vector<std::string> patiently(std::vector<std::string> words) {
    words.insert(words.begin(), {"--timeout", "120s"});
    return words;
}

} // namespace

TEST_CASE("doctor finds nothing wrong with a system where everybody has what he needs") {
    port in;
    start(in, "atirma/beeper", beep);
    auto ran = in.ise(patiently({"doctor", "--interval", "50ms"}));
    INFO(ran.out << ran.err);
    CHECK(ran.exit_code == 0);
    CHECK_THAT(ran.out, Contains("nothing is wrong") && Contains("as of ") && Contains("3 components answered within"));
    auto json = in.ise(patiently({"doctor", "--json", "--interval", "50ms"}));
    CHECK(json.exit_code == 0);
    CHECK(json.out.starts_with(R"({"healthy":true,"asked_at":")"));
}

TEST_CASE("doctor tells services that nobody provides, and those that do not fit, with what to do") {
    port in;
    auto nobody = in.ise(patiently({"doctor", "--interval", "50ms"}));
    CHECK(nobody.exit_code == 1);
    CHECK_THAT(nobody.out,
               Contains("warning  atirma/boat: no component provides 'beeper'") && Contains("-> start the component"));
    CHECK_THAT(nobody.err, Contains("2 findings"));
    start(in, "atirma/horn", honk);
    auto misfit = in.ise(patiently({"doctor", "--interval", "50ms"}));
    CHECK(misfit.exit_code == 1);
    CHECK_THAT(misfit.out, Contains("'beeper' as it needs it does not fit 'beeper' of atirma/horn") &&
                               Contains("mode") && Contains("waypoints") &&
                               Contains("ise type diff atirma/boat beeper atirma/horn"));
    CHECK_THAT(in.ise(patiently({"doctor", "--json", "--interval", "50ms"})).out,
               Contains(R"("kind":"schema_mismatch","component":"atirma/boat")"));
}

TEST_CASE("doctor names a stalled component, and a name server that is not there") {
    SECTION("stalled") {
        port in;
        start(in, "atirma/beeper", beep);
        std::atomic<bool> held{true};
        auto& busy = in.boats->start("atirma/busy", [&held](ise::component& self) -> ise::task<> {
            co_await self.ready();
            while (held) std::this_thread::sleep_for(1ms);
        });
        static_cast<void>(busy);
        while (in.ise({"list", "atirma/busy"}).out.find("stalled") == std::string::npos) std::this_thread::yield();
        auto ran = in.ise({"--timeout", "10s", "doctor", "--interval", "50ms"});
        held = false;
        CHECK(ran.exit_code == 1);
        CHECK_THAT(ran.out, Contains("error    atirma/busy: it is stalled") && Contains("offload"));
    }
    SECTION("no name server") {
        start_options options;
        options.variables = {{"ISE_NAME_SERVER", "local://@ise-test-nobody-listens-here"}};
        auto ran = run_program({"ise", "doctor"}, options);
        CHECK(ran.exit_code == 1);
        CHECK_THAT(ran.out, Contains("error    there is no name server at local://@ise-test-nobody-listens-here") &&
                                Contains("-> start one with ise_name_server"));
        CHECK_THAT(run_program({"ise", "--json", "doctor"}, options).out,
                   Contains(R"("healthy":false)") && Contains(R"("kind":"no_name_server")"));
    }
}

TEST_CASE("graph shows who is connected to whom and over what, and not itself") {
    port in;
    start(in, "sea/console", watch_boat);
    auto text = in.ise(patiently({"graph"}));
    CHECK(text.exit_code == 0);
    CHECK_THAT(text.out, Contains("  sea/console  ready\n") && Contains("─ atirma/boat  inproc") &&
                             Contains("uses     position  subscription  ") &&
                             Contains("provides position  subscription  ") &&
                             Contains("needs beeper: missing, no component provides it"));
    CHECK_THAT(text.out, !Contains("ise/cli") && Contains("as of ") && !Contains("\x1b"));
    auto dot = in.ise(patiently({"graph", "--dot"}));
    CHECK(dot.out.starts_with("digraph ise {"));
    CHECK_THAT(dot.out, Contains(R"x("sea/console" -> "atirma/boat" [label="position )x") &&
                            Contains(R"x("atirma/boat" -> "missing beeper")x") && Contains("subgraph cluster_0"));
    auto json = in.ise(patiently({"graph", "--json", "sea"}));
    CHECK_THAT(json.out,
               Contains(R"("connections":[{"a":"atirma/boat","b":"sea/console",)") &&
                   Contains(R"("services":[{"service":"position","provider":"atirma/boat","kind":"subscription",)") &&
                   Contains(R"("missing":["beeper"])"));
    terminal_program drawn({"ise", "--timeout", "120s", "--name-server", in.at.text(), "graph"}, 80, 24);
    CHECK(drawn.wait() == 0);
    CHECK(drawn.wrapped() == 0);
    CHECK_THAT(drawn.raw(), Contains("\x1b[32mready"));
}

TEST_CASE("top shows rates between two looks") {
    port in;
    auto once = in.ise(patiently({"top", "--once", "--every", "100ms"}));
    CHECK(once.exit_code == 0);
    CHECK_THAT(once.out, ise_test::StartsWith("STATE") && Contains("PACKETS/S") && Contains("REFUSED") &&
                             Contains("atirma/shore/xbee") && !Contains("\x1b"));
    auto json = in.ise(patiently({"top", "--once", "--every", "100ms", "--json", "atirma/boat"}));
    CHECK_THAT(json.out, Contains(R"("path":"atirma/boat","state":"ready")") && Contains(R"("packets_hz":)") &&
                             !Contains(R"("packets_hz":null)") && !Contains(R"("packets_hz":0.0)"));
    CHECK(std::ranges::count(in.ise(patiently({"top", "--json", "--count", "2", "--every", "50ms"})).out, '\n') == 2);
    SECTION("Ctrl-C is its usual end") {
        ise_test::program top({"ise", "--name-server", in.at.text(), "--timeout", "120s", "top", "--every", "50ms"});
        top.read_line();
        top.signal(SIGINT);
        CHECK(top.wait().exit_code == 0);
    }
}

TEST_CASE("list fits on a terminal of 80 columns, with a name, a state and an endpoint on every line") {
    port in;
    terminal_program list({"ise", "--timeout", "120s", "--name-server", in.at.text(), "list", "atirma/boat"}, 80, 24);
    CHECK(list.wait() == 0);
    CHECK(list.wrapped() == 0);
    for (const auto& line : list.lines())
        CHECK_THAT(line,
                   Contains("tcp://127.0.0.1:") || Contains("ENDPOINTS") || Contains("TAKEN") || ise_test::Equals(""));
}

TEST_CASE("ping, bw and delay measure") {
    port in;
    start(in, "atirma/sampler", take_samples);
    SECTION("ping") {
        auto ran = in.ise(patiently({"ping", "atirma/boat", "-n", "3", "--every", "1ms"}));
        CHECK(ran.exit_code == 0);
        CHECK_THAT(ran.out, Contains("3: atirma/boat answered after ") && Contains("3 of 3 answered; min ") &&
                                Contains("median ") && Contains("its clock is "));
        auto json = in.ise(patiently({"ping", "atirma/boat", "-n", "1", "--json"}));
        CHECK_THAT(json.out, Contains(R"("round_trip_s":)") && Contains(R"({"sent":1,"answered":1,"min_s":)") &&
                                 Contains(R"("service":"ise.health")"));
        CHECK(in.ise({"ping", "atirma/boot"}).exit_code == 3);
    }
    SECTION("bw") {
        auto ran = in.ise(patiently({"bw", "atirma/sampler", "samples", "--window", "100ms", "-n", "2"}));
        CHECK(ran.exit_code == 0);
        CHECK_THAT(ran.out, Contains("BYTES/S") && Contains("12 B"));
        CHECK_THAT(in.ise(patiently({"bw", "--json", "atirma/sampler", "samples", "--window", "100ms", "-n", "1"})).out,
                   Contains(R"("smallest":12,"largest":12)"));
        CHECK(in.ise({"bw", "atirma/boat", "helm"}).exit_code == 2);
    }
    SECTION("delay") {
        auto ran = in.ise(patiently({"delay", "atirma/sampler", "samples", "--window", "100ms", "-n", "1"}));
        CHECK(ran.exit_code == 0);
        CHECK_THAT(ran.out, Contains("age by measured_at") && !Contains("from the future"));
        auto future = in.ise(
            patiently({"delay", "atirma/sampler", "early", "--window", "100ms", "-n", "1", "--field", "measured_at"}));
        CHECK_THAT(future.out, Contains("from the future"));
        CHECK_THAT(
            in.ise(patiently({"delay", "--json", "atirma/sampler", "early", "--window", "100ms", "-n", "1"})).out,
            Contains(R"({"field":"measured_at","youngest_s":-)"));
        // Packets without a time of their own have that of their publication.
        auto none = in.ise(patiently({"delay", "atirma/boat", "position", "--window", "100ms", "-n", "1"}));
        CHECK(none.exit_code == 0);
        CHECK_THAT(none.out, Contains("publi"));
        auto wrong = in.ise(patiently({"delay", "atirma/sampler", "samples", "--field", "number"}));
        CHECK(wrong.exit_code == 2);
        CHECK_THAT(wrong.err, Contains("no time 'number'") && Contains("'measured_at'"));
    }
}

TEST_CASE("tree, services and types tell what there is") {
    port in;
    start(in, "atirma/horn", honk);
    auto tree = in.ise(patiently({"tree"}));
    CHECK(tree.exit_code == 0);
    CHECK_THAT(tree.out, ise_test::StartsWith("atirma/\n├─ boat  ready, ") &&
                             Contains("└─ shore/\n   └─ xbee  ready, ") && Contains("lease renewed"));
    CHECK_THAT(in.ise(patiently({"tree", "--services", "atirma/boat"})).out,
               Contains("├─ provides helm  (request-response)\n") && Contains("provides position  (subscription)") &&
                   Contains("needs    beeper  ("));
    CHECK_THAT(
        in.ise(patiently({"tree", "--json"})).out,
        ise_test::StartsWith(
            R"([{"name":"atirma","path":"atirma","below":[{"name":"boat","path":"atirma/boat","state":"ready")"));
    auto services = in.ise(patiently({"services"}));
    CHECK_THAT(services.out, ise_test::StartsWith("SERVICE") && Contains("beeper") && Contains("atirma/horn") &&
                                 Contains("helm") && !Contains("ise.describe"));
    CHECK_THAT(
        in.ise(patiently({"services", "--json", "atirma/horn"})).out,
        ise_test::StartsWith(
            R"([{"name":"beeper","kind":"request-response","providers":["atirma/horn"],"requirers":["atirma/boat","atirma/shore/xbee"],"missing":false}])"));
    CHECK_THAT(in.ise(patiently({"types"})).out, Contains("set_mode") && Contains("atirma/boat helm (request)"));
    auto shown = in.ise(patiently({"type", "show", "atirma/boat", "helm"}));
    CHECK(shown.exit_code == 0);
    CHECK_THAT(shown.out, Contains("helm  (request-response)") && Contains("mode: string"));
    auto same = in.ise(patiently({"type", "diff", "atirma/boat", "helm", "atirma/shore/xbee"}));
    CHECK(same.exit_code == 0);
    CHECK(same.out == "request: equal\nresponse: equal\n");
    auto other = in.ise(patiently({"type", "diff", "atirma/boat", "beeper", "atirma/horn"}));
    CHECK(other.exit_code == 4);
    CHECK_THAT(other.out, Contains("request: does not fit\n    "));
    CHECK_THAT(in.ise(patiently({"type", "diff", "--json", "atirma/boat", "helm", "atirma/horn", "beeper"})).out,
               ise_test::StartsWith(R"({"compatible":false,)"));
    auto none = in.ise(patiently({"type", "show", "atirma/boat", "helmet"}));
    CHECK(none.exit_code == 3);
    CHECK_THAT(none.err, Contains("did you mean 'helm'?"));
}
