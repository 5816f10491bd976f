// The command line with a name server: components are found by their paths.
#include "boat.hpp"

#include <ise/name_server/name_server.hpp>
#include <ise/naming/services.hpp>

#include <support/catch.hpp>
#include <support/program.hpp>

using Catch::Contains;
using ise_test::ran;
using ise_test::run_program;
using ise_test::start_options;

namespace {

/// A name server and two boats that it knows, on real sockets.
class port {
public:
    port() : names(env, without_names()) {
        ise::component_options options;
        options.listen = {ise::endpoint::parse("tcp://127.0.0.1:0").value()};
        options.registers = false;
        ise::name_server_options fresh;
        fresh.fresh = true;
        auto& server = names.start<ise::name_server>(std::string(ise::naming::server_path), options, fresh);
        at = server.services().listening().front();
        boats.emplace(env, with_names(at));
        for (const char* path : {"atirma/boat", "atirma/shore/xbee"}) {
            auto& one = boats->start<cli_test::boat>(path);
            one.wait(one.ready());
        }
    }

    ran ise(std::vector<std::string> arguments) {
        arguments.insert(arguments.begin(), {"ise", "--name-server", at.text()});
        return run_program(std::move(arguments));
    }

    ise::real_environment env;
    ise::node names;
    ise::endpoint at;
    std::optional<ise::node> boats;

private:
    static ise::node_options without_names() {
        ise::node_options options;
        options.use_names = false;
        options.log = {};
        return options;
    }
    static ise::node_options with_names(const ise::endpoint& server) {
        ise::node_options options;
        options.name_server = server;
        options.log = std::getenv("ISE_TEST_LOG") ? ise::log_to_stderr(ise::log_level::debug) : ise::log_sink();
        return options;
    }
};

} // namespace

TEST_CASE("list tells the components that are registered") {
    port in;
    auto page = in.ise({"list"});
    CHECK(page.exit_code == 0);
    CHECK(page.out.starts_with("PATH"));
    CHECK_THAT(page.out, Contains("atirma/boat ") && Contains("atirma/shore/xbee ") && Contains("tcp://127.0.0.1:") && Contains("LEASE AGE"));
    CHECK(in.ise({"list", "--names"}).out == "atirma/boat\natirma/shore/xbee\n");
    CHECK(in.ise({"list", "--names", "atirma/shore"}).out == "atirma/shore/xbee\n");
    auto json = in.ise({"list", "--json", "atirma/boat"});
    CHECK(json.out.starts_with(R"([{"path":"atirma/boat","state":"ready",)"));
    CHECK_THAT(json.out, Contains(R"("lease_age_s":)"));
    auto none = in.ise({"list", "moon", "--json"});
    CHECK(none.exit_code == 0);
    CHECK(none.out == "[]\n");
    CHECK_THAT(none.err, Contains("no component is registered under 'moon'"));
}

TEST_CASE("a component is described, called and listened to by its path") {
    port in;
    CHECK(in.ise({"call", "atirma/boat", "helm", R"({"mode":"tack"})"}).out == R"({"accepted":true,"reason":"tack"})" "\n");
    CHECK(std::ranges::count(in.ise({"echo", "atirma/shore/xbee", "position", "-n", "3"}).out, '\n') == 3);
    CHECK_THAT(in.ise({"describe", "atirma/boat"}).out, Contains("atirma/boat  ready") && Contains("epoch ") && Contains("ise call atirma/boat helm"));
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
    ise_test::program call({"ise", "--name-server", in.at.text(), "--wait", "--timeout", "60s", "call", "atirma/late", "helm"});
    in.boats->start<cli_test::boat>("atirma/late");
    auto ran = call.wait();
    CHECK(ran.exit_code == 0);
    CHECK(ran.out == R"({"accepted":true,"reason":"hold"})" "\n");
}

TEST_CASE("bash completes names of components and services by asking them") {
    port in;
    start_options options;
    options.variables = {{"ISE_NAME_SERVER", in.at.text()}};
    auto offered = [&](const std::string& line) {
        auto script = R"(source <("$1" completion bash); COMP_LINE="$1 $2"; COMP_POINT=${#COMP_LINE}; _ise; echo "${COMPREPLY[*]}")";
        return run_program({"/bin/bash", "-c", script, "bash", ISE_BINARY_DIR "/bin/ise", line}, options).out;
    };
    CHECK(offered("describe ") == "atirma/boat atirma/shore/xbee\n");
    CHECK(offered("call --timeout 2s atirma/s") == "atirma/shore/xbee\n");
    CHECK(offered("call atirma/boat he") == "helm\n");
    CHECK(offered("echo --name-server " + in.at.text() + " atirma/boat pos") == "position\n");
}
