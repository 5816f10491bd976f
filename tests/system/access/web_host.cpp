// What whoever has broken into the web host can do with its certificate.
#include "harbour.hpp"

#include <components/boat/communication.hpp>
#include <components/gui_client/gui_client.hpp>

#include <ise/component/parameter_services.hpp>
#include <ise/instantiation/services.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <limits>
#include <optional>
#include <pwd.h>
#include <thread>
#include <unistd.h>
#include <utility>

using namespace access_test;
using namespace std::chrono_literals;
using ise_test::Contains;

namespace {

constexpr const char* web_identity = "ise://atirma/web";

/// A-Tirma's shore with one communication node, a boat within range, and a GPRS proxy that the operator started.
struct atirma_shore : harbour {
    atirma_shore() {
        run("boat", {"xbee-link", "--path", "atirma/air", "--shore-port", file("air"), "--boat-port", file("sea")});
        run("boat", {"boat-simulator", "--path", "atirma/boat", "--serial", file("sea")});
        run("shore", {"xbee-proxy", "--path", "atirma/shore/xbee", "--serial", file("air")});
        run("shore", {"communication-node", "--path", "atirma/shore/node", "--file", file("node.db"), "--proxy",
                      "xbee=atirma/shore/xbee"});
        auto started =
            ise("ana", {"--wait", "--timeout", "120s", "start", "gprs-proxy", "atirma/shore/gprs", "--host", "shore",
                        "--protocol", "tls", "--ready-within", "60s", "--set", "boat-listen=tcp://127.0.0.1:0"});
        INFO(started.err);
        REQUIRE(started.exit_code == 0);
    }
    /// As the operator sees them.
    json running() {
        auto ran = ise("ana", {"ps", "--json"});
        INFO(ran.err);
        REQUIRE(ran.exit_code == 0);
        return json::parse(ran.out);
    }
    std::string holder_of(const std::string& name) {
        auto ran = ise("ana", {"list", "--json"});
        INFO(ran.err);
        REQUIRE(ran.exit_code == 0);
        for (const auto& one : json::parse(ran.out))
            if (one["path"] == name) return one["endpoints"].dump();
        return {};
    }
};

/// A process with the web host's certificate, and nothing else.
class intruder {
public:
    explicit intruder(const harbour& there, const std::string& who = "web") : node_(env_, there.node_of(who)) {
        self_ = &node_.start("", [](ise::component&) -> ise::task<> { co_return; });
    }
    template <class Contract>
    ise::result<typename Contract::response_type> ask(const std::string& whom, const Contract& service,
                                                      typename Contract::request_type request) {
        return self_->wait(asked(*self_, whom, service, std::move(request)));
    }
    /// The next packet of a subscription.
    template <class Contract>
    auto hear(const std::string& whom, const Contract& service) {
        return self_->wait(heard(*self_, whom, service));
    }

private:
    template <class Contract>
    static ise::task<ise::result<typename Contract::response_type>> asked(ise::component& self, std::string whom,
                                                                          Contract service,
                                                                          typename Contract::request_type request) {
        auto there = co_await self.find(whom, 60s);
        auto answer = co_await there.try_call(service, std::move(request), 60s);
        co_return answer;
    }
    template <class Contract>
    static ise::task<typename Contract::packet_type> heard(ise::component& self, std::string whom, Contract service) {
        auto there = co_await self.find(whom, 60s);
        auto packets = co_await there.subscribe(service);
        auto packet = co_await packets.next();
        if (!packet) throw std::runtime_error("the subscription ended");
        co_return std::move(*packet);
    }

