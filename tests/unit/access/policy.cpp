// What a policy allows: its file, its rules, and whom they mean.
#include <ise/access/policy.hpp>
#include <support/catch.hpp>

#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

namespace policy_test {

using namespace ise::access;
using ise_test::Contains;

namespace {

std::shared_ptr<const policy> read(const std::string& text) {
    std::vector<remark> problems;
    auto made = policy::parse(text, "access.toml", problems);
    for (const auto& one : problems) UNSCOPED_INFO(one.line << ": " << one.text);
    REQUIRE(made);
    return made;
}

std::string problems_of(const std::string& text) {
    std::vector<remark> problems;
    auto made = policy::parse(text, "access.toml", problems);
    std::string all;
    for (const auto& one : problems) all += fmt::format("{}:{}: {}\n", one.line, one.column, one.text);
    CHECK((made == nullptr) == !problems.empty());
    return all;
}

// That of the issue, with a denial.
const std::string usual = R"(version = 1
[groups]
operators = ["ise://atirma/operator/*"]
[unix]
"uid:1001" = "ise://atirma/shore/web"
[[allow]]
who = "ise://atirma/web"
subscribe = ["atirma/communication:telemetry"]
call = ["atirma/communication:track"]
name = ["atirma/page"]
[[allow]]
who = "@operators"
call = ["atirma/communication:{telecommand,authority}", "atirma/**:*"]
set = ["atirma/shore/xbee:power_level"]
host = [{ host = "shore", do = ["start", "stop"], type = "*-proxy", path = "atirma/shore/**" }]
[[allow]]
who = "ise://atirma/shore/*"
name = ["atirma/shore/**"]
role = [{ role = "atirma/communication", max-priority = 100 }]
read = "atirma/**"
[[deny]]
who = "ise://atirma/operator/guest"
call = ["atirma/communication:telecommand"]
)";

struct asking {
    std::shared_ptr<const policy> of;

    verdict use(const std::string& who, bool subscription, std::vector<std::string> titles,
                const std::string& service) const {
        return of->decide(who, request_for(subscription, titles, service));
    }
    bool may_call(const std::string& who, const std::string& path, const std::string& service) const {
        return use(who, false, {path}, service).allowed;
    }
    bool may_subscribe(const std::string& who, const std::string& path, const std::string& service) const {
        return use(who, true, {path}, service).allowed;
    }
    bool may(action what, const std::string& who, const std::string& path, const std::string& item = {},
             std::int32_t priority = 0) const {
        const std::string named[] = {path};
        request wanted;
        wanted.what = what;
        wanted.targets = named;
        wanted.item = item;
        wanted.priority = priority;
        return of->decide(who, wanted).allowed;
    }
    bool may_start(const std::string& who, const std::string& host, const std::string& path,
                   const std::string& type) const {
        const std::string named[] = {path};
        request wanted;
        wanted.what = action::start;
        wanted.targets = named;
        wanted.host = host;
        wanted.type = type;
        return of->decide(who, wanted).allowed;
    }
};

const std::string web = "ise://atirma/web", ana = "ise://atirma/operator/ana", guest = "ise://atirma/operator/guest",
                  xbee = "ise://atirma/shore/xbee";

} // namespace

TEST_CASE("access: what no rule allows is denied, and what a rule denies no other allows") {
    asking ask{read(usual)};
    CHECK(ask.may_call(web, "atirma/communication", "track"));
    CHECK_FALSE(ask.may_call(web, "atirma/communication", "telecommand"));
    CHECK_FALSE(ask.may_call(web, "atirma/communication", "telemetry"));
    CHECK_FALSE(ask.may_subscribe(web, "atirma/communication", "track"));
    CHECK(ask.may_subscribe(web, "atirma/communication", "telemetry"));
    CHECK(ask.may_call(ana, "atirma/communication", "telecommand"));
    CHECK(ask.may_call(guest, "atirma/communication", "authority"));
    auto denied = ask.use(guest, false, {"atirma/communication"}, "telecommand");
    CHECK_FALSE(denied.allowed);
    CHECK(denied.denied);
    CHECK(denied.line == 23);
    auto unknown = ask.use(web, false, {"atirma/communication"}, "telecommand");
    CHECK_FALSE(unknown.denied);
    CHECK(unknown.line == 0);
    CHECK(ask.use(web, false, {"atirma/communication"}, "track").line == 9);
    CHECK_FALSE(ask.may_call("", "atirma/communication", "track"));
    CHECK_FALSE(ask.may_call("ise://atirma/key", "atirma/communication", "track"));
}

