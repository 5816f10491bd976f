#include <ise/name_server/registry.hpp>
#include <ise/packet/schema.hpp>

#include <support/catch.hpp>

#include <fmt/format.h>

namespace registry_test {

using namespace std::chrono_literals;
using ise::naming::name_change;
using ise::naming::verdict;

namespace {

constexpr ise::time_point start{1h};
const ise::wall_time noon = std::chrono::sys_days(std::chrono::year(2026) / 6 / 1) + 12h;

struct fix {
    double latitude_deg = 0, longitude_deg = 0;
};

ise::registry_options options(ise::duration recovery = {}) {
    ise::registry_options made;
    made.recovery = recovery;
    return made;
}

// A registry and its clock, which it hears ticking.
struct world {
    explicit world(ise::registry_options with = options(), ise::wall_time wall = noon,
                   ise::registry_memory memory = ise::registry_memory())
        : names(with, 1, start, wall, memory) {}

    void pass(ise::duration time) {
        for (auto end = now + time; now < end;) {
            now = std::min(end, now + names.tick());
            names.advance(now);
        }
    }
    ise::naming::grant claim(std::uint64_t node, std::string path, std::uint64_t epoch = 0,
                             std::uint64_t incarnation = 0) {
        auto request = of(node);
        ise::naming::component_claim wanted;
        wanted.path = std::move(path);
        wanted.epoch = epoch;
        wanted.incarnation = incarnation ? incarnation : node * 10;
        wanted.endpoints = {fmt::format("tcp://10.0.0.{}:4000", node)};
        if (auto shown = proofs.find({node, wanted.path, epoch}); shown != proofs.end()) wanted.proof = shown->second;
        request.components.push_back(std::move(wanted));
        auto answer = names.enroll(request, now).grants.at(0);
        if (answer.what == verdict::granted) proofs[{node, answer.path, answer.epoch}] = answer.proof;
        return answer;
    }
    // Claims "n<node>" with a role.
    ise::naming::grant serve(std::uint64_t node, std::string role, std::int32_t priority, std::string state = "ready") {
        auto request = of(node);
        ise::naming::component_claim wanted;
        wanted.path = fmt::format("n{}", node);
        wanted.incarnation = node * 10;
        wanted.state = std::move(state);
        wanted.roles[role] = priority;
        request.components.push_back(std::move(wanted));
        return names.enroll(request, now).grants.at(0);
    }
    std::vector<std::string> serving(const std::string& role) {
        std::vector<std::string> paths;
        for (const auto& one : names.members_of(role, now).members) paths.push_back(one.path);
        return paths;
    }
    ise::naming::register_request of(std::uint64_t node) {
        ise::naming::register_request request;
        request.node.lease_key = node;
        request.node.host_name = fmt::format("host{}", node);
        request.node.process_id = 1000 + node;
        request.lease = 2s;
        return request;
    }
    ise::naming::renew_response renew(std::uint64_t node) {
        ise::naming::renew_request request;
        request.lease_key = node;
        return names.renew(request, now);
    }
    void withdraw(std::uint64_t node, std::string path, std::uint64_t incarnation = 0) {
        ise::naming::departure gone;
        gone.path = std::move(path);
        gone.incarnation = incarnation ? incarnation : node * 10;
        ise::naming::withdraw_request request;
        request.lease_key = node;
        request.departures.push_back(gone);
        names.withdraw(request, now);
    }
    bool holds(std::string_view path) { return names.resolve(path, now).has_value(); }

