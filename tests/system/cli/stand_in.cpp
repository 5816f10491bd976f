// Commands that provide: pub, mock; and what works without headers at both ends: run, echo of many, types --cpp.
#include "folder.hpp"
#include "port.hpp"

#include <ise/component/component.hpp>
#include <ise/service/action.hpp>
#include <ise/service/action_runs.hpp>

#include <support/catch.hpp>
#include <support/program.hpp>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <test_folders.hpp>
#include <thread>
#include <utility>
#include <vector>

using cli_test::folder;
using cli_test::harbour;
using cli_test::port;
using ise_test::Contains;
using ise_test::program;
using ise_test::run_program;

namespace {

struct leg {
    std::uint32_t number = 0;
};
struct arrival {
    std::string at;
};
constexpr ise::action<cli_test::waypoint, leg, arrival> sail_to{"sail_to"};

class sailor : public ise::component {
public:
    std::atomic<int> cancelled{0};

private:
    ise::task<> run() override {
        provide(sail_to, [this](cli_test::waypoint to, ise::progress<leg> progress) -> ise::task<arrival> {
            if (to.name == "shoals") throw ise::error(ise::errc::refused, "too shallow");
            try {
                for (std::uint32_t number = 1; number <= 2 || to.name == "far"; ++number) {
                    leg done{number};
                    co_await progress(done);
                    co_await sleep(std::chrono::milliseconds(5));
                }
            } catch (const std::exception&) {
                ++cancelled;
                throw;
            }
            arrival made{to.name};
            co_return made;
        });
        co_await sleep(std::chrono::hours(1));
    }
};

std::vector<std::string> with_names(const port& in, std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"ise", "--name-server", in.at.text(), "--timeout", "20s"});
    return arguments;
}

} // namespace

TEST_CASE("mock stands in for a component, whose types it knows from another one or from a file") {
    port in;
    SECTION("from those that are running") {
        program mock(with_names(in, {"mock", "atirma/twin", "helm", R"({"accepted":true,"reason":"mocked"})"}));
        CHECK_THAT(mock.read_error_line(), Contains("listens at "));
        auto called = in.ise({"call", "atirma/twin", "helm", R"({"mode":"tack"})"});
        CHECK(called.err == "");
        CHECK(called.out == R"({"accepted":true,"reason":"mocked"})"
                            "\n");
        CHECK_THAT(mock.read_line(), Contains("helm by ") && Contains(R"(answered {"mode":"tack"})"));
        auto taken = in.ise({"mock", "atirma/twin", "helm", "{}"});
        CHECK(taken.exit_code == 1);
        CHECK_THAT(taken.err, Contains("'atirma/twin' is running already"));
        mock.signal(SIGINT);
        CHECK(mock.wait().exit_code == 0);
    }
    SECTION("by rules, of several services") {
        folder files;
        auto rules = files.write("helm.json", R"([{"request":{"mode":"fly"},"refuse":"boats sail"},
            {"request":{"mode":"hold"},"response":{"accepted":true,"reason":"held"},"delay":"1ms"}])");
        program mock(
            with_names(in, {"--json", "mock", "atirma/twin", "helm", rules, "position", R"({"latitude_deg":1.5})"}));
        CHECK_THAT(mock.read_error_line(), Contains("listens at "));
        auto refused = in.ise({"call", "atirma/twin", "helm", R"({"mode":"fly"})"});
        CHECK(refused.exit_code == 1);
        CHECK_THAT(refused.err, Contains("boats sail"));
        CHECK(in.ise({"call", "atirma/twin", "helm", "{}"}).out == R"({"accepted":true,"reason":"held"})"
                                                                   "\n");
        CHECK_THAT(in.ise({"call", "atirma/twin", "helm", R"({"mode":"jibe"})"}).err,
                   Contains("no rule for this request"));
        CHECK_THAT(in.ise({"echo", "atirma/twin", "position", "-n", "1"}).out, Contains(R"("latitude_deg":1.5)"));
        CHECK_THAT(mock.read_line(), Contains(R"("request":{"mode":"fly"},"outcome":"refused"})"));
    }
    SECTION("by rules on the command line, as the help shows") {
        program mock(
            with_names(in, {"mock", "atirma/twin", "helm",
                            R"([{"request":{"mode":"fly"},"refuse":"boats sail"},{"response":{"accepted":true}}])"}));
        CHECK_THAT(mock.read_error_line(), Contains("listens at "));
        CHECK_THAT(in.ise({"call", "atirma/twin", "helm", R"({"mode":"fly"})"}).err, Contains("boats sail"));
        CHECK(in.ise({"call", "atirma/twin", "helm", "{}"}).out == R"({"accepted":true,"reason":""})"
                                                                   "\n");
    }
    SECTION("from a file that was kept, without a name server") {
        folder files;
        auto result = in.ise({"type", "show", "atirma/boat", "helm", "--json"});
        auto types = files.write("boat.types", result.out);
        program mock({"ise", "mock", "atirma/boat", "helm", R"({"reason":"alone"})", "--types", types, "--listen",
                      "tcp://127.0.0.1:0"});
        auto line = mock.read_error_line();
        auto at = line.substr(line.find("tcp://"));
        CHECK(run_program({"ise", "call", at, "helm", "{}"}).out == R"({"accepted":false,"reason":"alone"})"
                                                                    "\n");
    }
    SECTION("what cannot be is refused") {
        CHECK_THAT(in.ise({"mock", "atirma/twin", "helm"}).err, Contains("SERVICE"));
        auto unknown = in.ise({"mock", "atirma/twin", "hlem", "{}"});
        CHECK(unknown.exit_code == 3);
        CHECK_THAT(unknown.err, Contains("no running component provides or needs a service 'hlem'"));
        auto unfit = in.ise({"mock", "atirma/twin", "helm", R"({"acepted":true})"});
        CHECK(unfit.exit_code == 4);
        CHECK_THAT(unfit.err, Contains("acepted"));
        CHECK_THAT(in.ise({"mock", "atirma/twin", "helm", R"([{"refuse":1}])"}).err,
                   Contains("rule 1 of 'helm': 'refuse' is no text"));
        CHECK(in.ise({"pub", "atirma/twin", "helm", "{}"}).exit_code == 2);
        CHECK(in.ise({"pub", "not a path", "position", "{}"}).exit_code == 2);
    }
}