TEST_CASE("access: a rule that names a role is about whoever serves it, under any path") {
    asking ask{read(usual)};
    CHECK(ask.use(web, false, {"atirma/shore/node", "atirma/communication"}, "track").allowed);
    CHECK_FALSE(ask.use(web, false, {"atirma/shore/node"}, "track").allowed);
    CHECK(ask.use(guest, false, {"atirma/shore/node", "atirma/communication"}, "telecommand").denied);
}

TEST_CASE("access: a wildcard does not mean the services of ISE itself") {
    asking ask{read(usual)};
    CHECK(ask.may_call(ana, "atirma/shore/xbee", "link"));
    CHECK_FALSE(ask.may_call(ana, "atirma/shore/xbee", "ise.describe"));
    CHECK(ask.may_call(xbee, "atirma/boat", "ise.describe")); // by read
    CHECK(ask.may_call(xbee, "atirma/boat", "ise.parameters"));
    CHECK_FALSE(ask.may_call(xbee, "atirma/boat", "ise.change_parameters"));
    CHECK(ask.may_call(ana, "atirma/shore/xbee", "ise.change_parameters")); // which of them is asked there
    CHECK_FALSE(ask.may_call(ana, "atirma/boat", "ise.change_parameters"));
    CHECK(ask.may_call(ana, "ise/host/shore", "ise.host.start"));
    CHECK_FALSE(ask.may_call(ana, "ise/host/boat", "ise.host.start"));
    CHECK_FALSE(ask.may_call(web, "ise/host/shore", "ise.host.stop"));
    CHECK_FALSE(ask.may_call(ana, "atirma/boat", "ise.of_a_later_version"));
    CHECK(ask.may_call(web, "ise/name_server", "ise.names.resolve")); // whom a rule is about
    CHECK_FALSE(ask.may_call("ise://atirma/stranger", "ise/name_server", "ise.names.resolve"));
    CHECK_FALSE(ask.may_call("", "ise/name_server", "ise.names.list"));
}

TEST_CASE("access: parameters, names, roles up to a priority, and starts by host, type and path") {
    asking ask{read(usual)};
    CHECK(ask.may(action::set, ana, "atirma/shore/xbee", "power_level"));
    CHECK_FALSE(ask.may(action::set, ana, "atirma/shore/xbee", "serial"));
    CHECK(ask.may(action::name, web, "atirma/page"));
    CHECK_FALSE(ask.may(action::name, web, "atirma/boat"));
    CHECK(ask.may(action::name, xbee, "atirma/shore/far/xbee"));
    CHECK(ask.may(action::role, xbee, "atirma/communication", {}, 100));
    CHECK_FALSE(ask.may(action::role, xbee, "atirma/communication", {}, 101));
    CHECK_FALSE(ask.may(action::role, web, "atirma/communication", {}, -1));
    CHECK(ask.may_start(ana, "shore", "atirma/shore/xbee", "xbee-proxy"));
    CHECK_FALSE(ask.may_start(ana, "shore", "atirma/shore/xbee", "web-server"));
    CHECK_FALSE(ask.may_start(ana, "boat", "atirma/shore/xbee", "xbee-proxy"));
    CHECK_FALSE(ask.may_start(ana, "shore", "atirma/boat", "xbee-proxy"));
    CHECK_FALSE(ask.may_start(ana, "shore", "atirma/shore/xbee", "")); // of whatever type it is
    CHECK_FALSE(ask.may_start(web, "shore", "atirma/shore/xbee", "xbee-proxy"));
}

