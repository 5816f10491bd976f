// What the command line makes of a survey: findings, connections and rates.
#include <apps/ise/activity.hpp>
#include <apps/ise/connections.hpp>
#include <apps/ise/findings.hpp>
#include <apps/ise/graph_drawing.hpp>
#include <apps/ise/needs.hpp>
#include <apps/ise/spread.hpp>
#include <apps/ise/styled.hpp>
#include <apps/ise/table.hpp>
#include <apps/ise/text.hpp>

#include <ise/service/use_book.hpp>

#include <support/catch.hpp>

#include <algorithm>

namespace looking_test {

using namespace ise::cli;
using namespace std::chrono_literals;
using ise_test::Contains;

namespace {

surveyed well(const std::string& path, const std::string& host = "shore") {
    surveyed made;
    made.name.path = path;
    made.name.state = "ready";
    made.name.host_name = host;
    made.about.emplace();
    made.about->path = path;
    made.about->state = "ready";
    made.about->incarnation = std::hash<std::string>()(path) | 1;
    made.health.emplace();
    made.health->incarnation = made.about->incarnation;
    made.answered_at = ise::time_point(10s);
    return made;
}

ise::session_info with(const std::string& peer, std::uint64_t in = 0, std::uint64_t out = 0) {
    ise::session_info made;
    made.peer = peer;
    made.bytes_in = in;
    made.bytes_out = out;
    return made;
}

template <class Contract>
ise::service_info service(const Contract& of, bool provided) {
    ise::service_info made;
    made.name = of.name();
    made.kind = static_cast<std::uint8_t>(Contract::types().kind);
    made.provided = provided;
    for (const auto& one : Contract::types().schemas) made.packets.push_back({one.fingerprint(), one.text()});
    return made;
}

std::vector<std::string> kinds(const std::vector<finding>& of) {
    std::vector<std::string> all;
    for (const auto& one : of) all.push_back(one.kind);
    return all;
}

std::vector<std::string> found(const std::vector<surveyed>& now, const std::vector<surveyed>& before = {}) {
    return kinds(examine(before, now, 1s, "shore"));
}

struct order {
    double heading_deg = 0;
};
struct longer_order {
    double heading_deg = 0;
    bool now = false;
};
struct other_order {
    std::string text;
};
struct done {};
inline constexpr ise::request_response<order, done> steer{"steer"};
inline constexpr ise::request_response<order, done> unused{"unused"};
inline constexpr ise::request_response<longer_order, done> steer_longer{"steer"};
inline constexpr ise::request_response<other_order, done> steer_otherwise{"steer"};

using list = std::vector<std::string>;

} // namespace

TEST_CASE("a system in good order has no findings, whatever waits a little") {
    auto one = well("a");
    one.lease = 2s;
    one.name.lease_age = 700ms;
    one.clock_ahead = 90ms;
    one.health->sessions.push_back({"b (tcp://10.0.0.1:1)", 4000});
    CHECK(found({one, well("b")}).empty());
}

TEST_CASE("a lease that is not renewed is found before it ends") {
    auto one = well("a");
    one.lease = 2s;
    one.name.lease_age = 1500ms;
    CHECK(found({one}) == list{"stale_lease"});
}

TEST_CASE("who has gone between the two looks is told, and whether it answered before") {
    auto one = well("a");
    CHECK(found({}, {one}) == list{"left"});
    CHECK(examine({one}, {}, 1s, "shore").front().severity == severity_level::note);
    one.about.reset();
    one.trouble = "no answer in time";
    CHECK(found({}, {one}) == list{"lost"});
    CHECK(examine({one}, {}, 1s, "shore").front().severity == severity_level::error);
}

TEST_CASE("who is silent is told apart: away, busy, stalled") {
    auto gone = well("a", "boat");
    gone.about.reset();
    gone.health.reset();
    gone.why = ise::errc::unreachable;
    gone.trouble = "'a' is registered, but not reached: refused";
    CHECK(found({gone}) == list{"unreachable"});
    gone.name.endpoints = {"tcp://127.0.0.1:7411", "local://@ise-1"};
    CHECK_THAT(examine({}, {gone}, 1s, "shore").front().advice, Contains("addresses of boat only"));
    gone.why = ise::errc::timed_out;
    CHECK(found({gone}) == list{"no_answer"});
    gone.name.state = "stalled";
    CHECK(found({gone}) == list{"stalled"});
    auto peer = well("b");
    peer.about->sessions.push_back(with("c (tcp://10.0.0.2:7411)"));
    peer.about->sessions.back().peer_stalled = true;
    auto seen = examine({}, {peer}, 1s, "shore");
    REQUIRE(seen.size() == 1);
    CHECK(seen.front().component == "c");
    CHECK_THAT(seen.front().message, Contains("as b reports"));
}

TEST_CASE("a clock that is off is told once a host, unless nobody can know") {
    auto one = well("a", "boat"), two = well("b", "boat");
    one.clock_ahead = two.clock_ahead = -3s;
    auto seen = examine({}, {one, two}, 1s, "shore");
    CHECK(kinds(seen) == list{"clock_skew"});
    CHECK_THAT(seen.front().message, Contains("boat is 3 s behind this machine's"));
    one.clock_doubt = two.clock_doubt = 5s; // the answer took ten seconds
    CHECK(found({one, two}).empty());
}

TEST_CASE("a subscription that ended and was not made again is a warning") {
    auto one = well("a");
    one.about->ended_subscriptions.push_back({"position", "boat", "5 packets are lost"});
    auto seen = examine({}, {one}, 1s, "shore");
    CHECK(kinds(seen) == list{"subscription_ended"});
    CHECK(seen.front().severity == severity_level::warning);
    CHECK_THAT(seen.front().message, Contains("'position' of boat") && Contains("5 packets are lost"));
}

TEST_CASE("what a component warns of is a warning of the doctor, with the advice") {
    auto one = well("boat");
    one.health->cautions.push_back({"telecommands to it are not sealed", "make a key"});
    auto seen = examine({}, {one}, 1s, "shore");
    auto found = std::ranges::find_if(seen, [](const finding& each) { return each.kind == "caution"; });
    REQUIRE(found != seen.end());
    CHECK(found->severity == severity_level::warning);
    CHECK(found->component == "boat");
    CHECK(found->message == "telecommands to it are not sealed");
    CHECK(found->advice == "make a key");
}

TEST_CASE("who waits for longer than what is logged is a warning, which says for what and since when") {
    auto one = well("a");
    ise::wait_info wait;
    wait.target = "b";
    wait.service = "steer";
    wait.since = ise::wall_time(1'777'636'803s); // 2026-05-01T12:00:03Z
    wait.waited = ise::use_book::patience - 1ns;
    auto result = [&](const std::string& stage) {
        wait.stage = stage;
        one.about->waits = {wait};
        auto seen = examine({}, {one}, 1s, "shore");
        REQUIRE(kinds(seen) == list{"waits"});
        CHECK(seen.front().severity == severity_level::warning);
        return seen.front().message;
    };
    one.about->waits = {wait};
    CHECK(found({one}).empty());
    wait.waited = ise::use_book::patience; // as README, the log and `ise list` have it
    one.about->waits = {wait};
    CHECK(kinds(examine({}, {one}, 1s, "shore")) == list{"waits"});
    wait.waited = 12s;
    wait.cause = "no component is registered as 'b'";
    CHECK(result("name") == "it waits for 'steer' of b, which is not found, since 2026-05-01T12:00:03Z (12 s): no "
                            "component is registered as 'b'");
    CHECK_THAT(result("provider"), Contains("with which there is no session"));
    CHECK_THAT(result("unreached"), Contains("its last call of 'steer' of b reached no provider"));
    wait.service.clear();
    wait.cause.clear();
    CHECK(result("name") == "it waits for b since 2026-05-01T12:00:03Z (12 s)");
}

TEST_CASE("what grows between two looks is a warning, what has happened before a note") {
    auto before = well("a"), now = well("a");
    now.about->packets_dropped = now.health->packets_dropped = 7;
    now.health->calls_refused = 3;
    CHECK(found({now}, {before}) == list{"drops_packets", "refuses_calls"});
    now.health->calls_overloaded = 2;
    CHECK(found({now}, {before}) == list{"drops_packets", "overloaded"});
    CHECK_THAT(examine({before}, {now}, 1s, "shore").back().message, Contains("2 beyond its limits, 1 unknown"));
    auto notes = examine({now}, {now}, 1s, "shore");
    CHECK(kinds(notes) == list{"dropped_packets", "refused_calls"});
    CHECK(std::ranges::all_of(notes, [](const auto& one) { return one.severity == severity_level::note; }));
    now.health->sessions.push_back({"b (tcp://10.0.0.1:1)", 5'000'000});
    CHECK(found({now}, {now}) == list{"slow_peer", "dropped_packets", "refused_calls"});
}

TEST_CASE("percentiles are those of what came between two looks, also where a component forgot") {
    using counts = std::vector<ise::duration_count>;
    CHECK_FALSE(percentile({}, {}, 0.5));
    counts before{{1000, 50}, {4000, 50}};
    counts now{{1000, 50}, {2000, 98}, {4000, 51}, {9000, 1}};
    CHECK(percentile(before, now, 0.5) == ise::duration(2000));
    CHECK(percentile(before, now, 0.99) == ise::duration(4000));
    CHECK(percentile(before, now, 1) == ise::duration(9000));
    CHECK_FALSE(percentile(now, now, 0.5));
    CHECK_FALSE(percentile(now, before, 0.5));
    ise::health_report then, later;
    then.services.resize(1);
    then.services[0].name = "steer";
    later = then;
    later.services[0].calls = 20;
    later.services[0].waiting = 3;
    later.services[0].overloaded = 2;
    later.services[0].handled = {{2000, 20}};
    auto seen = service_activities(then, later, 2);
    REQUIRE(seen.size() == 1);
    CHECK(seen[0].hz == 10.0);
    CHECK(seen[0].handled_p99 == ise::duration(2000));
    CHECK(seen[0].loses());
    CHECK(seen[0].losses.front().first == "overloaded");
    CHECK(service_activities(then, later, 0).empty());
}

TEST_CASE("services are compared where they meet") {
    auto asks = well("asks"), gives = well("gives"), strange = well("strange");
    asks.about->services.push_back(service(steer, false));
    CHECK(found({asks}) == list{"no_provider"});
    asks.about->services.back().declared = false; // perhaps it was used once: what is missed now waits
    CHECK(found({asks}).empty());
    asks.about->services.back().declared = true;
    gives.about->services.push_back(service(steer_longer, true));
    CHECK(found({asks, gives}).empty()); // appended
    strange.about->services.push_back(service(steer_otherwise, true));
    CHECK(found({asks, strange}) == list{"schema_mismatch"});
    CHECK(found({asks, gives, strange}).empty()); // another use of the same word
    asks.about->sessions.push_back(with("strange (tcp://10.0.0.3:1)"));
    auto met = examine({}, {asks, gives, strange}, 1s, "shore");
    REQUIRE(kinds(met) == list{"schema_mismatch"});
    CHECK(met.front().severity == severity_level::error);
    CHECK_THAT(met.front().message, Contains("heading_deg"));
    // Somebody who does not answer may provide it.
    auto silent = well("silent");
    silent.about.reset();
    silent.health.reset();
    silent.why = ise::errc::unreachable;
    asks.about->sessions.clear();
    CHECK(found({asks, silent}) == list{"unreachable"});
}

TEST_CASE("a session is one connection, seen from both ends, and who only looks is none") {
    auto a = well("a"), b = well("b");
    a.about->services = {service(steer, false), service(unused, false)};
    b.about->services = {service(steer, true), service(unused, true)};
    a.about->sessions = {with("b (tcp://10.0.0.2:7411)", 100, 20), with("ise/cli/77 (tcp://127.0.0.1:5)", 1, 1)};
    b.about->sessions = {with("a (tcp://10.0.0.1:5555)", 19, 99), with("tcp://10.0.0.9:4321", 5, 6)};
    a.about->sessions.front().uses = {"ise.describe", "steer"};
    auto lines = connections_of({a, b});
    REQUIRE(lines.size() == 2);
    CHECK(lines[0].a == "a");
    CHECK(lines[0].b == "b");
    CHECK(lines[0].over == "tcp");
    CHECK(lines[0].sessions == 1);
    CHECK(lines[0].bytes_to_a == 100);
    CHECK(lines[0].bytes_to_b == 20);
    REQUIRE(lines[0].services.size() == 1);
    CHECK_FALSE(lines[0].services.front().a_provides);
    CHECK(lines[1].a == "b");
    CHECK(lines[1].b.empty());
    CHECK(lines[1].address == "tcp://10.0.0.9:4321");
    auto drawn = graph_of({}, {a, b}, "");
    auto dot = graph_as_dot(drawn);
    CHECK_THAT(dot, Contains(R"x("a" -> "b" [label="steer\n(tcp)")x") && Contains("dotted"));
    auto text = printed(graph_as_page(drawn), 0, false);
    CHECK_THAT(text, Contains("b  tcp") && Contains("uses     steer  calls") && Contains("a  tcp") &&
                         Contains("provides steer  calls") && Contains("(anonymous, tcp://10.0.0.9:4321)"));
    SECTION("each end tells what it uses itself, of all their sessions together, and by a name that is declared "
            "otherwise") {
        b.about->sessions.front().uses = {"account"};
        a.about->sessions.push_back(with("b (udp://10.0.0.2:7411)"));
        a.about->sessions.back().uses = {"alarms", "steer"};
        auto seen = connections_of({a, b});
        REQUIRE(seen.size() == 2);
        std::vector<std::pair<std::string, bool>> used;
        for (const auto& one : seen[0].services) used.emplace_back(one.service, one.a_provides);
        CHECK(used ==
              std::vector<std::pair<std::string, bool>>{{"alarms", false}, {"steer", false}, {"account", true}});
    }
    SECTION("seen by the second alone, its bytes are turned round") {
        auto seen = connections_of({b});
        REQUIRE(seen.size() == 2);
        CHECK(seen[0].a == "a");
        CHECK(seen[0].bytes_to_a == 99);
        CHECK(seen[0].bytes_to_b == 19);
    }
}

TEST_CASE("a service has all its users, those that declared it and those that were seen to use it") {
    auto node = well("node"), boat = well("boat"), page = well("page");
    boat.about->services = {service(steer, true)};
    node.about->services = {service(steer, false), service(unused, false)};
    page.about->sessions = {with("boat (tcp://10.0.0.2:7411)")};
    page.about->sessions.front().uses = {"steer"};
    auto lines = services_of({boat, node, page}, false);
    REQUIRE(lines.size() == 2);
    CHECK(lines[0].name == "steer");
    CHECK(lines[0].providers == list{"boat"});
    CHECK(lines[0].users == list{"node", "page"});
    CHECK_FALSE(lines[0].missing);
    CHECK(lines[1].missing);
    CHECK(lines[1].concerns("node"));
    CHECK_FALSE(lines[1].concerns("boat"));
    auto silent = well("silent"); // may provide it
    silent.about.reset();
    CHECK_FALSE(services_of({boat, node, page, silent}, false)[1].missing);
}

TEST_CASE("a graph has hosts, kinds, rates and what is missing, and of a prefix its peers, too") {
    auto node = well("node", "shore"), boat = well("boat", "sea"), other = well("other", "shore");
    boat.about->services = {service(steer, true)};
    boat.health->services.resize(1);
    boat.health->services[0].name = "steer";
    node.about->services = {service(steer, false), service(unused, false)};
    node.about->sessions = {with("boat (tcp://10.0.0.2:7411)", 1000, 500)};
    node.about->sessions.front().uses = {"steer"};
    auto later_boat = boat, later_node = node;
    later_boat.answered_at = later_node.answered_at = node.answered_at + 2s;
    later_boat.health->services[0].calls = 8;
    later_node.about->sessions.front().bytes_in = 5000;
    auto drawn = graph_of({node, boat, other}, {later_node, later_boat, other}, "boat");
    CHECK(drawn.components.size() == 2);
    auto text = printed(graph_as_page(drawn), 0, false);
    CHECK_THAT(text, Contains("sea  1 component\n  boat  ready\n") && Contains("provides steer  calls  4.0/s") &&
                         Contains("2.0 kB/s") && Contains("needs unused: missing, no component provides it") &&
                         !Contains("other") && !Contains("\x1b"));
    CHECK_THAT(printed(graph_as_page(drawn), 0, true), Contains("\x1b[32mready\x1b[0m"));
    auto page = printed(graph_as_page(drawn), 40, false);
    for (std::size_t from = 0; from < page.size(); from = page.find('\n', from) + 1)
        CHECK(columns(page.substr(from, page.find('\n', from) - from)) <= 40);
    CHECK_THAT(graph_as_dot(drawn), Contains("subgraph cluster_0") && Contains(R"x(label="sea")x") &&
                                        Contains(R"x("node" -> "boat" [label="steer 4.0/s\n(tcp)")x") &&
                                        Contains(R"x("node" -> "missing unused")x"));
}

TEST_CASE("rates are of one life, without our own questions") {
    auto before = well("a"), now = well("a");
    now.answered_at = before.answered_at + 2s;
    before.about->calls_served = 10;
    now.about->calls_served = 18; // six by others
    now.about->packets_published = 100;
    before.about->sessions = {with("b (tcp://10.0.0.2:1)", 1000, 0)};
    now.about->sessions = {with("b (tcp://10.0.0.2:1)", 3000, 0), with("ise/cli/1 (tcp://127.0.0.1:1)", 9999, 9999)};
    auto seen = activities({before}, {now}).front();
    CHECK(seen.calls_hz == 3.0);
    CHECK(seen.packets_hz == 50.0);
    CHECK(seen.in_bytes_per_s == 1000.0);
    CHECK(seen.sessions == 1);
    now.about->incarnation += 2;
    CHECK_FALSE(activities({before}, {now}).front().calls_hz);
    now.about.reset();
    CHECK_FALSE(activities({before}, {now}).front().answered);
}

TEST_CASE("the median is between the two in the middle") {
    spread of;
    for (auto length : {5ms, 1ms, 4ms, 2ms}) of.add(length);
    CHECK(of.shortest() == 1ms);
    CHECK(of.median() == 3ms);
    CHECK(of.longest() == 5ms);
    of.add(100ms);
    CHECK(of.median() == 4ms);
}

TEST_CASE("a length of time has three digits, and its unit is the next one from where these would not do") {
    CHECK(show_duration(1250us) == "1.25 ms");
    CHECK(show_duration(999'400ns) == "999 us");
    CHECK(show_duration(999'600ns) == "1 ms");
    CHECK(show_duration(999'400us) == "999 ms");
    CHECK(show_duration(999'600us) == "1 s");
    CHECK(show_duration(-999'900us) == "-1 s");
    CHECK(show_duration(1s) == "1 s");
    CHECK(show_duration(3400ms) == "3.4 s");
    CHECK(show_duration(99'400ms) == "99.4 s");
    CHECK(show_duration(7500s) == "2 h 05 min");
}

TEST_CASE("of the endpoints of a component those come first that most can reach") {
    CHECK(reachable_first(
              {"inproc://a", "shm://@b", "local://@b", "tcp://127.0.0.1:1", "tcp://192.168.1.7:2", "tls://[::1]:3"}) ==
          list{"tcp://192.168.1.7:2", "tcp://127.0.0.1:1", "tls://[::1]:3", "local://@b", "shm://@b", "inproc://a"});
    CHECK(reachable_first({"local://@b", "what a newer component says"}) ==
          list{"what a newer component says", "local://@b"});
}

TEST_CASE("a table that is too wide loses the columns that matter least, then the end of the last one") {
    table rows({"PATH", "STATE", "HOST", "ENDPOINT"});
    rows.add({"atirma/boat", "ready", "gando", "tcp://127.0.0.1:7411"});
    auto line = [&](std::size_t width) {
        auto text = rows.text(width, {}, {"HOST", "STATE"});
        return text.substr(text.find('\n') + 1);
    };
    CHECK(line(0) == "atirma/boat  ready  gando  tcp://127.0.0.1:7411\n");
    CHECK(line(47) == "atirma/boat  ready  gando  tcp://127.0.0.1:7411\n");
    CHECK(line(46) == "atirma/boat  ready  tcp://127.0.0.1:7411\n");
    CHECK(line(39) == "atirma/boat  tcp://127.0.0.1:7411\n");
    CHECK(line(30) == "atirma/boat  tcp://127.0.0.1:…\n");
}

TEST_CASE("no line of a table is wider than the terminal, whatever its cells hold") {
    table rows({"PARAMETER", "VALUE", "ALLOWED", "WHAT"});
    rows.add({"telemetry", std::string(120, 'v'), "a URL to connect to: https://host/path or tcp://host:7411",
              std::string(90, 'w')});
    rows.add({std::string(200, 'p'), "5", "", ""});
    for (std::size_t width : {80u, 60u, 40u}) {
        auto text = rows.text(width, "  ", {"ALLOWED"}, 24);
        INFO(text);
        CHECK(text.find("ALLOWED") == text.npos);
        while (!text.empty()) {
            auto end = text.find('\n');
            CHECK(columns(text.substr(0, end)) <= width);
            text.erase(0, end + 1);
        }
    }
}

TEST_CASE("what a terminal obeys or turns round is not printed") {
    CHECK(printable("boat\x1b[2J", false) == "boat\uFFFD[2J");
    CHECK(printable("txt.\xe2\x80\xae"
                    "exe",
                    false)
              .find("\xe2\x80\xae") == std::string::npos);
    CHECK(printable("un año\nmás", true) == "un año\nmás");
}

} // namespace looking_test
