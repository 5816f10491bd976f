// The command line as a shell sees it: what needs no running component.
#include "folder.hpp"

#include <support/catch.hpp>
#include <support/program.hpp>
#include <test_folders.hpp>

#include <algorithm>
#include <cctype>
#include <sstream>

using ise_test::run_program;
using ise_test::start_options;

namespace {

std::size_t columns(const std::string& of) {
    return static_cast<std::size_t>(
        std::ranges::count_if(of, [](char byte) { return (static_cast<unsigned char>(byte) & 0xC0) != 0x80; }));
}

} // namespace

TEST_CASE("wrong command lines end with 2, say why and print no answer") {
    auto arguments = GENERATE(
        std::vector<std::string>{"ise"}, std::vector<std::string>{"ise", "sail"},
        std::vector<std::string>{"ise", "describe"}, std::vector<std::string>{"ise", "call", "atirma/boat"},
        std::vector<std::string>{"ise", "list", "a", "b"}, std::vector<std::string>{"ise", "list", "--timeout", "soon"},
        std::vector<std::string>{"ise", "list", "--timeout", "0s"},
        std::vector<std::string>{"ise", "list", "--timeout", "1e300h"},
        std::vector<std::string>{"ise", "list", "--name-server", "nowhere"},
        std::vector<std::string>{"ise", "echo", "a", "b", "--count", "0"},
        std::vector<std::string>{"ise", "echo", "a", "b", "--count", "-3"},
        std::vector<std::string>{"ise", "echo", "a", "b", "--latest", "--lossless"},
        std::vector<std::string>{"ise", "echo", "a", "b", "--depth", "0"},
        std::vector<std::string>{"ise", "hz", "a", "b", "--window", "-1s"},
        std::vector<std::string>{"ise", "describe", "tcp://127.0.0.1"},
        std::vector<std::string>{"ise", "describe", "ftp://127.0.0.1:1"},
        std::vector<std::string>{"ise", "bw", "a", "b", "--window", "0s"},
        std::vector<std::string>{"ise", "delay", "a"}, std::vector<std::string>{"ise", "ping", "a", "--count", "0"},
        std::vector<std::string>{"ise", "top", "--once", "--count", "2"},
        std::vector<std::string>{"ise", "type", "show", "a"}, std::vector<std::string>{"ise", "type", "diff", "a", "b"},
        std::vector<std::string>{"ise", "type", "show", "a", "b", "c"},
        std::vector<std::string>{"ise", "completion", "tcsh"});
    CAPTURE(arguments);
    auto ran = run_program(arguments);
    CAPTURE(ran.err);
    CHECK(ran.exit_code == 2);
    CHECK(ran.out.empty());
    CHECK(ran.err.starts_with("ise: "));
}

TEST_CASE("a command that there is not is answered with the one that was meant") {
    auto slip = run_program({"ise", "--timeout", "2s", "cal", "atirma/boat", "helm"});
    CHECK(slip.exit_code == 2);
    CHECK_THAT(slip.err, ise_test::StartsWith("ise: no command 'cal', did you mean 'call'?"));
    CHECK_THAT(run_program({"ise", "photosynthesis"}).err,
               ise_test::Contains("no command 'photosynthesis'") && ise_test::Contains("ise --help"));
}

TEST_CASE("a wrong command line is answered with what is wrong and how the command is used") {
    auto said = [](std::vector<std::string> words) {
        words.insert(words.begin(), "ise");
        auto ran = run_program(words);
        CHECK(ran.exit_code == 2);
        return ran.err;
    };
    CHECK_THAT(said({}), ise_test::StartsWith("ise: a command is missing\n") && ise_test::Contains("ise --help"));
    CHECK_THAT(said({"list", "--tmeout", "3s"}),
               ise_test::StartsWith("ise: 'ise list' has no option '--tmeout', did you mean '--timeout'?\n") &&
                   ise_test::Contains("usage: ise list [OPTIONS] [PREFIX]"));
    CHECK_THAT(said({"list", "x", "y"}), ise_test::StartsWith("ise: 'y' is one argument too many\n"));
    CHECK_THAT(said({"call", "atirma/boat"}),
               ise_test::StartsWith("ise: SERVICE is required\n") &&
                   ise_test::Contains("usage: ise call [OPTIONS] NAME SERVICE [JSON]\n"));
    CHECK_THAT(said({"echo", "a", "b", "--count", "many"}),
               ise_test::Contains("--count: 'many' is not a whole number from 1 on\n"));
    CHECK_THAT(said({"param", "frob", "a"}), ise_test::Contains("'frob' is none of get, list, set"));
}