TEST_CASE("pub publishes a packet, once or again and again, also lines of standard input") {
    port in;
    program pub(with_names(in, {"pub", "atirma/twin", "position", R"({"number":5})"}));
    CHECK_THAT(pub.read_error_line(), Contains("listens at "));
    auto last = in.ise({"echo", "atirma/twin", "position", "-n", "1", "--field", "number"});
    CHECK(last.out == "5\n");
    ise_test::start_options lines;
    lines.input = "{\"number\":1}\n\n{\"number\":2}\n";
    program many(
        with_names(in, {"pub", "atirma/many", "position", "-", "--rate", "200", "--subscribers", "1", "-n", "3"}),
        lines);
    CHECK_THAT(many.read_error_line(), Contains("listens at "));
    auto seen = in.ise({"echo", "atirma/many", "position", "-n", "3", "--field", "number"});
    CHECK(seen.out == "1\n2\n1\n");
    CHECK(many.wait().exit_code == 0);
}

TEST_CASE("echo shows what all matching components publish, by fields, as CSV and with times") {
    port in;
    auto all = in.ise({"echo", "atirma/**", "posi*", "-n", "20", "--for", "20s", "--field", "latitude_deg"});
    CHECK(all.exit_code == 0);
    CHECK(std::ranges::count(all.out, '\n') == 20);
    CHECK_THAT(all.out, Contains(R"({"component":"atirma/boat","service":"position","packet":28.15})") &&
                            Contains(R"({"component":"atirma/shore/xbee","service":"position","packet":28.15})"));
    auto csv = in.ise({"echo", "atirma/boat", "position", "--csv", "--stamp", "--field", "latitude_deg", "-n", "1"});
    CHECK(csv.out.starts_with("published_at,latitude_deg\n20"));
    CHECK_THAT(csv.out, Contains("Z,28.15\n"));
    auto stamped = in.ise({"echo", "atirma/boat", "position", "--stamp", "-n", "1"});
    CHECK(stamped.out.starts_with(R"({"published_at":"20)"));
    auto wrong = in.ise({"echo", "atirma/boat", "position", "--field", "latitude"});
    CHECK(wrong.exit_code == 2);
    CHECK_THAT(wrong.err, Contains("no field 'latitude'") && Contains("latitude_deg"));
    CHECK(in.ise({"echo", "atirma/boat"}).exit_code == 2);
    CHECK(in.ise({"echo", "atirma/*", "--csv"}).exit_code == 2);
    auto age = in.ise({"delay", "atirma/boat", "position", "--window", "100ms", "-n", "1", "--json"});
    CHECK(age.out.starts_with(R"x({"field":"(published)","youngest_s":)x"));
}

TEST_CASE("run runs an action, describe shows it, and echo does not begin one by surprise") {
    port in;
    auto& ship = in.boats->start<sailor>("atirma/sailor");
    ship.wait(ship.ready());
    auto ran = in.ise({"run", "atirma/sailor", "sail_to", R"({"name":"bay"})"});
    CHECK(ran.exit_code == 0);
    CHECK(ran.out == R"({"feedback":{"number":1}})"
                     "\n"
                     R"({"feedback":{"number":2}})"
                     "\n"
                     R"({"result":{"at":"bay"}})"
                     "\n");
    auto refused = in.ise({"run", "atirma/sailor", "sail_to", R"({"name":"shoals"})"});
    CHECK(refused.exit_code == 1);
    CHECK_THAT(refused.err, Contains("too shallow"));
    auto late = in.ise({"run", "atirma/sailor", "sail_to", R"({"name":"far"})", "--deadline", "2s"});
    CHECK(late.exit_code == 3);
    program stopped(with_names(in, {"run", "atirma/sailor", "sail_to", R"({"name":"far"})"}));
    CHECK(stopped.read_line() == R"({"feedback":{"number":1}})");
    stopped.signal(SIGINT);
    CHECK(stopped.wait().exit_code == 130);
    for (int i = 0; i < 2000 && ship.cancelled < 2; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    CHECK(ship.cancelled == 2); // the deadline, and Ctrl-C
    auto page = in.ise({"describe", "atirma/sailor"});
    CHECK_THAT(page.out, Contains("sail_to  (action)") && Contains("  goal\n") && Contains("  feedback\n") &&
                             Contains("ise run atirma/sailor sail_to"));
    auto echoed = in.ise({"echo", "atirma/sailor", "sail_to"});
    CHECK(echoed.exit_code == 2);
    CHECK_THAT(echoed.err, Contains("is an action"));
    auto called = in.ise({"call", "atirma/sailor", "sail_to", "{}"});
    CHECK(called.exit_code == 2);
    CHECK_THAT(called.err, Contains("is an action") && Contains("ise run atirma/sailor sail_to"));
    CHECK_THAT(in.ise({"services", "atirma/sailor"}).out, Contains("sail_to") && Contains("action"));
    CHECK_THAT(in.ise({"type", "show", "atirma/sailor", "sail_to"}).out, Contains("sail_to  (action)"));
    CHECK_THAT(in.ise({"tree", "--services"}).out, Contains("provides sail_to  (action)"));
    CHECK(in.ise({"run", "atirma/boat", "position"}).exit_code == 2);
}

TEST_CASE("types --cpp writes a header of a running component") {
    port in;
    auto header = in.ise({"types", "atirma/boat", "--cpp"});
    CHECK(header.exit_code == 0);
    CHECK_THAT(header.out,
               Contains("#pragma once") && Contains("namespace atirma::boat {") && Contains("struct fix {") &&
                   Contains("std::string mode = \"hold\";") &&
                   Contains("inline constexpr ise::request_response<set_mode, mode_set> helm{\"helm\"};") &&
                   Contains("inline constexpr ise::subscription<fix, from_number, ise::nothing, farewell> counted"));
    folder files;
    auto written = files.write("boat.hpp", header.out);
    const char* compiler = std::getenv("CXX"); // by default the system's; the library needs C++20
    auto compiled =
        run_program({"/usr/bin/env", compiler ? compiler : "c++", "-std=c++20", "-fsyntax-only", "-x", "c++",
                     "-DASIO_SEPARATE_COMPILATION", "-DASIO_NO_DEPRECATED", "-I", ISE_SOURCE_DIR, written});
    INFO(compiled.err);
    CHECK(compiled.exit_code == 0);
}
