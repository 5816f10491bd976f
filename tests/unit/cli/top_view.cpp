// The pages of `ise top`, without a terminal.
#include <apps/ise/short_names.hpp>
#include <apps/ise/text.hpp>
#include <apps/ise/top_view.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <vector>

namespace top_view_test {

using namespace ise::cli;
using namespace std::chrono_literals;
using ise_test::Contains;
using kind = key_press::kind;

namespace {

surveyed component(const std::string& path, std::uint64_t calls, ise::time_point at) {
    surveyed made;
    made.name.path = path;
    made.name.state = "ready";
    made.name.host_name = "gando";
    made.name.process_id = 4711;
    made.about.emplace();
    made.about->path = path;
    made.about->state = "ready";
    made.about->incarnation = std::hash<std::string>()(path) | 1;
    made.about->calls_served = calls;
    made.health.emplace();
    made.health->calls_served = calls;
    made.answered_at = at;
    made.answered_after = 173us;
    return made;
}

ise::service_info service(const std::string& name, bool provided) {
    ise::service_info made;
    made.name = name;
    made.provided = provided;
    return made;
}

std::string text_of(const styled_page& page) {
    std::string all;
    for (const auto& line : page) all += line.text() + "\n";
    return all;
}

void press(top_view& in, const std::string& keys) {
    for (char letter : keys) in.press({kind::text, std::string(1, letter)});
}

// 40 components, long and alike; the first is busy, and needs what nobody provides.
struct fleet {
    top_view view{"tcp://127.0.0.1:7400"};
    std::vector<std::string> paths;