TEST_CASE("a shell that there is no completion for is answered with those that there are") {
    CHECK_THAT(run_program({"ise", "completion", "tcsh"}).err,
               ise_test::StartsWith("ise: SHELL: 'tcsh' is none of bash, zsh, fish"));
}

TEST_CASE("what is no name of a component is refused before anybody is asked") {
    start_options options;
    options.variables = {{"ISE_NAME_SERVER", "local://@ise-test-nobody-listens-here"}};
    auto wrong = GENERATE(std::string("house lamp"), std::string("tcp:/x"), std::string("/boat"),
                          std::string("atirma//boat"), std::string(300, 'a'));
    CAPTURE(wrong);
    for (const auto& words : std::vector<std::vector<std::string>>{
             {"ise", "describe", wrong}, {"ise", "ping", wrong}, {"ise", "list", wrong}, {"ise", "graph", wrong}}) {
        auto ran = run_program(words, options);
        CHECK(ran.exit_code == 2);
        CHECK_THAT(ran.err, ise_test::Contains("is not a name of a component"));
    }
    CHECK_THAT(run_program({"ise", "describe", "tcp:/x"}, options).err,
               ise_test::Contains("an endpoint is written tcp://"));
}

TEST_CASE("a name server variable that is no endpoint is named") {
    start_options options;
    options.variables = {{"ISE_NAME_SERVER", "here"}};
    auto ran = run_program({"ise", "list"}, options);
    CHECK(ran.exit_code == 2);
    CHECK_THAT(ran.err, ise_test::Contains("ISE_NAME_SERVER") && ise_test::Contains("'here' is not an endpoint"));
}

TEST_CASE("help and version are answers") {
    auto help = run_program({"ise", "--help"});
    CHECK(help.exit_code == 0);
    CHECK(help.err.empty());
    CHECK_THAT(help.out, ise_test::Contains("Exit codes:") && ise_test::Contains("describe") &&
                             ise_test::Contains("--name-server"));
    auto call = run_program({"ise", "call", "--help"});
    CHECK(call.exit_code == 0);
    CHECK_THAT(call.out, ise_test::Contains("SERVICE") && ise_test::Contains("standard input"));
    auto version = run_program({"ise", "version"});
    CHECK(version.exit_code == 0);
    CHECK(version.out.starts_with("ise "));
    CHECK(run_program({"ise", "--version"}).out == version.out);
}

TEST_CASE("commands are grouped, and the help of each has examples and the options of every command, in 80 columns") {
    auto all = run_program({"ise", "--help"});
    for (const char* group : {"See what there is:", "Talk to a component:", "Measure and find faults:",
                              "Start and stop components:", "Whole systems, from a deployment file:"})
        CHECK_THAT(all.out, ise_test::Contains(group));
    CHECK_THAT(all.out, !ise_test::Contains("Subcommands"));
    std::vector<std::string> commands;
    std::istringstream lines(all.out);
    for (std::string line; std::getline(lines, line);) {
        INFO(line);
        CHECK(columns(line) <= 80);
        if (line.starts_with("Exit codes:")) break;
        if (line.starts_with("  ") && std::islower(static_cast<unsigned char>(line[2])))
            commands.push_back(line.substr(2, line.find(' ', 2) - 2));
    }
    CHECK(commands.size() >= 28);
    for (const auto& command : commands) {
        auto help = run_program({"ise", command, "--help"});
        INFO(help.out << help.err);
        CHECK(help.exit_code == 0);
        CHECK_THAT(help.out, ise_test::Contains("Examples:\n  ") && ise_test::Contains("ise " + command) &&
                                 ise_test::Contains("Options of every command:") &&
                                 ise_test::Contains("--name-server ENDPOINT") && ise_test::Contains("--json") &&
                                 ise_test::Contains("Exit codes: ise --help"));
        std::istringstream text(help.out);
        for (std::string line; std::getline(text, line);) {
            INFO(line);
            CHECK(columns(line) <= 80);
        }
    }
}