    ise::real_environment env_;
    ise::node node_;
    ise::component* self_ = nullptr;
};

/// What an attempt left in the audit log: exactly one refusal of that.
void check_one_refusal(const harbour& there, std::size_t before, const std::string& component,
                       const std::string& what) {
    auto lines = there.audit_of(web_identity);
    REQUIRE(lines.size() == before + 1);
    const auto& line = lines.back();
    INFO(line.dump());
    CHECK(line.at("component") == component);
    CHECK(line.at("what") == what);
    CHECK(line.at("verdict") == "denied");
    CHECK(line.at("left_out") == 0);
    CHECK_FALSE(line.at("serial").get<std::string>().empty());
    CHECK(line.at("from").get<std::string>().starts_with("tls://127.0.0.1:"));
}

template <class Contract>
void refused(const harbour& there, intruder& by, const std::string& whom, const Contract& service,
             typename Contract::request_type request, const std::string& component, const std::string& what) {
    INFO(what);
    auto before = there.audit_of(web_identity).size();
    auto answer = by.ask(whom, service, std::move(request));
    REQUIRE_FALSE(answer);
    CHECK(answer.error().code() == ise::errc::access_denied);
    CHECK(answer.error().executed() == ise::execution::not_executed);
    CHECK_THAT(answer.error().message(),
               Contains(std::string(web_identity) + " may not") && Contains("no rule of access.toml allows it"));
    check_one_refusal(there, before, component, what);
}

/// What a program complains of first that it may not have.
std::string refusal_of(ise_test::program& of) {
    for (;;) {
        auto line = of.read_error_line();
        if (line.empty() || line.find("may not") != std::string::npos) return line;
    }
}

/// Of a command that must fail.
void command_refused(harbour& there, const std::function<ise_test::ran()>& command, const std::string& component,
                     const std::string& what) {
    INFO(what);
    auto before = there.audit_of(web_identity).size();
    auto ran = command();
    INFO(ran.out << ran.err);
    CHECK(ran.exit_code != 0);
    CHECK_THAT(ran.err, Contains(std::string(web_identity) + " may not"));
    check_one_refusal(there, before, component, what);
}

} // namespace

TEST_CASE("with the certificate of the web host nothing is started, stopped, set, taken or commanded, and each attempt "
          "is a line of the audit log") {
    atirma_shore shore;
    const auto running = shore.running();
    REQUIRE(running.size() == 1);
    const auto gprs = shore.holder_of("atirma/shore/gprs");
    REQUIRE_FALSE(gprs.empty());
    intruder web(shore);
    namespace host = ise::instantiation;

    // What the page does works, and is no line.
    auto packet = web.hear("atirma/communication", atirma::services::telemetry);
    CHECK_FALSE(packet.raw.empty());
    auto track = web.ask("atirma/communication", atirma::services::track, {});
    REQUIRE(track);
    CHECK_FALSE(track->packets.empty());
    CHECK(shore.audit_of(web_identity).empty());

    // Start: another GPRS proxy under the name of the first, with the highest priority there is.
    host::start_request start;
    start.type = "gprs-proxy";
    start.path = "atirma/shore/gprs";
    start.roles["atirma/communication"] = std::numeric_limits<std::int32_t>::max();
    refused(shore, web, "ise/host/shore", host::services::start, start, "ise/host/shore", "start shore:*");
    command_refused(
        shore,
        [&] {
            return shore.ise("web", {"start", "gprs-proxy", "atirma/shore/other", "--host", "shore", "--role",
                                     "atirma/communication=2147483647"});
        },
        "ise/host/shore", "start shore:*");
    host::change_request change;
    change.to = start;
    refused(shore, web, "ise/host/shore", host::services::change, change, "ise/host/shore", "start shore:*");

    // Stop.
    host::stop_request stop;
    stop.path = "atirma/shore/gprs";
    refused(shore, web, "ise/host/shore", host::services::stop, stop, "ise/host/shore", "stop shore:*");
    host::kill_request kill;
    kill.path = "atirma/shore/gprs";
    refused(shore, web, "ise/host/shore", host::services::kill, kill, "ise/host/shore", "stop shore:*");
    host::restart_request restart;
    restart.path = "atirma/shore/gprs";
    refused(shore, web, "ise/host/shore", host::services::restart, restart, "ise/host/shore", "start shore:*");
    command_refused(
        shore,
        [&] {
            return shore.ise("web", {"stop", "atirma/shore/gprs"});
        },
        "ise/host/shore", "read *");

    // Set.
    host::set_request set;
    set.path = "atirma/shore/gprs";
    set.settings.push_back({"silence", "1"});
    refused(shore, web, "ise/host/shore", host::services::set, set, "ise/host/shore", "set *:*");
    ise::change_parameters_request changes;
    changes.settings.push_back({"power-level", "0"});
    refused(shore, web, "atirma/shore/xbee", ise::change_parameters_service, changes, "atirma/shore/xbee",
            "set atirma/shore/xbee:*");

    // Take a name, and a role under a name that the web host may have.
    auto before = shore.audit_of(web_identity).size();
    auto impostor =
        shore.start("web", {"gprs-proxy", "--path", "atirma/shore/gprs", "--boat-listen", "tcp://127.0.0.1:0"});
    CHECK_THAT(refusal_of(*impostor), Contains("the name atirma/shore/gprs: no rule of access.toml allows it"));
    check_one_refusal(shore, before, "ise/name_server", "name atirma/shore/gprs");
    impostor.reset();
    before = shore.audit_of(web_identity).size();
    impostor = shore.start("web", {"gprs-proxy", "--path", "atirma/page", "--role", "atirma/communication=2147483647",
                                   "--boat-listen", "tcp://127.0.0.1:0"});
    CHECK_THAT(refusal_of(*impostor), Contains("the role atirma/communication with priority 2147483647"));
    auto lines = shore.audit_of(web_identity);
    REQUIRE(lines.size() == before + 2);
    CHECK(lines[before].at("what") == "name atirma/page"); // which it may have
    CHECK(lines[before].at("verdict") == "allowed");
    CHECK(lines[before + 1].at("what") == "role atirma/communication=2147483647");
    CHECK(lines[before + 1].at("verdict") == "denied");
    impostor.reset();

    // Give a telecommand, and take the authority: at the node by its role and its name, and past it at a proxy.
    atirma::telecommand_request telecommand;
    telecommand.command = atirma::boat_command(atirma::command_kind::tack_now);
    for (const char* whom : {"atirma/communication", "atirma/shore/node"})
        refused(shore, web, whom, atirma::services::telecommand, telecommand, "atirma/shore/node",
                "call atirma/shore/node:telecommand");
    refused(shore, web, "atirma/shore/xbee", atirma::services::telecommand, telecommand, "atirma/shore/xbee",
            "call atirma/shore/xbee:telecommand");
    atirma::authority_request take;
    take.action = atirma::authority_action::take;
    take.confirmed = true;
    refused(shore, web, "atirma/communication", atirma::services::authority, take, "atirma/shore/node",
            "call atirma/shore/node:authority");
    command_refused(
        shore,
        [&] {
            return shore.ise("web", {"--as", "atirma/operators/ana", "call", "atirma/communication", "authority",
                                     R"({"action":"take"})"});
        },
        "ise/name_server", "name atirma/operators/ana");

    // Everything is as it was, and those who may still can.
    CHECK(shore.running() == running);
    CHECK(shore.holder_of("atirma/shore/gprs") == gprs);
    auto look = shore.ise("ana", {"call", "atirma/communication", "authority", R"({"action":"look"})"});
    INFO(look.err);
    CHECK_THAT(look.out, Contains(R"("holder":"")"));
    CHECK(web.ask("atirma/communication", atirma::services::track, {}));
    CHECK(shore.ise("ana", {"stop", "atirma/shore/gprs"}).exit_code == 0);
}

