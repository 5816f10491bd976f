// Parameters of running components, by the command line.
#include "two_hosts.hpp"
#include <test_folders.hpp>

using namespace deployment_test;
using ise_test::Contains;

namespace {

/// A `trouble` that an instantiation server has started.
struct started : two_hosts {
    started() {
        done({"start", "trouble", "sea/one", "--host", "boat", "--timeout", "120s", "--ready-within", "60s", "--set",
              "say=hello"});
    }
};

} // namespace

TEST_CASE("parameters are listed, read and set") {
    started in;
    auto page = in.done({"param", "list", "sea/one"});
    CHECK_THAT(page, Contains("PARAMETER") && Contains("answer") && Contains("a number from 0 to 10 (m)") &&
                         Contains("at a start"));
    CHECK(in.done({"param", "get", "sea/one", "answer"}) == "7\n");
    CHECK(in.done({"param", "get", "sea/one", "say"}) == "hello\n");
    CHECK(in.done({"param", "set", "sea/one", "answer", "2.5"}) == "2.5\n");
    CHECK(in.json_of({"call", "sea/one", "ask"})["answer"] == 2.5);
    auto result = in.json_of({"param", "get", "sea/one", "answer"});
    CHECK(result["values"] == json::array({"2.5"}));
    CHECK(result["changeable"] == true);
    CHECK(in.json_of({"param", "list", "sea/one"}).size() == 13);
    CHECK(in.state("sea/one")["arguments"][1]["value"] == "2.5"); // and so in the next life
}

TEST_CASE("what cannot be set is refused, with what is allowed") {
    started in;
    auto refusal = [&](std::vector<std::string> words, int code) {
        words.insert(words.begin(), {"param"});
        auto ran = in.ise(std::move(words));
        INFO(ran.err);
        CHECK(ran.exit_code == code);
        CHECK_THAT(ran.err, !Contains("'ise.")); // of services that nobody named
        return ran.err;
    };
    CHECK_THAT(refusal({"set", "sea/one", "answer", "11"}, 1),
               Contains("parameter 'answer' cannot be '11': it must be a number from 0 to 10 (m)"));
    CHECK_THAT(refusal({"set", "sea/one", "anwser", "1"}, 1), Contains("has no parameter 'anwser'"));
    CHECK_THAT(refusal({"get", "sea/one", "anwser"}, 1),
               Contains("there is no parameter 'anwser'; did you mean 'answer'?"));
    CHECK_THAT(refusal({"set", "sea/one", "say", "x"}, 1),
               Contains("parameter 'say' of 'sea/one' cannot be changed while it runs, only answer: to start it again "
                        "with another value"));
    CHECK_THAT(refusal({"set", "sea/one", "answer", "9"}, 1),
               Contains("sea/one refuses it: nine is no answer") && !Contains("ise.change_parameters"));
    CHECK_THAT(refusal({"set", "sea/one", "answer"}, 2), Contains("ise param set requires a VALUE"));
    CHECK_THAT(refusal({"list", "sea/one", "answer"}, 2), Contains("ise param list does not accept PARAMETER"));
    CHECK_THAT(refusal({"list", "ise/host/boat"}, 3), Contains("'ise/host/boat' has no parameters that can be read"));
    CHECK(in.json_of({"call", "sea/one", "ask"})["answer"] == 7);
}

TEST_CASE("a component that nobody has started is asked itself, and takes parameters from its environment") {
    two_hosts in;
    ise_test::start_options options;
    options.variables = {
        {"ISE_PARAMETER_ANSWER", "5"}, {"ISE_PARAMETER_SAY", "not heard"}, {"ISE_NAME_SERVER", in.name_server()}};
    ise_test::program alone({"ise_trouble", "run", "trouble", "--path=sea/alone", "--say=the command line stands above",
                             "--log-level=error"},
                            options);
    in.done({"--wait", "--timeout", "60s", "describe", "--names", "sea/alone"});
    CHECK(in.done({"param", "get", "sea/alone", "answer"}) == "5\n");
    CHECK(in.done({"param", "get", "sea/alone", "say"}) == "the command line stands above\n");
    CHECK(in.done({"param", "set", "sea/alone", "answer", "6"}) == "6\n");
    CHECK(in.json_of({"call", "sea/alone", "ask"})["answer"] == 6);
    auto vetoed = in.ise({"param", "set", "sea/alone", "answer", "9"});
    CHECK(vetoed.exit_code == 1);
    CHECK_THAT(vetoed.err, Contains("nine is no answer"));
    CHECK(in.done({"param", "get", "sea/alone", "answer"}) == "6\n");
    options.variables = {{"ISE_PARAMETER_ANSWER", "50"}, {"ISE_NAME_SERVER", in.name_server()}};
    auto wrong = ise_test::run_program({"ise_trouble", "run", "trouble"}, options);
    CHECK(wrong.exit_code == 2);
    CHECK_THAT(wrong.err, Contains("the environment variable ISE_PARAMETER_ANSWER: parameter 'answer' cannot be '50': "
                                   "it must be a number from 0 to 10 (m)"));
    auto said = ise_test::run_program({"ise_trouble", "run", "trouble", "--answer=-1"});
    CHECK(said.exit_code == 2);
    CHECK_THAT(said.err, Contains("parameter 'answer' cannot be '-1': it must be a number from 0 to 10 (m)"));
}

TEST_CASE("bash completes deployment files, actions and parameters") {
    started in;
    in.file("sea.toml", "");
    ise_test::start_options options;
    options.variables = {{"ISE_NAME_SERVER", in.name_server()}};
    auto offered = [&](const std::string& line) {
        auto script =
            R"(source <("$1" completion bash); COMP_LINE="$1 $2"; COMP_POINT=${#COMP_LINE}; _ise; echo "${COMPREPLY[*]}")";
        return ise_test::run_program({"/bin/bash", "-c", script, "bash", ISE_BINARY_DIR "/bin/ise", line}, options).out;
    };
    CHECK(offered("up " + in.folder().string() + "/se") == in.folder().string() + "/sea.toml\n");
    CHECK(offered("param s") == "set\n");
    CHECK(offered("param get sea/o") == "sea/one\n");
    CHECK(offered("param get sea/one an") == "answer\n");
}