    ise::time_point now = start;
    // Of its grants, which their holders show.
    std::map<std::tuple<std::uint64_t, std::string, std::uint64_t>, std::uint64_t> proofs;
    ise::registry names;
};

std::vector<std::string> text_of(const std::vector<ise::naming::name_event>& events) {
    std::vector<std::string> all;
    for (const auto& event : events)
        all.push_back(fmt::format("{}{}",
                                  event.what == name_change::added     ? "+"
                                  : event.what == name_change::changed ? "~"
                                                                       : "-",
                                  event.name.path));
    return all;
}

} // namespace

TEST_CASE("registry: a granted name resolves to its holder and its epoch") {
    world it;
    auto granted = it.claim(1, "atirma/boat");
    REQUIRE(granted.what == verdict::granted);
    auto found = it.names.resolve("atirma/boat", it.now);
    REQUIRE(found);
    CHECK(found->epoch == granted.epoch);
    CHECK(found->incarnation == 10);
    CHECK(found->host_name == "host1");
    CHECK(found->endpoints == std::vector<std::string>{"tcp://10.0.0.1:4000"});
    auto absent = it.names.resolve("atirma/buoy", it.now);
    REQUIRE_FALSE(absent);
    CHECK(absent.error().code() == ise::errc::no_such_name);
}

TEST_CASE("registry: a lease ends when it is not renewed, and not before") {
    world it;
    it.claim(1, "a");
    it.pass(1900ms);
    CHECK(it.holds("a"));
    it.pass(100ms);
    CHECK_FALSE(it.holds("a"));
    CHECK(it.names.nodes() == 0);
}

TEST_CASE("registry: renewals keep all names of a node") {
    world it;
    it.claim(1, "a");
    it.claim(1, "b");
    for (int i = 0; i < 20; ++i) {
        it.pass(1500ms);
        CHECK(it.renew(1).known);
    }
    CHECK(it.holds("a"));
    CHECK(it.holds("b"));
    it.pass(2s);
    CHECK_FALSE(it.renew(1).known);
}

TEST_CASE("registry: a lease is at most the server's") {
    world it;
    auto request = it.of(1);
    request.lease = 1h;
    CHECK(it.names.enroll(request, it.now).lease == 2s);
    request.lease = ise::duration(-5);
    CHECK(it.names.enroll(request, it.now).lease > 0s);
}

TEST_CASE("registry: a server that was stopped for a while expires nobody for it") {
    world it;
    it.claim(1, "a");
    it.now += 1h; // it did not run: no tick
    CHECK(it.renew(1).known);
    CHECK(it.holds("a"));
}

TEST_CASE("registry: a taken name says who holds it") {
    world it;
    auto first = it.claim(1, "atirma/boat");
    it.pass(500ms);
    auto denied = it.claim(2, "atirma/boat");
    REQUIRE(denied.what == verdict::taken);
    REQUIRE(denied.held_by.size() == 1);
    CHECK(denied.held_by[0].epoch == first.epoch);
    CHECK(denied.held_by[0].process_id == 1001);
    CHECK(denied.held_by[0].lease_age == 500ms);
    for (const char* word : {"atirma/boat", "host1", "1001", "tcp://10.0.0.1:4000", "500 ms"})
        CHECK(denied.reason.find(word) != std::string::npos);
}

TEST_CASE("registry: a name that is taken anew gets a higher epoch") {
    world it;
    auto first = it.claim(1, "a");
    it.withdraw(1, "a");
    auto second = it.claim(2, "a");
    REQUIRE(second.what == verdict::granted);
    CHECK(second.epoch > first.epoch);
    auto reborn = it.claim(2, "a", 0, 77); // the next life in the same node
    REQUIRE(reborn.what == verdict::granted);
    CHECK(reborn.epoch > second.epoch);
}

TEST_CASE("registry: a holder keeps its epoch when it tells what has changed") {
    world it;
    auto first = it.claim(1, "a");
    CHECK(it.claim(1, "a", first.epoch).epoch == first.epoch);
    CHECK(it.claim(1, "a").epoch == first.epoch);
}

TEST_CASE("registry: who returns after its lease was over keeps its epoch if nobody was there meanwhile") {
    world it;
    auto first = it.claim(1, "a");
    it.pass(5s);
    CHECK(it.claim(1, "a", first.epoch).epoch == first.epoch);
    it.pass(5s);
    auto other = it.claim(2, "a");
    it.withdraw(2, "a");
    auto again = it.claim(1, "a", first.epoch);
    CHECK(again.what == verdict::granted);
    CHECK(again.epoch > other.epoch);
}

TEST_CASE("registry: who returns to a name that another was granted is superseded") {
    world it;
    auto first = it.claim(1, "a");
    it.pass(5s);
    auto other = it.claim(2, "a");
    auto back = it.claim(1, "a", first.epoch);
    CHECK(back.what == verdict::superseded);
    REQUIRE(back.held_by.size() == 1);
    CHECK(back.held_by[0].epoch == other.epoch);
    CHECK(back.held_by[0].epoch > first.epoch);
}

TEST_CASE("registry: a late withdrawal does not end the next life") {
    world it;
    it.claim(1, "a", 0, 10);
    it.claim(1, "a", 0, 11);
    it.withdraw(1, "a", 10);
    CHECK(it.holds("a"));
    it.withdraw(2, "a", 11); // not its own
    CHECK(it.holds("a"));
    it.withdraw(1, "a", 11);
    CHECK_FALSE(it.holds("a"));
}

TEST_CASE("registry: after a restart only those who held names before get them at first") {
    world before;
    auto held = before.claim(1, "a");
    world it(options(2s), noon + 10s);
    auto fresh = it.claim(2, "a");
    CHECK(fresh.what == verdict::wait);
    CHECK(fresh.retry_after == 2s);
    auto unsure = it.names.resolve("a", it.now);
    REQUIRE_FALSE(unsure);
    CHECK(unsure.error().code() == ise::errc::name_server_lost);

    it.pass(1s);
    auto back = it.claim(1, "a", held.epoch);
    CHECK(back.what == verdict::granted);
    CHECK(back.epoch == held.epoch);
    it.pass(900ms);
    CHECK(it.claim(2, "b").what == verdict::wait);
    it.pass(100ms);
    CHECK(it.claim(2, "b").what == verdict::granted);
    CHECK(it.claim(2, "a").what == verdict::taken);
}

TEST_CASE("registry: epochs grow across restarts") {
    world first;
    auto old = first.claim(1, "a");
    SECTION("by the wall clock") {
        world second(options(), noon + 1ms);
        CHECK(second.claim(2, "a").epoch > old.epoch);
    }
    SECTION("by what returning holders show, if the clock went back") {
        world second(options(2s), noon - std::chrono::years(3));
        CHECK(second.claim(1, "a", old.epoch).epoch == old.epoch);
        second.pass(2s);
        second.renew(1);
        CHECK(second.claim(2, "b").epoch > old.epoch);
        second.withdraw(1, "a");
        CHECK(second.claim(2, "a").epoch > old.epoch);
    }
    SECTION("with a clock before 1970") {
        world second(options(), ise::wall_time(-5h));
        auto one = second.claim(2, "a");
        second.withdraw(2, "a");
        CHECK(second.claim(2, "a").epoch > one.epoch);
    }
}

TEST_CASE(
    "registry: of two holders that return after a restart the later one wins, and the other is told until it knows") {
    world first;
    auto earlier = first.claim(1, "a");
    first.pass(5s);
    auto later = first.claim(2, "a");
    auto earlier_comes_first = GENERATE(true, false);
    world it(options(2s), noon + 10s);
    if (earlier_comes_first) {
        CHECK(it.claim(1, "a", earlier.epoch).what == verdict::granted);
        CHECK(it.claim(2, "a", later.epoch).what == verdict::granted);
        for (int twice = 0; twice < 2; ++twice) {
            auto result = it.renew(1).lost;
            REQUIRE(result.size() == 1);
            CHECK(result[0].what == verdict::superseded);
            CHECK(result[0].path == "a");
            CHECK(result[0].held_by.at(0).epoch == later.epoch);
        }
        it.withdraw(1, "a");
        CHECK_FALSE(it.renew(1).known); // it holds nothing any more
    } else {
        CHECK(it.claim(2, "a", later.epoch).what == verdict::granted);
        CHECK(it.claim(1, "a", earlier.epoch).what == verdict::superseded);
    }
    CHECK(it.names.resolve("a", it.now).value().epoch == later.epoch);
}

TEST_CASE("registry: who shows an epoch that nobody was granted gets the next one, and no other name suffers") {
    world it;
    auto before = it.claim(1, "a");
    auto shown = GENERATE_COPY(before.epoch + 1, before.epoch + 1'000'000, ise::highest_epoch - 1,
                               (std::uint64_t{1} << 62) - 1, ~std::uint64_t{0});
    CAPTURE(shown);
    CHECK(it.claim(9, "x", shown).epoch == before.epoch + 1);
    CHECK(it.claim(9, "x", shown, 91).epoch == before.epoch + 2); // its next life
    CHECK(it.claim(9, "a", shown).what == verdict::superseded);

    auto after = it.claim(2, "b");
    CHECK(after.epoch == before.epoch + 3);
    CHECK(it.claim(2, "b", after.epoch).epoch == after.epoch); // it tells what has changed
    it.pass(5s);
    CHECK(it.claim(1, "a", before.epoch).epoch == before.epoch);
    CHECK(it.claim(2, "b", after.epoch).epoch == after.epoch);
}

TEST_CASE("registry: an epoch that no clock gives is not taken over after a restart either, and one that may be right "
          "harms nobody") {
    world first;
    auto held = first.claim(1, "a");
    world it(options(2s), noon + 10s);
    auto shown = GENERATE(ise::highest_epoch - 1, ise::highest_epoch, (std::uint64_t{1} << 62) - 1, ~std::uint64_t{0});
    CAPTURE(shown);
    auto stranger = it.claim(9, "x", shown);
    REQUIRE(stranger.what == verdict::granted);
    CHECK(stranger.epoch < ise::highest_epoch);
    CHECK(it.claim(1, "a", held.epoch).epoch == held.epoch);
    it.pass(1s);
    it.renew(1);
    it.pass(1s);
    auto later = it.claim(2, "b");
    CHECK(later.epoch > stranger.epoch);
    it.pass(5s);
    CHECK(it.claim(1, "a", held.epoch).epoch == held.epoch);
    CHECK(it.claim(2, "b", later.epoch).epoch == later.epoch);

    world next(options(2s), noon + 20s); // counts by the clock again
    CHECK(next.claim(1, "a", held.epoch).epoch == held.epoch);
    CHECK(next.claim(2, "b", later.epoch).what == verdict::granted);
    CHECK(next.names.resolve("b", next.now).value().epoch < ise::highest_epoch);
}

TEST_CASE("registry: who takes a name from one that a former server granted it does so under an epoch that this server "
          "vouches for") {
    world first;
    auto earlier = first.claim(1, "a");
    // Its clock goes back below the later grant, not below the earlier one; the later holder is away during the
    // recovery.
    world second(options(), noon + 1h);
    auto later = second.claim(2, "a");
    auto forged = GENERATE(std::uint64_t{0}, ise::highest_epoch - 1, (std::uint64_t{1} << 62) - 1, ~std::uint64_t{0});
    CAPTURE(forged);
    world it(options(2s), noon + 1min);
    REQUIRE(it.claim(1, "a", earlier.epoch).epoch == earlier.epoch);
    it.pass(1s);
    it.renew(1);
    it.pass(1s);
    it.renew(1);
    auto last = it.names.last_epoch();
    CHECK(it.claim(2, "a", forged == 0 ? later.epoch : forged).epoch == last + 1);
    REQUIRE(it.renew(1).lost.size() == 1);
    CHECK(it.renew(1).lost[0].what == verdict::superseded);
    auto fresh = it.claim(3, "b");
    CHECK(it.claim(3, "b", fresh.epoch).epoch == fresh.epoch);
}

TEST_CASE("registry: changes are told in order, what stays the same is none") {
    world it;
    it.claim(1, "a");
    it.claim(2, "b");
    it.claim(1, "a");
    it.renew(1);
    CHECK(text_of(it.names.take_changes()) == std::vector<std::string>{"+a", "+b"});
    it.claim(1, "a", 0, 99);
    it.withdraw(2, "b");
    CHECK(text_of(it.names.take_changes()) == std::vector<std::string>{"~a", "-b"});
    it.pass(3s);
    CHECK(text_of(it.names.take_changes()) == std::vector<std::string>{"-a"});
    CHECK(it.names.take_changes().empty());
}

TEST_CASE("registry: lists what lies below a prefix, page by page") {
    world it;
    for (const char* path : {"atirma", "atirma-old/x", "atirma/boat", "atirma/shore/web", "atirma/shore/xbee", "zebra"})
        it.claim(1, path);
    auto list = [&](std::string prefix, std::uint32_t limit = 0, std::string after = "") {
        ise::naming::list_request request;
        request.prefix = std::move(prefix);
        request.limit = limit;
        request.after = std::move(after);
        std::string text;
        auto response = it.names.list(request, it.now);
        for (const auto& name : response.names) text += name.path + " ";
        return text + (response.more ? "…" : "");
    };
    CHECK(list("") == "atirma atirma-old/x atirma/boat atirma/shore/web atirma/shore/xbee zebra ");
    CHECK(list("atirma") == "atirma atirma/boat atirma/shore/web atirma/shore/xbee ");
    CHECK(list("atirma/shore/") == "atirma/shore/web atirma/shore/xbee ");
    CHECK(list("atirm") == "");
    CHECK(list("atirma", 2) == "atirma atirma/boat …");
    CHECK(list("atirma", 2, "atirma/boat") == "atirma/shore/web atirma/shore/xbee ");
    CHECK(it.names.snapshot("atirma/shore").size() == 2);
}

TEST_CASE("registry: describes services with the schemas that they name, and forgets these with the last one") {
    world it;
    const auto& schema = ise::schema_of<fix>();
    auto request = it.of(1);
    for (const char* path : {"a", "b"}) {
        ise::naming::component_claim claim;
        claim.path = path;
        ise::naming::service_entry service;
        service.name = "position";
        service.kind = 1;
        service.fingerprints = {schema.fingerprint(), 5};
        claim.services.push_back(service);
        request.components.push_back(claim);
    }
    request.schemas.push_back({schema.fingerprint(), schema.text()});
    request.schemas.push_back({12345, schema.text()}); // not its fingerprint
    auto response = it.names.enroll(request, it.now);
    CHECK(response.grants.at(0).what == verdict::granted);
    CHECK(response.grants.at(0).reason.find("fingerprint") != std::string::npos);
    auto described = it.names.describe("b", it.now);
    REQUIRE(described);
    CHECK(described->name.services_provided == 1);
    REQUIRE(described->schemas.size() == 1);
    CHECK(described->schemas[0].text == schema.text());
    CHECK(it.names.services() == 2);
    it.withdraw(1, "a", 0);
    it.names.withdraw(
        [&] {
            ise::naming::withdraw_request gone;
            gone.lease_key = 1;
            gone.departures.push_back({"a", 0});
            gone.departures.push_back({"b", 0});
            return gone;
        }(),
        it.now);
    CHECK(it.names.schemas() == 0);
    CHECK(it.names.services() == 0);
}

TEST_CASE("registry: what goes beyond a limit is refused by the limit's name") {
    auto with = options();
    with.limits.max_services_per_component = 2;
    with.limits.max_endpoints_per_component = 1;
    with.limits.max_path_bytes = 10;
    with.limits.max_text_bytes = 20;
    world it(with);
    auto request = it.of(1);
    ise::naming::component_claim claim;
    claim.path = "a";
    auto refusal = [&] {
        request.components = {claim};
        auto answer = it.names.enroll(request, it.now).grants.at(0);
        return answer.what == verdict::refused ? answer.reason : "granted";
    };
    SECTION("path") {
        claim.path = "much/too/long";
        CHECK(refusal().find("max_path_bytes") != std::string::npos);
    }
    SECTION("no path") {
        auto path = GENERATE(as<std::string>(), "", "/a", "a/", "a//b", "ä", "a b", std::string("a\0b", 3));
        claim.path = path;
        CHECK(refusal().find("not a path") != std::string::npos);
    }
    SECTION("endpoints") {
        claim.endpoints = {"a", "b"};
        CHECK(refusal().find("max_endpoints_per_component") != std::string::npos);
    }
    SECTION("texts") {
        claim.state = std::string(21, 'x');
        CHECK(refusal().find("max_text_bytes") != std::string::npos);
    }
    SECTION("texts of the node") {
        request.node.name = std::string(21, 'x');
        CHECK(refusal().find("max_text_bytes") != std::string::npos);
    }
    SECTION("packets of a service") {
        claim.services.resize(1);
        claim.services[0].fingerprints.resize(17);
        CHECK(refusal().find("service_fingerprints is 16") != std::string::npos);
    }
    SECTION("services of one") {
        claim.services.resize(3);
        CHECK(refusal().find("max_services_per_component") != std::string::npos);
    }
}

TEST_CASE("registry: who comes while there is no room waits by the limit's name, and nobody loses what it has") {
    auto with = options();
    with.limits.max_components = 3;
    with.limits.max_components_per_node = 2;
    with.limits.max_nodes = 3;
    with.limits.max_services = 3;
    with.limits.max_members_per_role = 1;
    with.limits.max_claims_bytes = 10'000;
    world it(with);
    auto returning = GENERATE(std::uint64_t{0}, std::uint64_t{1}); // new, or after its lease was over
    CAPTURE(returning);
    auto request = it.of(1);
    ise::naming::component_claim claim;
    claim.path = "c";
    claim.epoch = returning;
    auto obstacle = [&] {
        request.components = {claim};
        auto answer = it.names.enroll(request, it.now).grants.at(0);
        if (answer.what == verdict::granted) return std::string("granted");
        CHECK(answer.what == verdict::wait);
        CHECK(answer.retry_after > 0s);
        CHECK(answer.retry_after < 2s); // within a lease
        return answer.reason;
    };
    SECTION("components") {
        it.claim(1, "a");
        it.claim(2, "b");
        it.claim(2, "x");
        CHECK(obstacle().find("which is max_components") != std::string::npos);
        it.withdraw(2, "b");
        CHECK(obstacle() == "granted");
    }
    SECTION("components of a node") {
        it.claim(1, "a");
        it.claim(1, "b");
        CHECK(obstacle().find("max_components_per_node") != std::string::npos);
        CHECK(it.claim(1, "a", 0, 77).what == verdict::granted); // it has that one
        CHECK(it.claim(2, "x").what == verdict::granted);
        it.withdraw(1, "b");
        CHECK(obstacle() == "granted");
    }
    SECTION("services") {
        claim.services.resize(2);
        REQUIRE(obstacle() == "granted");
        claim.services.resize(4);
        CHECK(obstacle().find("max_services") != std::string::npos);
        CHECK(it.holds("c")); // under what it told before
        CHECK(it.names.services() == 2);
        claim.path = "b";
        claim.services.resize(2);
        CHECK(obstacle().find("max_services") != std::string::npos);
        claim.services.resize(1);
        CHECK(obstacle() == "granted");
    }
    SECTION("memory") {
        claim.incarnation = 10;
        claim.endpoints.assign(10, std::string(512, 'x'));
        REQUIRE(obstacle() == "granted");
        CHECK(obstacle() == "granted"); // it takes no more than before
        claim.path = "b";
        CHECK(obstacle().find("max_claims_bytes is 10000") != std::string::npos);
        CHECK_FALSE(it.holds("b"));
        claim.path = "c";
        claim.endpoints.assign(20, std::string(512, 'x'));
        CHECK(obstacle().find("max_claims_bytes") != std::string::npos);
        CHECK(it.holds("c")); // as it told before
        it.withdraw(1, "c");
        claim.path = "b";
        claim.endpoints.resize(10);
        CHECK(obstacle() == "granted");
    }
    SECTION("nodes") {
        for (std::uint64_t other : {2u, 3u, 4u}) it.claim(other, fmt::format("n{}", other));
        CHECK(obstacle().find("max_nodes") != std::string::npos);
        CHECK(it.names.enroll(request, it.now).lease == 0s);
        it.withdraw(3, "n3");
        CHECK(obstacle() == "granted");
    }
    SECTION("members of a role") {
        it.serve(2, "gateway", 1);
        claim.roles["gateway"] = 1;
        CHECK(obstacle().find("max_members_per_role") != std::string::npos);
        it.withdraw(2, "n2");
        CHECK(obstacle() == "granted");
    }
}

TEST_CASE("registry: names that went to others count for their node until it knows") {
    auto with = options(2s);
    with.limits.max_components_per_node = 2;
    world it(with);
    REQUIRE(it.claim(1, "a", 5).what == verdict::granted);
    REQUIRE(it.claim(2, "a", 7).what == verdict::granted);
    REQUIRE(it.renew(1).lost.size() == 1);
    CHECK(it.claim(1, "b", 5).what == verdict::granted);
    auto third = it.claim(1, "c", 5);
    CHECK(third.what == verdict::wait);
    CHECK(third.reason.find("max_components_per_node") != std::string::npos);
    it.withdraw(1, "a");
    CHECK(it.claim(1, "c", 5).what == verdict::granted);
}

TEST_CASE("registry: ten thousand components with a hundred thousand services live and end") {
    world it;
    for (std::uint64_t node = 1; node <= 100; ++node) {
        auto request = it.of(node);
        for (int i = 0; i < 100; ++i) {
            ise::naming::component_claim claim;
            claim.path = fmt::format("fleet/n{}/c{}", node, i);
            claim.services.resize(10);
            request.components.push_back(std::move(claim));
        }
        for (const auto& grant : it.names.enroll(request, it.now).grants) REQUIRE(grant.what == verdict::granted);
    }
    CHECK(it.names.components() == 10'000);
    CHECK(it.names.services() == 100'000);
    for (std::uint64_t node = 1; node <= 100; ++node) CHECK(it.renew(node).known);
    CHECK(it.names.snapshot("fleet/n7").size() == 100);
    it.pass(3s);
    CHECK(it.names.components() == 0);
    CHECK(it.names.services() == 0);
}

TEST_CASE("registry: a role is served by priority, by who is ready, then by who came first") {
    using list = std::vector<std::string>;
    world it;
    it.serve(1, "gateway", 1);
    it.serve(2, "gateway", 5);
    it.serve(3, "gateway", 5);
    it.serve(4, "gateway", 9, "stalled");
    CHECK(it.serving("gateway") == list{"n2", "n3", "n1", "n4"});
    auto found = it.names.resolve("gateway", it.now);
    REQUIRE(found);
    CHECK(found->path == "gateway");
    CHECK(found->incarnation == 20);
    CHECK(found->members.size() == 4);
    CHECK(found->members[0].priority == 5);
    CHECK(found->certain);

    it.serve(4, "gateway", 9); // it goes on
    CHECK(it.serving("gateway") == list{"n4", "n2", "n3", "n1"});
    it.serve(4, "other", 9); // it serves another now
    CHECK(it.serving("gateway") == list{"n2", "n3", "n1"});
    it.withdraw(2, "n2");
    CHECK(it.serving("gateway") == list{"n3", "n1"});
    it.pass(1s);
    it.renew(1);
    it.pass(1s); // the lease of the third is over
    CHECK(it.serving("gateway") == list{"n1"});
    it.pass(3s);
    CHECK(it.serving("gateway").empty());
    CHECK_FALSE(it.names.resolve("gateway", it.now));
}

TEST_CASE("registry: a name goes before a role of the same path") {
    world it;
    it.serve(1, "a", 1);
    it.claim(2, "a");
    auto found = it.names.resolve("a", it.now);
    REQUIRE(found);
    CHECK(found->incarnation == 20);
    CHECK(found->members.empty());
}

TEST_CASE("registry: the roles among whose members something has changed are told once") {
    using set = std::set<std::string>;
    world it;
    it.serve(1, "a", 1);
    it.serve(2, "b", 1);
    CHECK(it.names.take_changed_roles() == set{"a", "b"});
    CHECK(it.names.take_changed_roles().empty());
    it.serve(1, "b", 1);
    CHECK(it.names.take_changed_roles() == set{"a", "b"});
    it.claim(3, "c");
    CHECK(it.names.take_changed_roles().empty());
}

TEST_CASE(
    "registry: a name whose lease ran out is lost until somebody holds it again, and one that was given back is not") {
    world it;
    auto lost = [&](std::string_view prefix = {}) {
        std::vector<std::string> paths;
        for (const auto& one : it.names.lost(prefix, it.now).names) paths.push_back(one.path);
        return paths;
    };
    using list = std::vector<std::string>;
    it.claim(1, "ise/host/boat");
    it.claim(2, "sea/wind");
    it.claim(3, "ise/host/shore");
    ise::naming::withdraw_request back;
    back.lease_key = 3;
    back.departures.push_back({"ise/host/shore", 30});
    it.names.withdraw(back, it.now);
    CHECK(lost().empty());
    it.pass(5s);
    CHECK(lost() == list{"ise/host/boat", "sea/wind"});
    CHECK(lost("ise/host") == list{"ise/host/boat"});
    CHECK(lost("ise/ho").empty());
    auto one = it.names.lost("ise/host", it.now).names.at(0);
    CHECK(one.host_name == "host1");
    CHECK(one.process_id == 1001);
    CHECK(one.lost_ago >= 2s);
    it.claim(4, "ise/host/boat");
    CHECK(lost("ise/host").empty());
}

TEST_CASE("registry: a name whose process was reported dead is not lost") {
    world it;
    auto request = it.of(1);
    request.node.launch_mark = std::string(32, 'm');
    ise::naming::component_claim wanted;
    wanted.path = "sea/wind";
    wanted.incarnation = 10;
    request.components.push_back(wanted);
    REQUIRE(it.names.enroll(request, it.now).grants.at(0).what == verdict::granted);
    ise::naming::ended_request ended;
    ended.launch_mark = request.node.launch_mark;
    REQUIRE(it.names.end(ended, it.now)->nodes == 1);
    CHECK(it.names.lost({}, it.now).names.empty());
}

TEST_CASE("registry: a server that has just restarted says that it may not know every member") {
    world it(options(2s));
    auto request = it.of(1);
    ise::naming::component_claim returning;
    returning.path = "n1";
    returning.incarnation = 10;
    returning.epoch = it.names.last_epoch() - 5; // of the server before
    returning.roles["gateway"] = 1;
    request.components.push_back(returning);
    REQUIRE(it.names.enroll(request, it.now).grants.at(0).what == verdict::granted);
    CHECK_FALSE(it.names.resolve("gateway", it.now).value().certain);
    it.pass(1s);
    it.renew(1);
    it.pass(1s);
    CHECK(it.names.resolve("gateway", it.now).value().certain);
}

TEST_CASE("registry: roles beyond a limit, or that are no paths, are refused") {
    auto few = options();
    few.limits.max_roles_per_component = 2;
    few.limits.max_members_per_role = 2;
    world it(few);
    auto claim_of = [&](std::vector<std::string> roles) {
        auto request = it.of(9);
        ise::naming::component_claim wanted;
        wanted.path = "nine";
        for (const auto& role : roles) wanted.roles[role] = 1;
        request.components.push_back(wanted);
        return it.names.enroll(request, it.now).grants.at(0);
    };
    CHECK(claim_of({"a", "b", "c"}).reason.find("max_roles_per_component") != std::string::npos);
    CHECK(claim_of({"/a"}).what == verdict::refused);
    CHECK(claim_of({"nine"}).what == verdict::refused);
    it.serve(1, "a", 1);
    it.serve(2, "a", 1);
    CHECK(it.serve(3, "a", 1).reason.find("max_members_per_role") != std::string::npos);
    CHECK(it.serve(2, "a", 7).what == verdict::granted); // a member already
}

} // namespace registry_test
