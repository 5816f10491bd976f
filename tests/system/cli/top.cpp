// `ise top` on a terminal, as a person sees it.
#include "port.hpp"

#include <support/catch.hpp>
#include <support/terminal_program.hpp>

#include <csignal>

using cli_test::port;
using ise_test::Contains;
using ise_test::start_options;
using ise_test::terminal_program;

namespace {

using namespace std::chrono_literals;

std::vector<std::string> top_at(const port& in, std::vector<std::string> more = {}) {
    std::vector<std::string> words{"ise", "--timeout", "120s", "--name-server", in.at.text(), "top", "--every", "50ms"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
}

start_options with(std::vector<std::pair<std::string, std::string>> variables) {
    start_options options;
    options.variables = std::move(variables);
    return options;
}

std::string screen_of(const terminal_program& of) {
    std::string all;
    for (const auto& line : of.lines()) all += line + "\n";
    return all;
}

} // namespace

TEST_CASE("top fills a terminal of 80 by 24, wraps nothing, and follows when it is resized") {
    port in;
    for (int number = 0; number < 30; ++number)
        in.boats->start("atirma/a/component/of/many/number" + std::to_string(number),
                        [](ise::component& self) -> ise::task<> { co_await self.sleep(1h); });
    terminal_program top(top_at(in), 80, 24);
    REQUIRE(top.wait_for("32 components"));
    REQUIRE(top.wait_until([&] { return screen_of(top).find("▁") != std::string::npos; }));
    INFO(screen_of(top));
    CHECK(top.wrapped() == 0);
    CHECK_THAT(top.lines().at(3), ise_test::StartsWith("COMPONENT") && Contains("RTT") && Contains("ACTIVITY"));
    CHECK_THAT(top.lines().at(2), Contains("1-19 of 32"));
    CHECK_THAT(top.lines().at(23), Contains("filter") && Contains("q quit"));
    CHECK_THAT(screen_of(top), !Contains("UNSENT") && Contains("number17"));
    top.press("\x1bOF"); // End
    CHECK(top.wait_for("atirma/shore/xbee"));
    top.resize(140, 40);
    CHECK(top.wait_for("UNSENT"));
    CHECK(top.wait_until([&] { return top.lines().at(39).find("filter") != std::string::npos; }));
    top.press("?"); // a page that does not change: what is drawn then is of the new size
    REQUIRE(top.wait_for("any key goes back"));
    auto drawn = top.raw().size();
    top.resize(20, 5);
    REQUIRE(top.wait_until([&] { return top.raw().find("\x1b[2J", drawn) != std::string::npos; }));
    top.press("x");
    CHECK(top.wait_until([&] { return top.lines().at(4).find("select") != std::string::npos; }));
    CHECK(top.wrapped() == 0);
    top.press("q");
    CHECK(top.wait() == 0);
    CHECK(top.as_a_shell_wants_it());
}

TEST_CASE("top filters, shows details and helps, and leaves the terminal as it was") {
    port in;
    terminal_program top(top_at(in), 80, 24);
    REQUIRE(top.wait_for("2 components"));
    CHECK(top.on_alternate_screen());
    CHECK_FALSE(top.cursor_is_visible());
    top.press("?");
    CHECK(top.wait_for("any key goes back"));
    top.press("x");
    CHECK(top.wait_for("COMPONENT"));
    top.press("/boat\r");
    CHECK(top.wait_until([&] { return !top.shows("shore/xbee"); }));
    CHECK(top.wait_for("atirma/boat"));
    top.press("\r");
    CHECK(top.wait_for("missing: no component provides it"));
    CHECK_THAT(screen_of(top), Contains("PROVIDES") && Contains("helm") && Contains("NEEDS") && Contains("beeper"));
    top.press("\x1b");
    CHECK(top.wait_for("COMPONENT"));
    top.press("\x1b");
    CHECK(top.wait_for("shore/xbee"));
    top.press("\t");
    CHECK(top.wait_for("[2 services]"));
    CHECK(top.wait_for("position"));
    top.press("q");
    CHECK(top.wait() == 0);
    CHECK_FALSE(top.on_alternate_screen());
    CHECK(top.cursor_is_visible());
    CHECK(top.as_a_shell_wants_it());
}

TEST_CASE("Ctrl-C and signals leave the terminal as it was, and a closed window ends top") {
    port in;
    terminal_program top(top_at(in), 80, 24);
    REQUIRE(top.wait_for("2 components"));
    SECTION("Ctrl-C") {
        top.press("\x03");
        CHECK(top.wait() == 0);
    }
    SECTION("SIGTERM") {
        top.signal(SIGTERM);
        CHECK(top.wait() == 0);
    }
    SECTION("SIGHUP") {
        top.signal(SIGHUP);
        CHECK(top.wait() == 0);
    }
    SECTION("Ctrl-S stops nothing") {
        top.press("\x13");
        top.press("?");
        CHECK(top.wait_for("any key goes back"));
        top.press("\x03");
        CHECK(top.wait() == 0);
    }
    SECTION("closed") {
        top.close_window();
        CHECK(top.wait() == 0);
        return;
    }
    CHECK_FALSE(top.on_alternate_screen());
    CHECK(top.cursor_is_visible());
    CHECK(top.as_a_shell_wants_it());
}

TEST_CASE("top is coloured unless NO_COLOR is set") {
    port in;
    for (bool coloured : {true, false}) {
        terminal_program top(top_at(in), 80, 24, coloured ? with({{"NO_COLOR", ""}}) : with({{"NO_COLOR", "1"}}));
        REQUIRE(top.wait_for("ready"));
        top.press("q");
        CHECK(top.wait() == 0);
        CHECK((top.raw().find("\x1b[32m") != std::string::npos) == coloured);
    }
}

TEST_CASE("top without a terminal that it knows, with --once or --json prints what it prints to a file") {
    port in;
    for (const char* kind : {"dumb", "of-nobody"}) {
        terminal_program top(top_at(in), 80, 24, with({{"TERM", kind}}));
        CHECK(top.wait_for("TOO SLOW"));
        CHECK_FALSE(top.on_alternate_screen());
        top.signal(SIGINT);
        CHECK(top.wait() == 0);
        CHECK_THAT(top.raw(), Contains(kind) && Contains("TERM"));
    }
    terminal_program once(top_at(in, {"--once"}), 80, 24);
    CHECK(once.wait() == 0);
    CHECK_THAT(once.raw(), Contains("STATE") && Contains("PATH") && !Contains("\x1b"));
    CHECK(once.wrapped() == 0);
    terminal_program json(top_at(in, {"--once", "--json"}), 80, 24);
    CHECK(json.wait() == 0);
    CHECK_THAT(json.raw(), ise_test::StartsWith(R"({"asked_at":)"));
}

TEST_CASE("top goes on when the name server has gone, and says so") {
    port in;
    terminal_program top({"ise", "--timeout", "1s", "--name-server", in.at.text(), "top", "--every", "50ms"}, 80, 24);
    REQUIRE(top.wait_for("2 components"));
    in.names.stop();
    in.names.wait();
    CHECK(top.wait_for("old: "));
    CHECK(top.shows("atirma/boat"));
    top.press("q");
    CHECK(top.wait() == 0);
}