TEST_CASE("every program says its name and what is missing on its command line") {
    auto said = [](std::vector<std::string> words) {
        auto ran = run_program(std::move(words));
        CHECK(ran.exit_code == 2);
        return ran.err;
    };
    CHECK_THAT(said({"ise_instantiation_server", "--name", "boat"}),
               ise_test::StartsWith("ise_instantiation_server: --programs is required\n"));
    CHECK_THAT(said({"ise_name_server", "--lease"}), ise_test::StartsWith("ise_name_server: --lease"));
    CHECK_THAT(said({"ise_name_server", "--lease", "2 weeks"}),
               ise_test::StartsWith("ise_name_server: --lease: '2 weeks' is not a duration: write 5s, 250ms"));
    CHECK_THAT(said({"ise_name_server", "--lease", "20ms"}),
               ise_test::StartsWith("ise_name_server: --lease: '20ms' is not from 50ms to 1h\n"));
    CHECK_THAT(said({"ise_instantiation_server", "--programs", "/tmp", "--grace", "-1s"}),
               ise_test::StartsWith("ise_instantiation_server: --grace: '-1s' is not a duration"));
    CHECK_THAT(said({"atirma"}),
               ise_test::StartsWith("atirma: one of these is required: ") && ise_test::Contains(" run "));
    CHECK_THAT(said({"atirma", "run"}), ise_test::StartsWith("atirma: one of these is required: boat-simulator "));
    CHECK_THAT(
        said({"atirma", "run", "communication-node", "--boats", "2"}),
        ise_test::StartsWith("atirma: --file: several boats cannot use 'communication.db' together; give each its "
                             "own, such as --file '{boat}-communication.db'"));
    CHECK_THAT(said({"atirma", "run", "gprs-proxy", "--boats=2", "--database=/tmp/spent"}),
               ise_test::Contains("such as --database '/tmp/{boat}-spent'"));
    CHECK_THAT(said({"atirma", "replay", "voyage.mcap"}),
               ise_test::StartsWith("atirma: one of these is required: ") && ise_test::Contains("communication-node"));
}

TEST_CASE("a folder in the place of a file is said to be one") {
    cli_test::folder in;
    for (auto words :
         {std::vector<std::string>{"ise", "trace", in.path.string()}, {"ise", "validate", in.path.string()}}) {
        auto ran = run_program(words);
        CHECK(ran.exit_code == 2);
        CHECK_THAT(ran.err, ise_test::Contains("cannot read " + in.path.string() + ": it is a folder"));
    }
}

TEST_CASE("where no name server runs the command says how to start one") {
    start_options options;
    options.variables = {{"ISE_NAME_SERVER", "local://@ise-test-nobody-listens-here"}};
    auto command =
        GENERATE(std::vector<std::string>{"ise", "list"}, std::vector<std::string>{"ise", "describe", "atirma/boat"},
                 std::vector<std::string>{"ise", "call", "atirma/boat", "helm"});
    auto ran = run_program(command, options);
    CHECK(ran.exit_code == 3);
    CHECK(ran.out.empty());
    CHECK_THAT(ran.err, ise_test::Contains("no name server at local://@ise-test-nobody-listens-here") &&
                            ise_test::Contains("ise_name_server"));
}