TEST_CASE("access: describe shows identity and user, and a telecommand's record the verified operator") {
    atirma_shore shore;
    const auto* user = ::getpwuid(::geteuid());
    const std::string name = user ? user->pw_name : std::to_string(::geteuid());
    auto described = shore.ise("ana", {"describe", "atirma/shore/node"});
    INFO(described.out << described.err);
    CHECK_THAT(described.out, Contains("  identity   ise://atirma/shore\n") && Contains(", user " + name + "\n"));
    auto boat = json::parse(shore.ise("ana", {"describe", "--json", "atirma/boat"}).out);
    CHECK(boat["identity"] == "ise://atirma/boat");
    CHECK(boat["user"] == name);

    intruder ana(shore, "ana");
    atirma::telecommand_request ping;
    ping.command = atirma::boat_command(atirma::command_kind::ping);
    REQUIRE(ana.ask("atirma/communication", atirma::services::telecommand, ping));
    auto record = ana.ask("atirma/communication", atirma::services::telecommand_record, {});
    REQUIRE(record);
    REQUIRE(record->entries.size() == 1);
    CHECK(record->entries.front().asked_as == "ise://atirma/operator/ana");
}

TEST_CASE("access: the page of a healthy A-Tirma gets what it shows and is refused nothing") {
    atirma_shore shore;
    shore.run("web", {"web-server", "--path", "atirma/page", "--telemetry", "atirma/communication", "--port", "0"});
    std::string used;
    do { // until it has what it asks for last; the limit of the test ends this
        auto ran = shore.ise("ana", {"graph", "--json"});
        INFO(ran.err);
        REQUIRE(ran.exit_code == 0);
        used.clear();
        auto parsed = json::parse(ran.out);
        for (const auto& one : parsed["connections"])
            if (one["a"] == "atirma/page" || one["b"] == "atirma/page") used += one["services"].dump();
    } while (used.find("communication_state") == used.npos);
    CHECK_THAT(used, Contains("telemetry"));
    for (const auto& line : shore.audit_of(web_identity)) {
        INFO(line.dump());
        CHECK(line.at("verdict") == "allowed");
    }
}