TEST_CASE("access: a denial of part of something does not hide the rest") {
    asking ask{read(R"(version = 1
[[allow]]
who = "ise://a/ana"
set = ["a/**:*"]
host = [{ host = "*", do = ["start", "stop"] }]
[[deny]]
who = "**"
set = ["a/boat:serial"]
host = [{ host = "shore", do = "stop", path = "a/keel" }]
)")};
    CHECK(ask.may_call("ise://a/ana", "a/boat", "ise.change_parameters"));
    CHECK(ask.may(action::set, "ise://a/ana", "a/boat", "rate"));
    CHECK_FALSE(ask.may(action::set, "ise://a/ana", "a/boat", "serial"));
    CHECK(ask.may_call("ise://a/ana", "ise/host/shore", "ise.host.stop"));
    CHECK(ask.may_start("ise://a/ana", "shore", "a/keel", "x"));
}

TEST_CASE("access: an identity or a user of its own is given to a component only where a rule names it") {
    auto of = read(R"(version = 1
[[allow]]
who = "ise://a/ana"
host = [{ host = "shore", do = ["start", "stop"] }]
[[allow]]
who = "ise://a/ben"
host = [{ host = "shore", do = "start", identity = "{xbee,gprs}", user = "atirma-*" }]
[[allow]]
who = "ise://a/*"
host = [{ host = "boat", do = "start", identity = "*", user = "*" }]
[[deny]]
who = "**"
host = [{ host = "boat", do = "start", user = "root" }]
)");
    auto may = [&](const char* who, const char* host, const char* identity, const char* user) {
        const std::string path[] = {"a/x"};
        request wanted;
        wanted.what = action::start;
        wanted.targets = path;
        wanted.host = host;
        wanted.type = "proxy";
        wanted.identity = identity;
        wanted.user = user;
        return of->decide(who, wanted).allowed;
    };
    CHECK(may("ise://a/ana", "shore", "", ""));
    CHECK_FALSE(may("ise://a/ana", "shore", "xbee", ""));
    CHECK_FALSE(may("ise://a/ana", "shore", "", "atirma-x"));
    CHECK(may("ise://a/ben", "shore", "", ""));
    CHECK(may("ise://a/ben", "shore", "xbee", "atirma-x"));
    CHECK_FALSE(may("ise://a/ben", "shore", "web", "atirma-x"));
    CHECK_FALSE(may("ise://a/ben", "shore", "xbee", "root"));
    CHECK(may("ise://a/ben", "boat", "web", "pi"));
    CHECK_FALSE(may("ise://a/ben", "boat", "web", "root"));
    // A denial of one user says nothing to whether anything may be started.
    const std::string server[] = {"ise/host/boat"};
    CHECK(of->decide("ise://a/ben", request_for(false, server, "ise.host.start")).allowed);

    const std::string path[] = {"a/x"};
    request named;
    named.what = action::start;
    named.targets = path;
    named.host = "shore";
    named.type = "proxy";
    named.identity = "xbee";
    named.user = "pi";
    CHECK(text_of(named) == "start shore:a/x=proxy,identity=xbee,user=pi");
}

TEST_CASE("access: nobody is meant by name only") {
    asking ask{read("version = 1\n[[allow]]\nwho = \"**\"\ncall = [\"a/b:c\"]\n")};
    CHECK(ask.may_call("unix:7", "a/b", "c"));
    CHECK_FALSE(ask.may_call("", "a/b", "c"));
    asking open{read("version = 1\n[[allow]]\nwho = [\"nobody\"]\ncall = [\"a/b:c\"]\n")};
    CHECK(open.may_call("", "a/b", "c"));
    CHECK_FALSE(open.may_call("nobody", "a/b", "c")); // no such identity is verified
}

TEST_CASE("access: an identity is that of the certificate, else of the user, else of the key") {
    auto of = read(usual);
    ise::verified_peer peer;
    CHECK(identity_of(peer, {}, of.get()).empty());
    peer.user = 1002;
    CHECK(identity_of(peer, {}, of.get()) == "unix:1002");
    peer.has_key = true;
    CHECK(identity_of(peer, {}, of.get()) == "ise://atirma/key");
    CHECK(identity_of(peer, "ise://other/boat", nullptr) == "ise://other/key");
    peer.user = 1001;
    CHECK(identity_of(peer, {}, of.get()) == "ise://atirma/shore/web");
    peer.certificate = web;
    CHECK(identity_of(peer, {}, of.get()) == web);
    peer.same_process = true;
    CHECK(identity_of(peer, xbee, of.get()) == xbee);
}

TEST_CASE("access: an identity is ise://SYSTEM/NAME and nothing else") {
    for (const char* good : {"ise://a/b", "ise://atirma/operator/ana", "ise://a/b.c-d_e@f"})
        CHECK(check_identity(good));
    for (const char* bad : {"", "ise://", "ise://a", "ise://a/", "ise:///b", "ise://a//b", "ise://a/b*", "ise://a/b c",
                            "http://a/b", "ISE://a/b", "ise://a/b\n"})
        CHECK_FALSE(check_identity(bad));
    CHECK_FALSE(check_identity(std::string_view("ise://a/b\0c", 11)));
    CHECK_FALSE(check_identity("ise://a/" + std::string(200, 'b')));
}

TEST_CASE("access: what is wrong with a file is told with its line, all of it at once") {
    CHECK_THAT(problems_of("version = 1\n[[allow]\n"), Contains("2:"));
    CHECK_THAT(problems_of("versio = 1\n"), Contains("1:1: 'versio' is not known here") && Contains("is missing"));
    CHECK_THAT(problems_of("version = 2\n"), Contains("'version' is 1 here"));
    auto many = problems_of(R"(version = 1
[unix]
"1001" = "ise://a/b"
"uid:7" = "a"
[[allow]]
call = ["atirma/boat"]
[[allow]]
who = "@nowhere"
cal = ["a:b"]
role = [{ role = "a", max-priority = "1" }]
host = [{ host = "shore", do = ["begin"] }]
set = [1]
[[deny]]
who = ["web", "{ise://a/b"]
)");
    CHECK_THAT(many, Contains("3:1: '1001' is no user"));
    CHECK_THAT(many, Contains("4:") && Contains("'a' is not an identity"));
    CHECK_THAT(many, Contains("'who' is missing"));
    CHECK_THAT(many, Contains("6:9: 'atirma/boat' is not PATH:SERVICE"));
    CHECK_THAT(many, Contains("8:7: there is no group 'nowhere'"));
    CHECK_THAT(many, Contains("9:1: 'cal' is not known here"));
    CHECK_THAT(many, Contains("'max-priority' is a whole number"));
    CHECK_THAT(many, Contains("'begin' is neither start nor stop"));
    CHECK_THAT(many, Contains("12:8: 'set' has texts"));
    CHECK_THAT(many, Contains("14:8: 'web' is not an identity") && Contains("a '{' without its '}'"));
}

TEST_CASE("access: characters beyond ASCII are for strings and comments, and refused elsewhere with their place") {
    for (const char* good : {
             "# la política\nversion = 1 # año\n",
             "version = 1\n[groups]\n\"ñ\" = [\"ise://a/ñ\", 'ise://a/\\', \"#\"] # ñ\n",
             "version = 1\n[groups]\na = [\"\\\"ñ\\\\\"]\n",
             "version = 1\n[groups]\na = [\"\"\"\nñ \" \"\" ñ\"\"\"\"\"]\n# ñ\n",
             "version = 1\n[groups]\na = [\'\'\'ñ\\\'\'\']\n# ñ\n",
             "\xEF\xBB\xBFversion = 1\n",
             "version = 1\n[a.\"ñ\".'ñ']\n3.\"ñ\" = {b.\"ñ\" = [[1], 'ñ', {c = \"ñ\"}], d = 0, \"ñ\" = 1}\n\"ñ\" = 1\n",
         }) {
        INFO(good);
        CHECK_THAT(problems_of(good), !Contains("not ASCII"));
    }
    const std::pair<const char*, const char*> bad[] = {
        {"version = 1\n  año = 1\n", "2:4: a character that is not ASCII"},
        {"version = ñ\n", "1:11: "},
        {"version = 1\nsystem = \"a#\"ø\n", "2:14: "},
        {"version = 1\nsystem = \"\"ø\n", "2:12: "},
        {"version = 1\nsystem = \"a\nø\"\n", "3:1: "},             // a string ends with its line
        {"version = 1\nsystem = \"\"\"a\\\n  ø\"\"\"\n", "3:3: "}, // on the line that goes on
        {"version = 1\nsystem = \"\"\"\\ø\"\"\"\n", "2:14: "},     // an escape that TOML does not have
        {"\xD6\x22", "1:1: "},
        {"version = 0\"ñ\"\n", "1:13: "}, // a quote within a word begins no string
        {"version = 0[\"ñ\"\n", "1:14: "},
        {"version = 0.\"ñ\"\n", "1:14: "},
        {"version = [0{'ñ'\n", "1:15: "},
        {"version = 0=\"ñ\"\n", "1:14: "},
    };
    for (const auto& [text, where] : bad) {
        INFO(text);
        CHECK_THAT(problems_of(text), Contains(where));
    }
}

TEST_CASE("access: any text is a policy or has something wrong with it") {
    std::vector<std::string> broken;
    for (std::size_t at = 0; at < usual.size(); at += 3) {
        broken.push_back(usual.substr(0, at));
        auto flipped = usual;
        flipped[at] = static_cast<char>(flipped[at] ^ 0x15);
        broken.push_back(flipped);
    }
    for (const auto& text : broken) problems_of(text); // checks that it is one or the other
}

TEST_CASE("access: a policy is known by its content") {
    CHECK(read(usual)->hash() == read(usual)->hash());
    CHECK(read(usual)->hash() != read(usual + "\n")->hash());
    CHECK(read(usual)->hash().size() == 16);
    CHECK(read(usual)->system() == "atirma");
    CHECK(read("version = 1\nsystem = \"b\"\n")->system() == "b");
}

TEST_CASE("access: what is asked is written as it is asked about") {
    const std::string named[] = {"a/b", "a/role"};
    request what;
    what.targets = named;
    what.item = "c";
    CHECK(text_of(what) == "call a/b:c");
    what.what = action::role;
    what.priority = 7;
    CHECK(text_of(what) == "role a/b=7");
    what.what = action::start;
    what.host = "shore";
    what.type = "web-server";
    CHECK(text_of(what) == "start shore:a/b=web-server");
}

} // namespace policy_test
