// The command line against a running component that it was not compiled with.
#include "boat.hpp"

#include <ise/service/service_host.hpp>

#include <support/catch.hpp>
#include <support/program.hpp>

#include <fmt/format.h>

#include <csignal>
#include <test_folders.hpp>
#include <thread>

using cli_test::harbour;
using ise_test::Contains;
using ise_test::program;
using ise_test::run_program;
using ise_test::start_options;

TEST_CASE("call sends JSON and prints the response as one line where it is piped") {
    harbour in;
    auto ran = run_program({"ise", "call", in.at, "helm", R"({"mode":"fly"})"});
    CHECK(ran.exit_code == 0);
    CHECK(ran.out == R"({"accepted":false,"reason":"fly"})"
                     "\n");
    CHECK(ran.err.empty());
    SECTION("a field that is not given has the provider's default") {
        CHECK(run_program({"ise", "call", in.at, "helm", "{}"}).out == R"({"accepted":true,"reason":"hold"})"
                                                                       "\n");
    }
    SECTION("without JSON nothing is called where the request has fields: the struct and an example are shown") {
        auto bare = run_program({"ise", "call", in.at, "helm"});
        CHECK(bare.exit_code == 2);
        CHECK(bare.out.empty());
        CHECK_THAT(bare.err, Contains("the request of 'helm' has fields") && Contains("     it is struct set_mode") &&
                                 Contains("\n       mode: string") &&
                                 Contains("ise call " + in.at + R"( helm '{"mode":"hold"}')"));
    }
    SECTION("- reads standard input") {
        start_options options;
        options.input = R"({"waypoints":[)";
        for (int number = 0; number < 20'000; ++number)
            options.input += fmt::format(R"({}{{"name":"w{}","latitude_deg":28}})", number ? "," : "", number);
        options.input += "]}";
        auto long_route = run_program({"ise", "--timeout", "60s", "call", in.at, "plan", "-"}, options);
        CHECK(long_route.err == "");
        CHECK(long_route.out == R"({"count":20000})"
                                "\n");
    }
    SECTION("over several lines on demand") {
        CHECK(run_program({"ise", "--pretty", "call", in.at, "plan", "{}"}).out == "{\n  \"count\": 0\n}\n");
    }
}

TEST_CASE("JSON that does not fit ends with 4 and the path of what is wrong") {
    harbour in;
    auto wrong =
        run_program({"ise", "call", in.at, "plan", R"({"waypoints":[{"name":"a"},{"latitude_deg":"north"}]})"});
    CHECK(wrong.exit_code == 4);
    CHECK(wrong.out.empty());
    CHECK_THAT(wrong.err, Contains("waypoints[1].latitude_deg") && Contains("number") && Contains("latitude_deg: f64"));
    auto unknown = run_program({"ise", "call", in.at, "helm", R"({"mod":"hold"})"});
    CHECK(unknown.exit_code == 4);
    CHECK_THAT(unknown.err, Contains("did you mean 'mode'?"));
    auto broken = run_program({"ise", "--json", "call", in.at, "helm", "{"});
    CHECK(broken.exit_code == 4);
    CHECK_THAT(broken.err, Contains(R"("error":"malformed")"));
    CHECK(run_program({"ise", "echo", in.at, "counted", R"({"first":-1})"}).exit_code == 4);
}

TEST_CASE("a provider's refusal and failure end with 1 and its text, fit for a terminal") {
    harbour in;
    auto refused = run_program({"ise", "call", in.at, "helm", R"({"mode":"sink"})"});
    CHECK(refused.exit_code == 1);
    CHECK_THAT(refused.err, Contains("boats float"));
    auto failed = run_program({"ise", "call", in.at, "helm", R"({"mode":"break"})"});
    CHECK(failed.exit_code == 1);
    CHECK_THAT(failed.err, Contains("the rudder") && Contains("it may have been executed") && !Contains("\x1b"));
    auto result = run_program({"ise", "call", "--json", in.at, "helm", R"({"mode":"sink"})"});
    CHECK_THAT(result.err, Contains(R"("error":"refused","exit_code":1)") && Contains(R"("executed":")"));
}

TEST_CASE("a call that is not answered ends at its timeout with 3") {
    harbour in;
    auto ran = run_program({"ise", "--timeout", "500ms", "call", in.at, "never", "{}"});
    CHECK(ran.exit_code == 3);
    CHECK_THAT(ran.err, Contains("'never'") && Contains("it may have been executed"));
}

TEST_CASE("a service that is not there is answered with those that are") {
    harbour in;
    auto ran = run_program({"ise", "call", in.at, "helmet"});
    CHECK(ran.exit_code == 3);
    CHECK_THAT(ran.err, Contains("no service 'helmet'") && Contains("'plan'") && Contains("did you mean 'helm'?"));
    CHECK(run_program({"ise", "call", in.at, "beeper"}).exit_code == 3); // required, not provided
    auto other = run_program({"ise", "call", in.at, "position"});
    CHECK(other.exit_code == 2);
    CHECK_THAT(other.err, Contains("ise echo " + in.at + " position"));
    auto calls = run_program({"ise", "hz", in.at, "helm"});
    CHECK(calls.exit_code == 2);
    CHECK_THAT(calls.err, Contains("ise call " + in.at + " helm"));
}

TEST_CASE("describe tells services, packets, counts and how to try them") {
    harbour in;
    auto page = run_program({"ise", "describe", in.at});
    CHECK(page.exit_code == 0);
    CHECK_THAT(page.out, Contains("atirma/boat  ready") && Contains(in.at) && Contains("helm  (request-response)") &&
                             Contains("position  (subscription)"));
    CHECK_THAT(page.out, Contains("latitude_deg: f64") &&
                             Contains("ise call " + in.at + R"( helm '{"mode":"hold"}')") &&
                             Contains("required of others\n  beeper"));
    CHECK_THAT(page.out, !Contains("ise.describe"));
    CHECK_THAT(run_program({"ise", "describe", "--all", in.at}).out, Contains("ise.describe"));
    CHECK(run_program({"ise", "describe", "--names", in.at}).out ==
          "helm\nnever\nplan\nretire\ncounted\nposition\nsilent\nwatched\n");
    auto json = run_program({"ise", "describe", "--json", in.at});
    CHECK(json.out.starts_with(R"({"path":"atirma/boat","state":"ready","host":")"));
    CHECK_THAT(
        json.out,
        Contains(
            R"({"name":"helm","kind":"request-response","provided":true,"packets":[{"role":"request","fingerprint":")"));
    CHECK(json.out.find('\n') == json.out.size() - 1);
}

TEST_CASE("echo prints a packet a line and ends after as many as were wanted") {
    harbour in;
    auto ran = run_program({"ise", "echo", in.at, "position", "--count", "5"});
    CHECK(ran.exit_code == 0);
    CHECK(std::ranges::count(ran.out, '\n') == 5);
    CHECK_THAT(ran.out, Contains(R"("latitude_deg":28.15,"longitude_deg":-15.45})"));
    SECTION("the user's own subscribe packet goes along") {
        auto from = run_program({"ise", "echo", in.at, "counted", R"({"first":7000})", "-n", "2", "--no-last"});
        CHECK(from.out.starts_with(R"({"number":7000,)"));
        CHECK(run_program({"ise", "echo", in.at, "counted", "-n", "1", "--no-last"})
                  .out.starts_with(R"({"number":100,)"));
    }
    SECTION("its losses go with the packets on demand") {
        auto losses = run_program({"ise", "echo", in.at, "position", "-n", "1", "--losses"});
        CHECK(losses.out.starts_with(R"({"lost_before":0,"packet":{"number":)"));
    }
    SECTION("after its time it ends; too few packets are an error") {
        CHECK(run_program({"ise", "echo", in.at, "silent", "--for", "100ms"}).exit_code == 0);
        auto few = run_program({"ise", "echo", in.at, "silent", "--for", "100ms", "-n", "1"});
        CHECK(few.exit_code == 3);
        CHECK_THAT(few.err, Contains("0 of 1 packets"));
    }
}

TEST_CASE("echo shows the answer to its subscription on standard error, once, and packets alone on standard output") {
    harbour in;
    auto ran = run_program({"ise", "echo", in.at, "watched", R"({"first":7})", "-n", "3"});
    CHECK(ran.exit_code == 0);
    CHECK(std::ranges::count(ran.out, '\n') == 3);
    CHECK(ran.out.starts_with(R"({"number":)"));
    CHECK(ran.err.starts_with("ise: 'watched' answers {\"officer\":\"Ana"));
    CHECK_THAT(ran.err, Contains(R"("from":7})") && !Contains("\xc2\x9b"));
    CHECK(std::ranges::count(ran.err, '\n') == 1);
    SECTION("for programs as JSON") {
        auto result = run_program({"ise", "--json", "echo", in.at, "watched", "-n", "1"});
        CHECK(result.out.starts_with(R"({"number":)"));
        CHECK(result.err.starts_with(R"({"response":{"officer":"Ana)"));
        CHECK(result.err.ends_with("\"from\":100}}\n"));
    }
    SECTION("an answer without fields is none") {
        CHECK(run_program({"ise", "echo", in.at, "position", "-n", "1"}).err.empty());
    }
}

TEST_CASE("echo ends quietly when its reader has gone, and unsubscribes with the user's packet") {
    harbour in;
    auto before = in.ship.left.load();
    program echo({"ise", "echo", in.at, "counted"});
    CHECK(echo.read_line().starts_with(R"({"number":)"));
    echo.close_output();
    auto ran = echo.wait();
    CHECK(ran.exit_code == 0);
    CHECK(ran.err.empty());
    CHECK(in.ship.left == before + 1);
    auto piped = run_program({"/bin/bash", "-c", "set -o pipefail; \"$1\" echo \"$2\" position | head -2", "bash",
                              ISE_BINARY_DIR "/bin/ise", in.at});
    CHECK(piped.exit_code == 0);
    CHECK(std::ranges::count(piped.out, '\n') == 2);
}

TEST_CASE("Ctrl-C is the usual end of echo and hz, and 130 for what waits for an answer") {
    harbour in;
    SECTION("echo") {
        program echo({"ise", "echo", in.at, "position"});
        echo.read_line();
        echo.signal(SIGINT);
        auto ran = echo.wait();
        CHECK(ran.exit_code == 0);
        CHECK(ran.err.empty());
    }
    SECTION("hz") {
        program hz({"ise", "hz", in.at, "position", "--window", "50ms"});
        CHECK_THAT(hz.read_line(), Contains("RATE") && Contains("JITTER") && Contains("LOST"));
        CHECK_THAT(hz.read_line(), Contains(" Hz "));
        hz.signal(SIGTERM);
        CHECK(hz.wait().exit_code == 0);
    }
    SECTION("echo that counts") {
        program echo({"ise", "echo", in.at, "position", "--count", "1000000"});
        echo.read_line();
        echo.signal(SIGINT);
        CHECK(echo.wait().exit_code == 130);
    }
    SECTION("call") {
        program call({"ise", "--timeout", "1h", "call", in.at, "never", "{}"});
        while (in.ship.stuck == 0) std::this_thread::yield();
        call.signal(SIGINT);
        CHECK(call.wait().exit_code == 130);
    }
    SECTION("echo whose reader does not read") {
        program echo({"ise", "echo", in.at, "position", "--pretty"});
        echo.read_line(); // then its pipe fills
        std::uint64_t published = 0;
        // Some 60 bytes a packet: 64 KiB are full long before that.
        while (published < 4000)
            published = in.ship.wait([](cli_test::boat& ship) -> ise::task<std::uint64_t> {
                co_return ship.services().counts().packets_published;
            }(in.ship));
        echo.signal(SIGINT);
        CHECK(echo.wait().exit_code == 0);
    }
}

TEST_CASE("hz measures windows as JSON for programs") {
    harbour in;
    auto ran = run_program({"ise", "hz", "--json", in.at, "position", "--window", "100ms", "--count", "2"});
    CHECK(ran.exit_code == 0);
    CHECK(std::ranges::count(ran.out, '\n') == 2);
    CHECK(ran.out.starts_with(R"({"rate_hz":)"));
    CHECK_THAT(ran.out,
               Contains(R"("jitter_s":)") && Contains(R"("connected":true)") && Contains(R"("lost_at_provider":)"));
    auto silent = run_program({"ise", "hz", "--json", in.at, "silent", "--window", "50ms", "--count", "1"});
    CHECK(silent.out.starts_with(R"({"rate_hz":0.0,"packets":0,"mean_s":null)"));
}

TEST_CASE("echo tells that the component has ended the subscription") {
    harbour in;
    program echo({"ise", "echo", in.at, "silent"});
    while (in.ship.watching == 0) std::this_thread::yield();
    CHECK(run_program({"ise", "call", in.at, "retire"}).out == "{}\n");
    auto ran = echo.wait();
    CHECK(ran.exit_code == 3); // it is not there any more
    CHECK_THAT(ran.err, Contains("'silent'"));
}