TEST_CASE("an endpoint where nobody listens is not reached") {
    auto ran = run_program({"ise", "describe", "local://@ise-test-nobody-listens-here"});
    CHECK(ran.exit_code == 3);
    CHECK_THAT(ran.err, ise_test::Contains("local://@ise-test-nobody-listens-here is not reached") &&
                            ise_test::Contains("--wait"));
    auto waited =
        run_program({"ise", "--wait", "--timeout", "300ms", "describe", "local://@ise-test-nobody-listens-here"});
    CHECK(waited.exit_code == 3);
    CHECK_THAT(waited.err, ise_test::Contains("in time"));
}

TEST_CASE("with --json an error is one line for a program") {
    auto ran = run_program({"ise", "describe", "--json", "local://@ise-test-nobody-listens-here"});
    CHECK(ran.exit_code == 3);
    CHECK(ran.out.empty());
    CHECK(ran.err.starts_with(R"({"error":"unreachable","exit_code":3,"message":)"));
    CHECK(ran.err.find('\n') == ran.err.size() - 1);
    auto usage = run_program({"ise", "--json", "sail"});
    CHECK(usage.exit_code == 2);
    CHECK(usage.err.starts_with(R"({"error":"usage","exit_code":2,)"));
}

TEST_CASE("an answer that cannot be written is an error of its own") {
    start_options closed;
    closed.closed_output = true;
    auto ran = run_program({"ise", "version"}, closed);
    CHECK(ran.exit_code == 5);
    CHECK_THAT(ran.err, ise_test::Contains("standard output cannot be written"));
    start_options full;
    full.output_file = "/dev/full";
    CHECK(run_program({"ise", "version"}, full).exit_code == 5);
}

TEST_CASE("the completion scripts are good in their shells and know every command") {
    auto shell = GENERATE(std::string("bash"), std::string("zsh"), std::string("fish"));
    CAPTURE(shell);
    auto script = run_program({"ise", "completion", shell});
    REQUIRE(script.exit_code == 0);
    for (const char* word : {"list", "describe", "call", "echo", "hz", "doctor", "graph", "top", "ping", "bw", "delay",
                             "tree", "services", "types", "completion", "version", "name-server", "lossless"})
        CHECK_THAT(script.out, ise_test::Contains(word));
    // A shell that is not installed checks nothing: bash always is.
    auto found = run_program({"/bin/sh", "-c", "command -v " + shell});
    if (found.exit_code != 0) {
        REQUIRE(shell != "bash");
        WARN(shell << " is not installed: its completion script was not parsed");
        return;
    }
    start_options options;
    options.input = script.out;
    auto parsed = run_program({"/bin/sh", "-c", shell + " -n /dev/stdin"}, options);
    CHECK(parsed.exit_code == 0);
    CHECK(parsed.err.empty());
}

namespace {

// What bash offers where the cursor is at the end of `line`.
std::string offered(const std::string& line, const std::string& name_server = "local://@ise-test-nobody-listens-here") {
    start_options options;
    options.variables = {{"ISE_NAME_SERVER", name_server}};
    auto script =
        R"(source <("$1" completion bash); COMP_LINE="$1 $2"; COMP_POINT=${#COMP_LINE}; _ise; echo "${COMPREPLY[*]}")";
    return run_program({"/bin/bash", "-c", script, "bash", ISE_BINARY_DIR "/bin/ise", line}, options).out;
}

} // namespace

TEST_CASE("bash completes commands, options and choices") {
    CHECK(offered("des") == "describe\n");
    CHECK(offered("gra") == "graph\n");
    CHECK(offered("type ") == "diff show\n");
    CHECK(offered("top --on") == "--once\n");
    CHECK(offered("--json ver") == "version\n");
    CHECK(offered("completion ") == "bash zsh fish\n");
    CHECK(offered("echo a b --los") == "--lossless --losses\n");
    CHECK(offered("echo a b --count ") == "\n");
    CHECK(offered("list --na") == "--names --name-server\n");
    // Nobody is there to be asked: no name is offered, and no error is seen.
    CHECK(offered("call ") == "\n");
}
