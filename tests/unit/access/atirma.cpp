// apps/atirma/access.toml: every service of A-Tirma and of ISE × whoever may ask for it. The cells are written down
// here on their own, not derived from the file.
#include <ise/access/policy.hpp>
#include <support/catch.hpp>
#include <test_folders.hpp>

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <regex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace atirma_access_test {

using namespace ise::access;

namespace {

std::string text_of_file(const std::filesystem::path& path) {
    std::ifstream in(path);
    return {std::istreambuf_iterator<char>(in), {}};
}

std::shared_ptr<const policy> atirma() {
    std::vector<remark> problems;
    auto made = policy::parse(text_of_file(std::filesystem::path(ISE_SOURCE_DIR) / "apps/atirma/access.toml"),
                              "access.toml", problems);
    for (const auto& one : problems) UNSCOPED_INFO(one.line << ": " << one.text);
    REQUIRE(made);
    return made;
}

struct column {
    char letter;
    const char* who; // as verified
};
constexpr column columns[] = {{'n', ""},
                              {'w', "ise://atirma/web"},
                              {'o', "ise://atirma/operator/ana"},
                              {'e', "ise://atirma/engineer/eva"},
                              {'s', "ise://atirma/shore"},
                              {'k', "ise://atirma/key"},
                              {'b', "ise://atirma/boat"}};

struct row {
    std::vector<std::string> titles; // path and roles of the provider
    bool subscription;
    const char* service;
    std::string_view may; // letters of columns
};

const std::vector<std::string> node = {"atirma/shore/node", "atirma/communication"}, xbee = {"atirma/shore/xbee"},
                               gprs = {"atirma/shore/gprs"}, iridium = {"atirma/shore/iridium"}, boat = {"atirma/boat"},
                               air = {"atirma/air"}, carrier = {"atirma/carrier"}, modem = {"atirma/modem"},
                               gateway = {"atirma/gateway"}, bridge = {"atirma/bridge"}, page = {"atirma/page"},
                               names = {"ise/name_server"}, host = {"ise/host/shore"}, recorder = {"atirma/recorder"},
                               foxglove = {"atirma/foxglove"}, fleet = {"atirma/gprs"},
                               process = {""}; // a process host has no path

const std::vector<row>& matrix() {
    static const std::vector<row> all = {
        {node, true, "telemetry", "wos"},
        {node, false, "telemetry_store", "s"},
        {node, false, "track", "wos"},
        {node, true, "communication_state", "wos"},
        {node, false, "telecommand", "os"},
        {node, false, "raw_telecommand", "e"},
        {node, true, "telecommand_state", "os"},
        {node, false, "telecommand_recall", "os"},
        {node, false, "telecommand_record", "o"},
        {node, false, "authority", "o"},
        {node, true, "authority_state", "os"},
        {node, false, "replication", "s"},
        {xbee, true, "telemetry", "wos"},
        {xbee, false, "telecommand", "s"},
        {xbee, true, "telecommand_state", "os"},
        {xbee, false, "telecommand_recall", "s"},
        {xbee, true, "xb_local", "o"},
        {xbee, false, "xb_local_param", "o"},
        {gprs, true, "telemetry", "wos"},
        {gprs, false, "telecommand", "s"},
        {gprs, false, "telecommand_recall", "s"},
        {gprs, true, "gprs_state", "os"},
        {iridium, true, "telemetry", "wos"},
        {iridium, false, "telecommand", "s"},
        {iridium, false, "telecommand_recall", "s"},
        {iridium, true, "iridium_account", "wos"},
        {boat, false, "scene", ""},
        {boat, true, "ground_truth", "sb"},
        {air, false, "air_control", ""},
        {air, true, "air", ""},
        {carrier, false, "carrier_control", ""},
        {carrier, true, "carrier", ""},
        {modem, false, "iridium_sky_control", ""},
        {modem, true, "iridium_sky", ""},
        {gateway, false, "sbd_session", "sb"},
        {gateway, true, "sbd_ring", "sb"},
        {gateway, false, "iridium_gateway_control", ""},
        {gateway, true, "iridium_gateway_status", ""},
        {bridge, true, "bridge", "o"},
        // No component of A-Tirma's deployment: whoever adds one adds a rule.
        {recorder, false, "trigger", ""},
        {recorder, false, "status", ""},
        {foxglove, false, "status", ""},
        {foxglove, true, "published", ""},
        {fleet, true, "gprs_gateway_state", "o"}, // of apps/atirma/fleet.toml
        // Of ISE itself; what every component has comes below.
        {names, false, "ise.names.register", "wosb"},
        {names, false, "ise.names.renew", "wosb"},
        {names, false, "ise.names.withdraw", "wosb"},
        {names, false, "ise.names.ended", "wosb"},
        {names, false, "ise.names.resolve", "wosb"},
        {names, false, "ise.names.await", "wosb"},
        {names, false, "ise.names.list", "wosb"},
        {names, false, "ise.names.describe", "wosb"},
        {names, false, "ise.names.lost", "wosb"},
        {names, true, "ise.names.watch", "wosb"},
        {names, true, "ise.names.role", "wosb"},
        {host, false, "ise.host.types", "os"},
        {host, false, "ise.host.instances", "os"},
        {host, false, "ise.host.check", "os"},
        {host, false, "ise.host.output", "os"},
        {host, true, "ise.host.output_follow", "os"},
        {host, true, "ise.host.events", "os"},
        {host, false, "ise.host.start", "o"},
        {host, false, "ise.host.restart", "o"},
        {host, false, "ise.host.change", "o"},
        {host, false, "ise.host.stop", "o"},
        {host, false, "ise.host.kill", "o"},
        {host, false, "ise.host.set", "osb"}, // of what, is asked there
        // Of a process that runs several components: for the instantiation server, which is of the same user.
        {process, false, "ise.process.start", ""},
        {process, false, "ise.process.stop", ""},
        {process, false, "ise.process.components", ""},
    };
    return all;
}

// What every component tells of itself, and who sets its parameters.
struct own_services {
    std::vector<std::string> titles;
    std::string_view describe, read, set;
};

std::vector<row> own_rows() {
    const own_services all[] = {
        {node, "wosb", "osb", "os"}, // the page: which services it has, and nothing else
        {xbee, "wosb", "osb", "os"}, {gprs, "wosb", "osb", "os"},  {iridium, "wosb", "osb", "os"},
        {boat, "osb", "osb", "b"},   {air, "osb", "osb", "b"},     {carrier, "osb", "osb", "b"},
        {modem, "osb", "osb", "b"},  {gateway, "osb", "osb", ""},  {bridge, "osb", "osb", ""},
        {page, "osb", "osb", ""},    {recorder, "osb", "osb", ""}, {foxglove, "osb", "osb", ""},
        {names, "osb", "osb", ""},   {host, "os", "os", ""},       {process, "os", "os", ""},
    };
    std::vector<row> made;
    for (const auto& one : all) {
        made.push_back({one.titles, false, "ise.describe", one.describe});
        for (const char* service : {"ise.health", "ise.parameters", "ise.access"})
            made.push_back({one.titles, false, service, one.read});
        for (const char* service : {"ise.calls", "ise.parameter_changes", "ise.runs"})
            made.push_back({one.titles, true, service, one.read});
        made.push_back({one.titles, false, "ise.change_parameters", one.set});
    }
    return made;
}

std::vector<row> whole_matrix() {
    auto all = matrix();
    for (auto& one : own_rows()) all.push_back(std::move(one));
    // The components of another boat of a fleet, by the same rules.
    for (std::size_t at = 0, count = all.size(); at < count; ++at) {
        auto other = all[at];
        for (auto& title : other.titles)
            if (title.starts_with("atirma/")) title.replace(0, 6, "boat-12");
        if (other.titles != all[at].titles && other.titles != std::vector<std::string>{"boat-12/gprs"})
            all.push_back(std::move(other));
    }
    return all;
}

// As a component decides: a service of ISE itself may have a rule of its own, beside the one of its kind.
verdict of_use(const policy& of, const char* who, const row& one) {
    auto what = request_for(one.subscription, one.titles, one.service);
    auto plain = what;
    plain.what = one.subscription ? action::subscribe : action::call;
    plain.item = one.service;
    auto said = of.decide(who, plain);
    return said.allowed || said.denied ? said : of.decide(who, what);
}

} // namespace

TEST_CASE("access: A-Tirma's policy says of every service and everybody what is written down here") {
    auto of = atirma();
    std::size_t cells = 0;
    const auto all = whole_matrix();
    for (const auto& one : all)
        for (const auto& who : columns) {
            auto said = of_use(*of, who.who, one);
            INFO(fmt::format("'{}' of {} for {}: line {}", one.service, one.titles.front(), shown(who.who), said.line));
            auto has = [&one](char letter) { return one.may.find(letter) != one.may.npos; };
            CHECK(said.allowed == (has(who.letter) || (who.letter == 'e' && has('o')))); // engineers are operators
            ++cells;
        }
    CHECK(cells == all.size() * std::size(columns));
}

TEST_CASE("access: A-Tirma's policy denies everybody a service that it does not name") {
    auto of = atirma();
    for (const auto& one : whole_matrix())
        for (const auto& who : columns)
            for (bool subscription : {false, true})
                for (const char* unknown : {"new_service", "ise.new_service", "telecommand2"}) {
                    INFO(unknown << " of " << one.titles.front() << " for " << who.who);
                    CHECK_FALSE(of->decide(who.who, request_for(subscription, one.titles, unknown)).allowed);
                }
}

// Every service that is declared in these folders.
std::set<std::string> declared_below(std::initializer_list<const char*> folders) {
    const std::regex declared(R"re((?:request_response|subscription)<[^;{]*>\s+\w+\{\s*"([^"]+)"\s*\})re");
    std::set<std::string> found;
    for (const char* folder : folders)
        for (const auto& entry :
             std::filesystem::recursive_directory_iterator(std::filesystem::path(ISE_SOURCE_DIR) / folder)) {
            if (entry.path().extension() != ".hpp") continue;
            auto text = text_of_file(entry.path());
            text = std::regex_replace(text, std::regex(R"(//[^\n]*)"), "");
            for (std::sregex_iterator at(text.begin(), text.end(), declared), end; at != end; ++at)
                found.insert((*at)[1].str());
        }
    return found;
}

TEST_CASE("access: every service that ISE and A-Tirma declare is among those") {
    std::set<std::string> known;
    for (const auto& one : whole_matrix()) known.insert(one.service);
    auto declared = declared_below({"ise", "components", "apps"});
    for (const auto& one : declared) {
        INFO("a service without a row: " << one);
        CHECK(known.contains(one));
    }
    CHECK(declared.size() > 60);
}

TEST_CASE("access: of each service of ISE itself it is known what it lets somebody do") {
    std::size_t found = 0;
    for (const auto& one : declared_below({"ise"})) {
        if (!one.starts_with("ise.") || one.starts_with("ise.process.")) continue; // those take a rule that names them
        INFO(one);
        CHECK(request_for(false, node, one).item.empty());
        ++found;
    }
    CHECK(found > 28);
}

TEST_CASE("access: the file that the page on access shows can be used") {
    auto text = text_of_file(std::filesystem::path(ISE_SOURCE_DIR) / "docs/access.md");
    const std::string begin = "```toml\n";
    auto from = text.find(begin);
    REQUIRE(from != text.npos);
    from += begin.size();
    std::vector<remark> problems;
    auto made = policy::parse(text.substr(from, text.find("```", from) - from), "access.toml", problems);
    for (const auto& one : problems) UNSCOPED_INFO(one.line << ": " << one.text);
    REQUIRE(made);
    CHECK(made->rules().size() == 4);
}

TEST_CASE("access: in A-Tirma's policy the web host starts, stops, sets and is nothing but its page") {
    auto of = atirma();
    auto may = [&](action what, const char* who, const std::string& path, const std::string& item = {},
                   std::int32_t priority = 0) {
        const std::string named[] = {path};
        request wanted;
        wanted.what = what;
        wanted.targets = named;
        wanted.item = item;
        wanted.priority = priority;
        wanted.host = "shore";
        wanted.type = "xbee-proxy";
        return of->decide(who, wanted).allowed;
    };
    const char* web = "ise://atirma/web";
    for (auto what : {action::start, action::stop, action::set, action::role})
        for (const char* path : {"atirma/shore/xbee", "atirma/page", "atirma/communication", "atirma/boat"})
            CHECK_FALSE(may(what, web, path, "power-level"));
    for (const char* path :
         {"atirma/shore/xbee", "atirma/boat", "ise/name_server", "ise/host/shore", "atirma/operators/x"})
        CHECK_FALSE(may(action::name, web, path));
    CHECK(may(action::name, web, "atirma/page"));
    for (const char* path : {"atirma/console/ana", "boat-2/console/ana", "atirma/operators/ana"}) {
        CHECK(may(action::name, "ise://atirma/operator/ana", path));
        CHECK_FALSE(may(action::name, web, path));
    }
    CHECK(may(action::start, "ise://atirma/operator/ana", "atirma/shore/xbee"));
    CHECK(may(action::role, "ise://atirma/shore", "atirma/communication", {}, 100));
    CHECK_FALSE(may(action::role, "ise://atirma/shore", "atirma/communication", {}, 101));
}

} // namespace atirma_access_test
