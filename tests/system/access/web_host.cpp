// The web host's certificate against the rest of A-Tirma, over TLS and by A-Tirma's own policy: what the Internet could
// do that has taken that host. All of it are processes.
#include <ise/instantiation/services.hpp>
#include <ise/ise.hpp>
#include <support/authority.hpp>
#include <support/catch.hpp>
#include <support/program.hpp>
#include <test_folders.hpp>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace web_host_test {

using namespace std::chrono_literals;
using Catch::Contains;
using nlohmann::json;
namespace services = ise::instantiation::services;

namespace {

struct nothing_asked {};
inline constexpr ise::request_response<nothing_asked, nothing_asked> telecommand{"telecommand"};

// A name server and the shore's instantiation server, with an operator who may start what he likes there.
class shore {
public:
    shore() {
        auto pattern = (std::filesystem::temp_directory_path() / "ise-access-XXXXXX").string();
        if (!::mkdtemp(pattern.data())) throw std::runtime_error("no temporary folder");
        folder_ = pattern;
        std::filesystem::create_directories(folder_ / "programs");
        std::filesystem::create_symlink(ISE_BINARY_DIR "/bin/ise_trouble", folder_ / "programs/ise_trouble");
        std::filesystem::copy_file(ISE_SOURCE_DIR "/apps/atirma/access.toml", policy());
        std::filesystem::permissions(policy(),
                                     std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
        auto issue = [&](const std::string& name, const std::string& identity) {
            return authority_.issue(name, "URI:" + identity + "," + ise_test::authority::everywhere).string();
        };
        shore_ = issue("shore", "ise://atirma/shore");
        web = issue("web", "ise://atirma/web");
        ana = issue("ana", "ise://atirma/operator/ana");
        several = issue("several", "ise://atirma/web,URI:ise://atirma/shore");
        names_ = std::make_unique<ise_test::program>(
            with_policy({"ise_name_server", "--listen", "tls://127.0.0.1:0", "--fresh", "--state", "none"}));
        auto line = names_->read_line();
        INFO(line);
        REQUIRE(line.find("tls://") != line.npos);
        name_server = line.substr(line.find("tls://"));
        server_ = std::make_unique<ise_test::program>(
            with_policy({"ise_instantiation_server", "--programs", (folder_ / "programs").string(), "--state",
                         (folder_ / "state").string(), "--name", "shore", "--listen", "tls://127.0.0.1:0",
                         "--name-server", name_server}));
        line = server_->read_line();
        INFO(line);
        REQUIRE(line.find("ise/host/shore") != line.npos);
    }
    ~shore() {
        (void)ise(ana, {"stop", "atirma/shore/xbee"});
        for (auto* one : {server_.get(), names_.get()})
            if (one) {
                one->signal(SIGTERM);
                one->wait();
            }
        std::error_code ignored;
        std::filesystem::remove_all(folder_, ignored);
    }
    shore(const shore&) = delete;
    shore& operator=(const shore&) = delete;

    std::filesystem::path policy() const { return folder_ / "access.toml"; }
    ise_test::ran ise(const std::string& certificate, std::vector<std::string> words) {
        words.insert(words.begin(), {"ise", "--name-server", name_server, "--tls", certificate});
        return ise_test::run_program(std::move(words));
    }
    /// Of one identity in the audit log.
    std::vector<json> lines_of(const std::string& who) const {
        std::vector<json> all;
        std::ifstream in(folder_ / "audit.jsonl");
        for (std::string line; std::getline(in, line);) {
            auto one = json::parse(line);
            if (one["who"] == who) all.push_back(std::move(one));
        }
        return all;
    }
    std::size_t refusals(const std::string& what) const {
        auto all = lines_of("ise://atirma/web");
        return static_cast<std::size_t>(std::ranges::count_if(all, [&](const json& one) {
            return one["verdict"] == "denied" && one["what"].get<std::string>().starts_with(what);
        }));
    }

    std::string name_server, web, ana, several;

private:
    std::vector<std::string> with_policy(std::vector<std::string> words) const {
        words.insert(words.end(), {"--tls", shore_, "--access", policy().string(), "--audit",
                                   (folder_ / "audit.jsonl").string(), "--log-level", "error"});
        return words;
    }

    ise_test::authority authority_;
    std::filesystem::path folder_;
    std::string shore_;
    std::unique_ptr<ise_test::program> names_, server_;
};

ise::node_options options_of(const shore& at, const std::string& certificate) {
    ise::node_options made;
    made.name_server = ise::endpoint::parse(at.name_server).value();
    made.security.tls_folder = certificate;
    made.log = {};
    return made;
}

struct told {
    ise::errc code{};
    ise::execution executed = ise::execution::unknown;
    std::string text;
};

template <class Contract>
ise::task<told> ask(ise::component& self, std::string whom, Contract service, typename Contract::request_type request) {
    auto there = co_await self.find(whom, 20s);
    auto got = co_await there.try_call(service, request, 20s);
    told made;
    if (got) co_return made;
    made.code = got.error().code();
    made.executed = got.error().executed();
    made.text = got.error().message();
    co_return made;
}

ise::task<> until_ready(ise::component& one) { co_await one.ready(); }

ise::task<> wait_here(ise::component& self) { co_await self.sleep(24h); }

} // namespace

TEST_CASE("access: with the web host's certificate nothing is started, stopped, set, named, served or commanded") {
    shore at;
    auto started = at.ise(at.ana, {"start", "trouble", "atirma/shore/xbee", "--host", "shore", "--protocol", "tls",
                                   "--timeout", "120s", "--ready-within", "60s", "--wait"});
    INFO(started.err);
    REQUIRE(started.exit_code == 0);
    REQUIRE(at.lines_of("ise://atirma/web").empty());

    ise::real_environment env;
    ise::node node(env, options_of(at, at.web));
    ise::component_options quiet;
    quiet.listens = false;
    auto& self = node.start("", wait_here, quiet);
    auto denied = [](const told& got, const std::string& what) {
        INFO(got.text);
        CHECK(got.code == ise::errc::access_denied);
        CHECK(got.executed == ise::execution::not_executed);
        CHECK_THAT(got.text,
                   Contains("ise://atirma/web may not " + what) && Contains("ise access why ise://atirma/web"));
    };

    ise::instantiation::start_request start;
    start.type = "trouble";
    start.path = "atirma/shore/gprs";
    denied(self.wait(ask(self, "ise/host/shore", services::start, start)), "start components on host shore");
    CHECK(at.refusals("start ") == 1);

    ise::instantiation::stop_request stop;
    stop.path = "atirma/shore/xbee";
    denied(self.wait(ask(self, "ise/host/shore", services::stop, stop)), "stop components on host shore");
    CHECK(at.refusals("stop ") == 1);

    ise::instantiation::set_request set;
    set.path = "atirma/shore/xbee";
    set.settings.push_back({"answer", "3"});
    denied(self.wait(ask(self, "ise/host/shore", services::set, set)), "set parameters");
    CHECK(at.refusals("set ") == 1);

    denied(self.wait(ask(self, "atirma/shore/xbee", telecommand, nothing_asked())),
           "call 'telecommand' of atirma/shore/xbee");
    CHECK(at.refusals("call atirma/shore/xbee:telecommand") == 1);

    ise::component_options listens;
    listens.listen = {ise::endpoint::parse("tls://127.0.0.1:0").value()};
    auto& claims = node.start("atirma/shore/iridium", wait_here, listens);
    claims.wait(until_ready(claims));
    auto page = listens;
    page.roles = {{"atirma/communication", 2000}};
    auto& serves = node.start("atirma/page", wait_here, page);
    serves.wait(until_ready(serves));
    auto until = std::chrono::steady_clock::now() + 20s;
    while (at.refusals("name ") == 0 && std::chrono::steady_clock::now() < until) std::this_thread::sleep_for(20ms);
    CHECK(at.refusals("name atirma/shore/iridium") == 1);
    CHECK(at.refusals("role atirma/communication=2000") == 1);

    auto listed = at.ise(at.ana, {"list", "--json"});
    INFO(listed.err);
    REQUIRE(listed.exit_code == 0);
    std::vector<std::string> paths;
    for (const auto& one : json::parse(listed.out)) {
        paths.push_back(one["path"]);
        if (one["path"] == "atirma/page") CHECK(one["roles"].empty());
    }
    CHECK(std::ranges::count(paths, "atirma/shore/iridium") == 0);
    CHECK(std::ranges::count(paths, "atirma/shore/gprs") == 0);
    CHECK(std::ranges::count(paths, "atirma/page") == 1);
    CHECK(std::ranges::count(paths, "atirma/shore/xbee") == 1); // it runs on

    for (const auto& one : at.lines_of("ise://atirma/web")) CHECK_FALSE(one["serial"].get<std::string>().empty());
    auto hers = at.lines_of("ise://atirma/operator/ana");
    CHECK(std::ranges::count_if(hers, [](const json& one) {
              return one["what"] == "start shore:atirma/shore/xbee=trouble" && one["verdict"] == "allowed" &&
                     one["rule"].get<std::string>().starts_with("access.toml:");
          }) == 1);
    node.stop();
    node.wait();
}

TEST_CASE("access: whoever shows a certificate with several identities is refused in the handshake") {
    shore at;
    auto at_port = at.name_server.substr(std::string("tls://").size());
    auto connect = [&](const std::string& folder) {
        return ise_test::run_program({"/usr/bin/openssl", "s_client", "-quiet", "-connect", at_port, "-cert",
                                      folder + "/certificate.pem", "-key", folder + "/key.pem", "-CAfile",
                                      folder + "/ca.pem"});
    };
    auto refused = connect(at.several);
    CHECK_THAT(refused.err, Contains("alert certificate unknown"));
    auto taken = connect(at.web); // until it is closed for not saying hello
    CHECK_THAT(taken.err, !Contains("alert certificate"));
}

TEST_CASE("access: the command line says who is who, which policy counts where, and why not") {
    shore at;
    auto started = at.ise(at.ana, {"start", "trouble", "atirma/shore/xbee", "--host", "shore", "--protocol", "tls",
                                   "--timeout", "120s", "--ready-within", "60s", "--wait"});
    INFO(started.err);
    REQUIRE(started.exit_code == 0);

    auto described = at.ise(at.ana, {"describe", "ise/host/shore", "--json"});
    REQUIRE(described.exit_code == 0);
    auto sessions = json::parse(described.out)["sessions"];
    CHECK(std::ranges::any_of(sessions,
                              [](const json& one) { return one.value("who", "") == "ise://atirma/operator/ana"; }));

    auto listed = at.ise(at.ana, {"access", "list", "--json"});
    INFO(listed.err);
    REQUIRE(listed.exit_code == 0);
    auto policies = json::parse(listed.out);
    REQUIRE(policies.size() == 3); // name server, instantiation server, and what that has started
    for (const auto& one : policies) {
        INFO(one.dump());
        CHECK(one["hash"] == policies[0]["hash"]);
        CHECK(one["identity"] == "ise://atirma/shore");
        CHECK(one["differs"] == false);
    }
    auto refused = at.ise(at.web, {"describe", "ise/host/shore"});
    CHECK(refused.exit_code != 0);
    CHECK_THAT(refused.err, Contains("ise://atirma/web may not read"));

    auto why = [&](std::vector<std::string> words) {
        words.insert(words.begin(), {"ise", "--access", at.policy().string(), "access", "why"});
        return ise_test::run_program(std::move(words)).out;
    };
    CHECK_THAT(why({"ise://atirma/web", "call", "atirma/communication:telecommand"}), Contains("denied: no rule of"));
    CHECK_THAT(why({"ise://atirma/operator/ana", "call", "atirma/shore/xbee:telecommand"}),
               Contains("denied: ") && Contains("access.toml:"));
    CHECK_THAT(why({"ise://atirma/operator/ana", "start", "shore:atirma/shore/xbee=xbee-proxy"}),
               Contains("allowed: "));
    auto checked = ise_test::run_program({"ise", "access", "check", at.policy().string()});
    CHECK(checked.exit_code == 0);
    CHECK_THAT(checked.out, Contains("can be used: "));
    auto broken = at.policy().string() + ".broken";
    std::ofstream(broken) << "version = 1\n[[allow]\n";
    auto wrong = ise_test::run_program({"ise", "access", "check", broken});
    CHECK(wrong.exit_code == 2);
    CHECK_THAT(wrong.err, Contains(".broken:2:"));
}

} // namespace web_host_test
