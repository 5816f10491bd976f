// The command line with a name server: components are found by their paths.
#include "port.hpp"

#include <support/catch.hpp>
#include <support/program.hpp>
#include <test_folders.hpp>

using cli_test::port;
using ise_test::Contains;
using ise_test::run_program;
using ise_test::start_options;

TEST_CASE("list tells the components that are registered") {
    port in;
    auto page = in.ise({"list"});
    CHECK(page.exit_code == 0);
    CHECK(page.out.starts_with("PATH"));
    CHECK_THAT(page.out, Contains("atirma/boat ") && Contains("atirma/shore/xbee ") && Contains("tcp://127.0.0.1:") &&
                             Contains("LEASE AGE"));
    CHECK(in.ise({"list", "--names"}).out == "atirma/boat\natirma/shore/xbee\n");
    CHECK(in.ise({"list", "--names", "atirma/shore"}).out == "atirma/shore/xbee\n");
    auto json = in.ise({"list", "--json", "atirma/boat"});
    CHECK(json.out.starts_with(R"([{"path":"atirma/boat","state":"ready",)"));
    CHECK_THAT(json.out, Contains(R"("lease_age_s":)"));
    auto none = in.ise({"list", "moon", "--json"});
    CHECK(none.exit_code == 0);
    CHECK(none.out == "[]\n");
    CHECK_THAT(none.err, Contains("no component is registered under 'moon'"));
    auto slip = in.ise({"list", "atirma/shor"});
    CHECK(slip.out.starts_with("PATH"));
    CHECK_THAT(slip.err,
               Contains("no component is registered under 'atirma/shor'; did you mean") && Contains("'atirma/shore'"));
}

TEST_CASE("a component is described, called and listened to by its path") {
    port in;
    CHECK(in.ise({"call", "atirma/boat", "helm", R"({"mode":"tack"})"}).out == R"({"accepted":true,"reason":"tack"})"
                                                                               "\n");
    CHECK(std::ranges::count(in.ise({"echo", "atirma/shore/xbee", "position", "-n", "3"}).out, '\n') == 3);
    CHECK_THAT(in.ise({"describe", "atirma/boat"}).out,
               Contains("atirma/boat  ready") && Contains("epoch ") && Contains("ise call atirma/boat helm"));
}

TEST_CASE("a name that nobody holds is answered with the nearest that there are") {
    port in;
    auto slip = in.ise({"describe", "atirma/boot"});
    CHECK(slip.exit_code == 3);
    CHECK(slip.out.empty());
    CHECK_THAT(slip.err, Contains("atirma/boot") && Contains("did you mean 'atirma/boat'"));
    CHECK_THAT(in.ise({"describe", "xbee"}).err, Contains("did you mean 'atirma/shore/xbee'"));
    CHECK_THAT(in.ise({"describe", "something/else/entirely"}).err, Contains("2 names are registered"));
}

TEST_CASE("the option --wait waits for a component that starts later") {
    port in;
    ise_test::program call(
        {"ise", "--name-server", in.at.text(), "--wait", "--timeout", "60s", "call", "atirma/late", "helm", "{}"});
    in.boats->start<cli_test::boat>("atirma/late");
    auto ran = call.wait();
    CHECK(ran.exit_code == 0);
    CHECK(ran.out == R"({"accepted":true,"reason":"hold"})"
                     "\n");
}

TEST_CASE("bash completes names of components and services by asking them") {
    port in;
    start_options options;
    options.variables = {{"ISE_NAME_SERVER", in.at.text()}};
    auto offered = [&](const std::string& line) {
        auto script =
            R"(source <("$1" completion bash); COMP_LINE="$1 $2"; COMP_POINT=${#COMP_LINE}; _ise; echo "${COMPREPLY[*]}")";
        return run_program({"/bin/bash", "-c", script, "bash", ISE_BINARY_DIR "/bin/ise", line}, options).out;
    };
    CHECK(offered("describe ") == "atirma/boat atirma/shore/xbee\n");
    CHECK(offered("call --timeout 2s atirma/s") == "atirma/shore/xbee\n");
    CHECK(offered("call atirma/boat he") == "helm\n");
    CHECK(offered("echo --name-server " + in.at.text() + " atirma/boat pos") == "position\n");
}

TEST_CASE("cli: list and describe show roles, their members and who is taken") {
    port there;
    there.start_gateways();
    auto listed = there.ise({"list"});
    CHECK(listed.exit_code == 0);
    CHECK_THAT(listed.out,
               Contains("ROLE") && Contains("atirma/gateway  *      7         ready") && Contains("shore/gateway1"));
    auto role = there.ise({"list", "atirma/gateway"});
    CHECK(role.exit_code == 0);
    CHECK_THAT(role.out, Contains("shore/gateway7") && !Contains("atirma/boat"));
    auto json = there.ise({"list", "shore", "--json"});
    CHECK_THAT(json.out, Contains(R"("roles":[{"role":"atirma/gateway","priority":7,"taken":true}])"));
    auto described = there.ise({"describe", "atirma/gateway"});
    CHECK(described.exit_code == 0);
    CHECK_THAT(described.out, Contains("atirma/gateway  (role)") && Contains("shore/gateway7  7         ready  *") &&
                                  Contains("helm"));
    CHECK_THAT(there.ise({"describe", "shore/gateway1"}).out, Contains("serves     atirma/gateway, priority 1"));
    auto called = there.ise({"call", "atirma/gateway", "helm", R"({"mode":"hold"})"});
    CHECK(called.exit_code == 0);
}
