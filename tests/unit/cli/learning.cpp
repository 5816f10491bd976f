// What `ise access learn` makes of looks at a system: a policy that allows each use, and nothing else.
#include <apps/ise/learning.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <memory>

namespace learning_test {

using namespace ise::cli;
using ise::access::action;
using ise_test::Contains;

namespace {

surveyed known(const std::string& path, std::uint64_t process) {
    surveyed made;
    made.name.path = path;
    made.name.host_name = "shore";
    made.name.process_id = process;
    made.about.emplace();
    made.about->path = path;
    return made;
}

ise::session_info session(const std::string& peer, const std::string& who, std::vector<std::string> uses = {}) {
    ise::session_info made;
    made.peer = peer;
    made.who = who;
    made.uses = std::move(uses);
    return made;
}

void provides(surveyed& who, const std::string& name, ise::service_kind kind, std::uint64_t calls = 0) {
    ise::service_info made;
    made.name = name;
    made.kind = static_cast<std::uint8_t>(kind);
    who.about->services.push_back(made);
    if (!who.health) who.health.emplace();
    ise::service_load load;
    load.name = name;
    load.calls = calls;
    who.health->services.push_back(load);
}

// A boat with two services in use, a page that uses them, and another that uses one.
std::vector<surveyed> fleet() {
    auto boat = known("sea/boat", 1), page = known("sea/page", 2), other = known("sea/other", 3);
    auto names = known("ise/name_server", 4);
    for (const auto* one : {"helm", "plan", "scuttle"}) provides(boat, one, ise::service_kind::request_response);
    for (const auto* one : {"position", "secrets"}) provides(boat, one, ise::service_kind::subscription);
    boat.name.roles = {{"sea/lead", 7}};
    boat.about->sessions = {session("sea/page (tls://10.0.0.1:1)", "ise://sea/web"),
                            session("sea/other (tls://10.0.0.1:2)", "ise://sea/other"),
                            session("ise/cli/77 (tls://10.0.0.1:3)", "ise://sea/ana", {"position"}),
                            session("ise/name_server (tls://10.0.0.9:7400)", "ise://sea/shore", {"ise.names.resolve"})};
    page.about->sessions = {
        session("sea/boat (tls://10.0.0.2:1)", "ise://sea/boat", {"helm", "plan", "position", "ise.describe"})};
    other.about->sessions = {
        session("sea/boat (tls://10.0.0.2:2)", "ise://sea/boat", {"helm", "ise.change_parameters"})};
    names.about->sessions = {
        session("tls://10.0.0.2:5", "ise://sea/boat"), session("tls://10.0.0.1:5", "ise://sea/web"),
        session("tls://10.0.0.1:6", "ise://sea/other"), session("sea/boat (tls://10.0.0.2:6)", "ise://sea/boat")};
    return {std::move(boat), std::move(page), std::move(other), std::move(names)};
}

struct written {
    learned_outcome seen;
    std::string text;
    std::shared_ptr<const ise::access::policy> policy;

