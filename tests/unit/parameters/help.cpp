// What `PROGRAM run TYPE --help` prints.
#include <ise/component/program_words.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <sstream>

namespace help_test {

using ise::detail::help_of;
using ise::detail::read_words;
using ise_test::Contains;

namespace {

struct gust {
    double speed_mps = 0;
};
struct question {
    std::string text;
};
struct reply {
    bool accepted = false;
};
inline constexpr ise::subscription<gust> gusts{"gusts"};
inline constexpr ise::request_response<question, reply> helm{"helm"};

class wind_component : public ise::component {
    ise::task<> run() override { co_return; }
};

struct wind_options {
    double speed = 6;
    std::string place;
    std::vector<std::string> islands;
};

ise::component_type wind_type() {
    auto options = std::make_shared<wind_options>();
    ise::component_type type("wind", "what drives the boat", "sea/wind");
    type.provides(gusts).requires_(helm);
    type.parameters
        .add("speed", options->speed,
             "of the wind, as an anemometer at the masthead of a boat of two metres would measure it")
        .range(0, 40)
        .unit("m/s")
        .changeable();
    type.parameters.add("place", options->place, "where it blows").one_of({"Gando", "Taliarte"});
    type.parameters.add("a-name-that-is-longer-than-others", options->islands, "that slow it down");
    type.make = [options] { return std::make_unique<wind_component>(); };
    return type;
}

} // namespace

TEST_CASE(
    "help of a type lists its services and its parameters with what is allowed, default and text, in 80 columns") {
    auto text = help_of("weather", wind_type());
    CHECK_THAT(text, ise_test::StartsWith("wind: what drives the boat\nusage: weather run wind "));
    CHECK_THAT(text, Contains("path: sea/wind\n") && Contains("provides: gusts\n") && Contains("requires: helm\n"));
    std::string plain;
    std::istringstream words(text);
    for (std::string word; words >> word;) plain += word + " ";
    CHECK_THAT(plain,
               Contains("--speed of the wind, as an anemometer at the masthead of a boat of two metres would measure "
                        "it: a number from 0 to 40 (m/s); also while it runs (ise param set) (default: 6) "));
    CHECK_THAT(plain, Contains("--place where it blows: one of Gando, Taliarte (default: none) "));
    CHECK_THAT(
        plain,
        Contains(
            "--a-name-that-is-longer-than-others that slow it down: a text; several are allowed (default: none) "));
    CHECK_THAT(plain, Contains("--name-server=ENDPOINT ") &&
                          Contains("Exit codes: 0 ended as asked, 1 failed, 2 wrong arguments."));
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
        INFO(line);
        CHECK(line.size() <= 80);
    }
}

TEST_CASE("help of a program lists its types and how to see the parameters of one") {
    std::vector<ise::component_type> types{wind_type()};
    CHECK_THAT(help_of("weather", types, true), Contains("weather run TYPE --help") && Contains("wind ") &&
                                                    Contains("what drives the boat (path: sea/wind)") &&
                                                    Contains("weather host --control"));
    CHECK_THAT(help_of("weather", types, false), !Contains("weather host"));
}

TEST_CASE("--help among the words of a run is a question, but not as the value of another") {
    auto type = wind_type();
    CHECK(read_words({"--help"}, &type).help);
    CHECK(read_words({"--speed", "8", "-h"}, &type).help);
    CHECK_FALSE(read_words({"--place", "Gando"}, &type).help);
    CHECK_THROWS_WITH(read_words({"--speed", "--help"}, &type), Contains("'--help'"));
}

} // namespace help_test