TEST_CASE("access: components that share a process start and stop under the policy") {
    harbour there;
    for (const char* path : {"atirma/shore/gprs", "atirma/shore/more"}) {
        auto ran =
            there.ise("ana", {"--wait", "--timeout", "120s", "start", "gprs-proxy", path, "--host", "shore",
                              "--protocol", "tls", "--process", "proxies", "--set", "boat-listen=tcp://127.0.0.1:0"});
        INFO(ran.err);
        REQUIRE(ran.exit_code == 0);
    }
    auto running = json::parse(there.ise("ana", {"ps", "--json"}).out);
    REQUIRE(running.size() == 2);
    CHECK(running[0]["process_id"] == running[1]["process_id"]);
    for (const auto& one : running) CHECK(one["state"] == "ready");
    for (const char* path : {"atirma/shore/gprs", "atirma/shore/more"}) {
        auto ran = there.ise("ana", {"stop", path});
        INFO(ran.err);
        CHECK(ran.exit_code == 0);
    }
    for (const auto& line : there.audit_of(fmt::format("unix:{}", ::getuid()))) {
        INFO(line.dump());
        CHECK(line.at("verdict") == "allowed");
    }
}

TEST_CASE("access: an operator's console follows the boat, commands it, and is refused nothing") {
    atirma_shore shore;
    ise::real_environment world;
    ise::node node(world, shore.node_of("ana"));
    atirma::console::gui_client_options options;
    options.name_servers = {ise::endpoint::parse(shore.name_server()).value()};
    node.start<atirma::console::gui_client>("atirma/console/ana", ise::component_options(), options);
    // The limit of the test ends these.
    auto wait_for = [&](auto holds) {
        while (!holds(*options.port->latest())) std::this_thread::sleep_for(20ms);
    };
    wait_for([](const auto& seen) {
        return seen.boat.position && seen.authority.known && std::ranges::any_of(seen.links, [](const auto& link) {
                   return link.path == "atirma/shore/xbee" && link.connected && link.xbee;
               });
    });
    atirma::console::give_command ping;
    ping.command = atirma::boat_command(atirma::command_kind::ping);
    ping.authority = atirma::console::taking::if_free;
    REQUIRE(options.port->act(ping));
    wait_for([](const auto& seen) {
        return std::ranges::any_of(*seen.commands, [](const auto& one) { return one.own && one.executed_at; });
    });
    node.stop();
    node.wait();
    for (const auto& line : shore.audit_of("ise://atirma/operator/ana")) {
        INFO(line.dump());
        CHECK(line.at("verdict") == "allowed");
    }
}

TEST_CASE("access: doctor and list say whose policy cannot be used, why, and which counts") {
    harbour there;
    there.run("boat", {"xbee-link", "--path", "atirma/air", "--shore-port", there.file("air"), "--boat-port",
                       there.file("sea")});
    auto healthy = there.ise("ana", {"access", "list", "--json"});
    INFO(healthy.err);
    REQUIRE(healthy.exit_code == 0);
    auto policies = json::parse(healthy.out);
    for (const auto& one : policies) CHECK(one["problem"] == "");
    auto found = std::ranges::find(policies, "ise/name_server", [](const json& one) { return one["component"]; });
    REQUIRE(found != policies.end()); // it has no name in itself, and is asked all the same
    std::string hash = (*found)["hash"];
    CHECK(hash.size() == 16);

    there.write_policy("garbage [[");
    // Each process reads the file again at a time of its own, within 5 s; the limit of the test ends this.
    json finding;
    while (finding.is_null()) {
        auto ran = there.ise("ana", {"doctor", "--interval", "10ms", "--json"});
        INFO(ran.err);
        auto output = json::parse(ran.out);
        for (const auto& one : output["findings"])
            if (one["kind"] == "policy_unusable" && one["component"] == "ise/name_server") finding = one;
    }
    CHECK_THAT(finding["message"].get<std::string>(),
               Contains("the access policy cannot be used") && Contains(hash) && Contains("access.toml:1:"));
    CHECK_THAT(finding["advice"].get<std::string>(), Contains("ise access check FILE"));
}