    fleet() {
        for (int second = 0; second < 3; ++second) view.take(at(second), ise::wall_time(1'777'636'803s + second * 1s));
    }
    std::vector<surveyed> at(int second) {
        std::vector<surveyed> all;
        paths.clear();
        for (int number = 0; number < 40; ++number) {
            paths.push_back("atirma/shore/communication/of/many/node-" + std::to_string(number));
            all.push_back(component(paths.back(), static_cast<std::uint64_t>(second * (40 - number)),
                                    ise::time_point(std::chrono::seconds(second + 1))));
        }
        auto& busy = all.front();
        busy.about->services = {service("helm", true), service("beeper", false)};
        busy.about->ended_subscriptions.push_back({"position", "atirma/boat", "5 packets are lost"});
        busy.about->sessions.push_back({});
        busy.about->sessions.back().peer = all[1].name.path + " (tcp://10.0.0.2:7411)";
        busy.about->sessions.back().bytes_in = static_cast<std::uint64_t>(second) * 5000;
        busy.about->sessions.back().round_trip_ns = 857'000'000;
        busy.health->services.resize(1);
        busy.health->services[0].name = "helm";
        busy.health->services[0].calls = static_cast<std::uint64_t>(second) * 12;
        busy.health->services[0].waiting = 3;
        return all;
    }
};

} // namespace

TEST_CASE("every page of top fits on its terminal, of any size, and says so much on 80 by 24 that it is worth it") {
    fleet all;
    auto width = GENERATE(as<std::size_t>{}, 1, 7, 40, 80, 120, 300);
    auto height = GENERATE(as<std::size_t>{}, 1, 2, 5, 24, 60);
    CAPTURE(width, height);
    for (const char* keys : {"", "2", "3", "/node-1", "?"}) {
        fleet one;
        press(one.view, keys);
        auto page = one.view.page(width, height);
        CHECK(page.size() <= height);
        for (const auto& line : page) CHECK(columns(line.text()) <= width);
    }
    all.view.press({kind::enter, {}});
    auto page = all.view.page(width, height);
    CHECK(page.size() <= height);
    for (const auto& line : page) CHECK(columns(line.text()) <= width);
    if (width < 80 || height < 24) return;
    CHECK_THAT(text_of(page), Contains("node-0") && Contains("PROVIDES") && Contains("helm"));
}

TEST_CASE("names on 80 columns are all different, whatever they have in common") {
    fleet all;
    std::set<std::string> seen;
    for (int page = 0; page < 4; ++page) {
        auto lines = all.view.page(80, 24);
        for (std::size_t at = 4; at + 1 < lines.size(); ++at)
            if (auto text = lines[at].text(); !text.empty()) seen.insert(text.substr(0, text.find(' ')));
        all.view.press({kind::page_down, {}});
    }
    CHECK(seen.size() == 40);
    std::vector<std::string> alike{"alpha/beta/gamma", "arrow/bow/gamma", "a/b/gamma", "aaa/bbb/gamma"};
    for (std::size_t width = 4; width < 20; ++width) {
        auto made = short_names(alike, width);
        CAPTURE(width, made);
        CHECK(std::set<std::string>(made.begin(), made.end()).size() == alike.size());
        for (const auto& one : made) CHECK(columns(one) <= width);
    }
    CHECK(short_names({"atirma/shore/node-1"}, 14) == std::vector<std::string>{"a/shore/node-1"});
    CHECK(short_names({"atirma/shore/node-1"}, 10) == std::vector<std::string>{"a/s/node-1"});
    CHECK(short_names({"atirma/boat"}, 14) == std::vector<std::string>{"atirma/boat"});
    CHECK(short_names({"same", "same"}, 14) == std::vector<std::string>{"same", "same"});
}

TEST_CASE("the round trip of a component is that of the last question, not of an old heartbeat") {
    fleet all;
    CHECK_THAT(text_of(all.view.page(80, 24)), Contains("173 us") && !Contains("857 ms"));
    press(all.view, "3");
    CHECK_THAT(text_of(all.view.page(80, 24)), Contains("857 ms"));
}

TEST_CASE("top sorts by any column, and the selection stays with its component") {
    fleet all;
    auto first = [&] { return all.view.page(80, 24).at(4).text(); };
    CHECK_THAT(first(), Contains("node-0 "));
    all.view.press({kind::right, {}}); // state
    press(all.view, "s");              // calls per second
    CHECK_THAT(first(), Contains("node-0 ") && Contains(" 38.0 "));
    CHECK_THAT(all.view.page(80, 24).at(3).text(), Contains("CALLS/S▼"));
    press(all.view, "r");
    CHECK_THAT(first(), Contains("node-38 "));
    auto page = all.view.page(80, 24);
    CHECK(page.at(4).selected);
    all.view.press({kind::end, {}});
    press(all.view, "r");
    page = all.view.page(80, 24);
    CHECK(page.at(4).selected);
    CHECK_THAT(page.at(4).text(), Contains("node-0 "));
}

TEST_CASE("a filter leaves the rows that contain it, and Esc shows all again") {
    fleet all;
    press(all.view, "/NODE-17");
    CHECK_THAT(text_of(all.view.page(80, 24)), Contains("/NODE-17_") && Contains("node-17 ") && !Contains("node-18"));
    all.view.press({kind::backspace, {}});
    all.view.press({kind::enter, {}});
    CHECK_THAT(text_of(all.view.page(80, 24)), Contains("/NODE-1 ") && Contains("node-18 ") && !Contains("node-2"));
    press(all.view, "q"); // is no letter of the filter any more
    CHECK(all.view.ended());
    press(all.view, "/nothing like that");
    CHECK_THAT(text_of(all.view.page(80, 24)), Contains("no row contains"));
    all.view.press({kind::escape, {}});
    all.view.press({kind::escape, {}});
    CHECK_THAT(text_of(all.view.page(80, 24)), Contains("node-2 "));
}

TEST_CASE("the details of a component have its services, needs, peers, queues and last errors") {
    fleet all;
    all.view.press({kind::enter, {}});
    auto page = text_of(all.view.page(100, 60));
    CHECK_THAT(page, Contains("atirma/shore/communication/of/many/node-0  ready  gando  process 4711") &&
                         Contains("subscription to 'position' of atirma/boat ended: 5 packets are lost") &&
                         Contains("helm") && Contains(" 12.0 ") && Contains("missing: no component provides it") &&
                         Contains("node-1") && Contains("857 ms") && Contains("5.0kB"));
    all.view.press({kind::down, {}});
    press(all.view, "q");
    CHECK_FALSE(all.view.ended());
    CHECK_THAT(text_of(all.view.page(80, 24)), Contains("COMPONENT"));
}

TEST_CASE("what has gone, is silent or cannot be asked is shown as that") {
    fleet all;
    all.view.press({kind::enter, {}});
    auto silent = component("atirma/boat", 0, ise::time_point(9s));
    silent.about.reset();
    silent.health.reset();
    silent.trouble = "no answer in time";
    all.view.take({silent}, {});
    CHECK_THAT(text_of(all.view.page(120, 24)), Contains("node-0 is not registered any more"));
    all.view.press({kind::escape, {}});
    auto page = all.view.page(80, 24);
    CHECK_THAT(page.at(0).text(), Contains("1 component, 1 silent"));
    CHECK_THAT(page.at(4).text(), Contains("atirma/boat") && Contains("silent"));
    auto bad = std::ranges::find(page.at(4).parts, style::bad, &styled_text::how);
    REQUIRE(bad != page.at(4).parts.end());
    CHECK_THAT(bad->text, Contains("silent"));
    all.view.fail("there is no name server\x1b[2J");
    CHECK_THAT(text_of(all.view.page(120, 24)), Contains("old: there is no name server") && !Contains("\x1b"));
    all.view.press({kind::enter, {}});
    CHECK_THAT(text_of(all.view.page(120, 24)), Contains("does not answer: no answer in time"));
}

TEST_CASE("a sparkline has its own maximum, and a gap where nothing was measured") {
    CHECK(sparkline({0, 1, 2, 4}, 4) == "▁▃▅█");
    CHECK(sparkline({5}, 3) == "  █");
    CHECK(sparkline({1, 2, 3, 4}, 2) == "▇█");
    CHECK(sparkline({0, std::numeric_limits<double>::quiet_NaN(), 0}, 3) == "▁ ▁");
    CHECK(sparkline({}, 2) == "  ");
}

} // namespace top_view_test