    explicit written(const learning& of) : seen(of.outcome()) {
        learned_head head{"2026-05-01T12:00:03Z", "10 min", of.looks(), of.components()};
        text = policy_text(seen, head);
        std::vector<ise::access::remark> problems;
        policy = ise::access::policy::parse(text, "access.toml", problems);
        INFO(text);
        REQUIRE(policy);
        CHECK(objection_to_policy(text, seen).empty());
    }
    bool allows(const std::string& who, action what, const std::string& path, const std::string& item = {},
                std::int32_t priority = 0) const {
        const std::string target[] = {path};
        ise::access::request wanted;
        wanted.what = what;
        wanted.targets = target;
        wanted.item = item;
        wanted.priority = priority;
        return policy->decide(who, wanted).allowed;
    }
    bool misses(const std::string& part) const {
        return std::ranges::any_of(seen.unknown, [&](const auto& one) { return one.find(part) != one.npos; });
    }
};

written of(const std::vector<surveyed>& all) {
    learning seen;
    seen.look(all, {});
    return written(seen);
}

} // namespace

TEST_CASE("a learned policy allows each use that was seen, and nothing else") {
    auto made = of(fleet());
    INFO(made.text);
    struct sample {
        std::string who;
        action what;
        std::string path, item;
        std::int32_t priority = 0;
        auto operator<=>(const sample&) const = default;
    };
    const std::vector<sample> seen = {{"ise://sea/web", action::call, "sea/boat", "helm"},
                                      {"ise://sea/web", action::call, "sea/boat", "plan"},
                                      {"ise://sea/web", action::subscribe, "sea/boat", "position"},
                                      {"ise://sea/web", action::read, "sea/boat", ""},
                                      {"ise://sea/other", action::call, "sea/boat", "helm"},
                                      {"ise://sea/boat", action::name, "sea/boat", ""},
                                      {"ise://sea/web", action::name, "sea/page", ""},
                                      {"ise://sea/other", action::name, "sea/other", ""},
                                      {"ise://sea/shore", action::name, "ise/name_server", ""},
                                      {"ise://sea/boat", action::role, "sea/lead", "", 7}};
    std::size_t allowed = 0;
    for (const std::string who :
         {"ise://sea/web", "ise://sea/other", "ise://sea/boat", "ise://sea/shore", "ise://sea/ana", ""})
        for (const std::string path :
             {"sea/boat", "sea/page", "sea/other", "ise/name_server", "sea/lead", "ise/cli/77", "x"})
            for (auto what : {action::call, action::subscribe, action::read, action::name, action::role, action::set})
                for (const std::string item : {"helm", "plan", "scuttle", "position", "secrets", "ise.describe", ""}) {
                    bool named = what == action::call || what == action::subscribe || what == action::set;
                    if (item.empty() == named) continue;
                    sample one{who, what, path, item, what == action::role ? 7 : 0};
                    bool expected = std::ranges::find(seen, one) != seen.end();
                    INFO(who << " " << ise::access::name_of(what) << " " << path << ":" << item);
                    CHECK(made.allows(who, what, path, item, one.priority) == expected);
                    allowed += expected;
                }
    CHECK(allowed == seen.size());
    CHECK_FALSE(made.allows("ise://sea/boat", action::role, "sea/lead", "", 8));
}

TEST_CASE("services of one component are one pattern, and components of one folder that are used alike, too") {
    auto all = fleet();
    auto second = known("sea/buoy", 9);
    provides(second, "helm", ise::service_kind::request_response);
    second.about->sessions = {session("sea/other (tls://10.0.0.1:2)", "ise://sea/other")};
    all[2].about->sessions.push_back(session("sea/buoy (tls://10.0.0.3:2)", "ise://sea/boat", {"helm"}));
    all.push_back(second);
    auto made = of(all);
    CHECK_THAT(made.text, Contains("    \"sea/boat:{helm,plan}\", # by sea/page\n"));
    CHECK_THAT(made.text, Contains("    \"sea/{boat,buoy}:helm\", # by sea/other\n"));
    CHECK_THAT(
        made.text,
        Contains(
            "    \"sea/{boat,buoy}\", # registered, seen by ise/name_server, seen by sea/other, seen by sea/page\n"));
    std::ranges::reverse(all);
    CHECK(of(all).text == made.text);
}

TEST_CASE("more services than a pattern has room for are several") {
    auto all = fleet();
    std::vector<std::string> names;
    for (int number = 0; number < 200; ++number) {
        names.push_back("service_" + std::to_string(number));
        provides(all[0], names.back(), ise::service_kind::request_response);
    }
    all[1].about->sessions.front().uses = names;
    auto made = of(all);
    for (const auto& one : names) CHECK(made.allows("ise://sea/web", action::call, "sea/boat", one));
    CHECK_FALSE(made.allows("ise://sea/web", action::call, "sea/boat", "service_200"));
}

TEST_CASE("what could not be seen is said") {
    auto all = fleet();
    provides(all[0], "alarm", ise::service_kind::request_response, 3);
    all[0].about->sessions.push_back(session("tls://10.0.0.7:1", "ise://sea/stranger"));
    auto silent = known("sea/silent", 12);
    silent.about.reset();
    all.push_back(silent);
    auto made = of(all);
    INFO(made.text);
    CHECK(made.misses("who used 'alarm' of sea/boat; it had sessions with ise://sea/stranger without a path"));
    CHECK(made.misses("which parameters ise://sea/other (sea/other) may set by 'ise.change_parameters' of sea/boat"));
    CHECK(made.misses("which identity registers sea/silent"));
    CHECK(made.misses("what sea/silent uses"));
    CHECK(made.seen.unknown.size() == 4);
    CHECK_THAT(made.text, Contains("# who = [\"ise://sea/ana\"]"));
}

TEST_CASE("looks add up, and what is used within a process needs no rule") {
    learning seen;
    seen.look(fleet(), {});
    auto later = fleet();
    later[1].about->sessions.front().uses = {"scuttle"};
    later[0].about->sessions.push_back(session("sea/twin (inproc://boat)", "ise://sea/boat", {"wave"}));
    seen.look(later, {});
    written made(seen);
    for (const auto* one : {"helm", "plan", "scuttle"})
        CHECK(made.allows("ise://sea/web", action::call, "sea/boat", one));
    CHECK_FALSE(made.allows("ise://sea/boat", action::name, "sea/twin"));
}

TEST_CASE("what peers say of themselves can neither widen a rule nor break the file") {
    auto all = fleet();
    for (const std::string name :
         {"a*", "{helm,scuttle}", "x\"]\nname = [\"**", "a,b", "back\\slash", "two:parts", ""}) {
        provides(all[0], name, ise::service_kind::request_response);
        all[1].about->sessions.front().uses.push_back(name);
        all[0].about->sessions.push_back(session(name + " (tls://10.0.0.1:9)", "ise://sea/" + name));
    }
    all[0].name.roles.emplace("**", 1);
    auto made = of(all);
    CHECK(made.misses("cannot be written as a pattern"));
    CHECK_FALSE(made.allows("ise://sea/web", action::call, "sea/boat", "scuttle"));
    CHECK_FALSE(made.allows("ise://sea/web", action::name, "sea/boat"));
    CHECK_FALSE(made.allows("ise://sea/boat", action::role, "sea/any", "", 1));
    CHECK(made.allows("ise://sea/web", action::call, "sea/boat", "plan"));
}

TEST_CASE("peers without an identity are nobody") {
    auto boat = known("sea/boat", 1), page = known("sea/page", 2), names = known("ise/name_server", 4);
    provides(boat, "helm", ise::service_kind::request_response);
    boat.about->sessions = {session("sea/page (tcp://10.0.0.1:1)", "")};
    page.about->sessions = {session("sea/boat (tcp://10.0.0.2:1)", "", {"helm"})};
    names.about->sessions = {session("tcp://10.0.0.2:5", "")};
    auto made = of({boat, page, names});
    CHECK(made.allows("", action::call, "sea/boat", "helm"));
    CHECK(made.allows("", action::name, "sea/page"));
    CHECK_FALSE(made.allows("ise://sea/web", action::call, "sea/boat", "helm"));
}

} // namespace learning_test
