// Components that listen on tls, with the certificates of their instantiation server.
#include "host.hpp"

#include <support/authority.hpp>

#include <fstream>

using namespace host_test;
using ise_test::Contains;

namespace {

std::vector<std::string> endpoints_of(host& at, const std::string& path) {
    for (const auto& one : at.json_of({"list"}))
        if (one["path"] == path) return one["endpoints"].get<std::vector<std::string>>();
    return {};
}

std::string file_in(const host& at, const std::string& text) {
    auto path = at.programs().parent_path() / "sea.toml";
    std::ofstream(path) << text;
    return path.string();
}

constexpr const char* encrypted = R"(
name = "sea"
[hosts.shore]
[components.one]
type = "trouble"
host = "shore"
protocol = "tls"
)";

} // namespace

TEST_CASE(
    "a component listens on tls with the certificates of its instantiation server, alone and in a shared process") {
    ise_test::authority authority;
    auto mine = authority.issue("shore").string();
    host here;
    here.open({"--tls", mine});
    here.start("sea/one", {"--protocol", "tls", "--set", "answer=2"});
    here.start("sea/two", {"--protocol", "tls", "--process", "main"});
    for (const char* path : {"sea/one", "sea/two"}) {
        auto at = endpoints_of(here, path);
        REQUIRE(at.size() == 1);
        CHECK_THAT(at.front(), ise_test::StartsWith("tls://127.0.0.1:"));
        CHECK(here.ise({"call", path, "ask"}).exit_code == 3); // who has no certificate
    }
    CHECK(here.json_of({"--tls", mine, "call", "sea/one", "ask"})["answer"] == 2);
}

TEST_CASE("where the instantiation server has no certificates, tls is refused with what it takes") {
    host here;
    here.open();
    for (auto option : {std::pair("--protocol", "tls"), std::pair("--listen", "tls://127.0.0.1:0")}) {
        auto refused = here.ise({"start", "trouble", "sea/one", option.first, option.second});
        CHECK(refused.exit_code == 2);
        CHECK_THAT(refused.err, Contains("tls takes certificates, and this instantiation server has none to pass on") &&
                                    Contains("--tls FOLDER"));
    }
    CHECK(marked().empty());
}

TEST_CASE("a component of a deployment file listens on tls where its host has certificates") {
    ise_test::authority authority;
    auto mine = authority.issue("shore").string();
    host here;
    auto file = file_in(here, encrypted);
    here.open();
    for (const char* command : {"validate", "up"}) {
        auto refused = here.ise({command, file});
        CHECK(refused.exit_code == 2);
        CHECK_THAT(
            refused.err,
            Contains("sea.toml:4:13: tls takes certificates, and this instantiation server has none to pass on"));
    }
    CHECK(marked().empty());
    CHECK(here.close() == 0);
    here.open({"--tls", mine});
    CHECK(here.ise({"up", file}).exit_code == 0);
    REQUIRE(endpoints_of(here, "sea/one").size() == 1);
    CHECK_THAT(endpoints_of(here, "sea/one").front(), ise_test::StartsWith("tls://"));
    CHECK(here.ise({"up", file}).exit_code == 0); // nothing is to be done
    CHECK(here.ise({"down", file}).exit_code == 0);
    CHECK(marked().empty());
}
