// Whoever can connect can claim what he likes: the others' names go on.
#include "system.hpp"

#include <ise/name_server/secret_hash.hpp>

#include <algorithm>

namespace strangers_test {

using namespace names_test;

namespace {

// A stranger's claim, of a node that nobody else knows.
ise::naming::register_request claim_of(std::string path, std::uint64_t epoch = 0) {
    ise::naming::register_request request;
    request.node.lease_key = 99;
    request.lease = 2s;
    ise::naming::component_claim claim;
    claim.path = std::move(path);
    claim.epoch = epoch;
    request.components.push_back(std::move(claim));
    return request;
}

// A component that loses its lease while others come, and what became of it.
struct returning {
    explicit returning(ise::registry_limits limits = ise::registry_limits()) : it(true, 1, limits) {
        it.start("boat", "boat", [this](ise::node& node) {
            boat = &node;
            doubles = &node.start<doubler>("atirma/doubler", everywhere());
        });
        REQUIRE(it.world.run_until([&] { return doubles->name_confirmed(); }, 5s));
    }
    void lose_lease() {
        it.world.net().partition("boat", "ns");
        REQUIRE(it.world.run_until([&] { return !it.holds("atirma/doubler"); }, 10s));
    }
    void come_back() { it.world.net().heal("boat", "ns"); }

    names_test::system it;
    ise::node* boat = nullptr;
    ise::component* doubles = nullptr;
};

} // namespace

TEST_CASE("strangers: an epoch that nobody was granted costs no component its name") {
    auto shown = GENERATE((std::uint64_t{1} << 62) - 1, (std::uint64_t{1} << 62), std::uint64_t{1} << 60);
    CAPTURE(shown);
    returning at;
    auto& it = at.it;
    bool claimed = false;
    ise::node* late = nullptr;
    it.start_body("elsewhere", "stranger", [&](ise::component& self) -> ise::task<> {
        auto request = claim_of("x", shown);
        auto server = name_server_of(self);
        auto answer = co_await server.try_call(ise::naming::enroll, request, 1s);
        claimed = answer.has_value();
    });
    REQUIRE(it.world.run_until([&] { return claimed; }, 5s));
    ise::component* busy = nullptr;
    it.start("shore", "shore", [&](ise::node& node) {
        late = &node;
        busy = &node.start<doubler>("atirma/late", everywhere());
    });
    REQUIRE(it.world.run_until([&] { return it.holds("atirma/late"); }, 5s));
    auto epoch = it.epoch_of("atirma/late");
    busy->require(twice); // which it tells
    it.world.run_for(3s);
    CHECK_FALSE(late->all_stopped());
    CHECK(it.epoch_of("atirma/late") == epoch);

    it.world.net().partition("shore", "ns");
    at.lose_lease();
    it.world.run_for(3s);
    it.world.net().heal("shore", "ns");
    at.come_back();
    CHECK(it.world.run_until([&] { return it.holds("atirma/late") && it.holds("atirma/doubler"); }, 5s));
    it.restart_server();
    CHECK(it.world.run_until([&] { return it.holds("atirma/late") && it.holds("atirma/doubler"); }, 5s));
    it.world.run_for(3s);
    CHECK(it.epoch_of("atirma/late") == epoch);
    CHECK_FALSE(late->all_stopped());
    CHECK_FALSE(at.boat->all_stopped());
}

TEST_CASE(
    "strangers: who comes back to a name server without room goes on trying, and gets its name when there is room") {
    ise::registry_limits limits;
    SECTION("for components") { limits.max_components = 2; }
    SECTION("for nodes") { limits.max_nodes = 2; }
    returning at(limits);
    auto& it = at.it;
    auto epoch = it.epoch_of("atirma/doubler");
    at.lose_lease();
    it.start_doubler("one", "other/one");
    auto& leaves = it.start_doubler("two", "other/two");
    REQUIRE(it.world.run_until([&] { return it.holds("other/one") && it.holds("other/two"); }, 5s));
    at.come_back();
    it.world.run_for(20s);
    CHECK_FALSE(at.boat->all_stopped());
    CHECK_FALSE(it.holds("atirma/doubler"));
    CHECK_FALSE(at.doubles->name_confirmed()); // another may be granted it

    leaves.stop();
    REQUIRE(it.world.run_until([&] { return it.holds("atirma/doubler"); }, 5s));
    CHECK(it.epoch_of("atirma/doubler") == epoch);
    it.world.run_for(10s);
    CHECK(it.holds("atirma/doubler"));
    CHECK(at.doubles->name_confirmed());
}

TEST_CASE("strangers: a component that starts while there is no room is registered when there is some") {
    ise::registry_limits limits;
    limits.max_components = 1;
    names_test::system it(true, 1, limits);
    auto& first = it.start_doubler("one", "other/one");
    REQUIRE(it.world.run_until([&] { return it.holds("other/one"); }, 5s));
    it.start_doubler("boat", "atirma/doubler");
    it.world.run_for(20s);
    CHECK_FALSE(it.holds("atirma/doubler"));
    first.stop();
    CHECK(it.world.run_until([&] { return it.holds("atirma/doubler"); }, 5s));
}

TEST_CASE("strangers: a path that no component can have is neither waited for nor repeated in an answer") {
    names_test::system it;
    it.start_doubler("boat", "atirma/doubler");
    REQUIRE(it.world.run_until([&] { return it.holds("atirma/doubler"); }, 5s));
    std::vector<ise::failure> answers;
    ise::duration took{};
    it.start_body("stranger", "stranger", [&](ise::component& self) -> ise::task<> {
        auto server = name_server_of(self);
        const std::string path(std::size_t{8} << 20, 'a');
        ise::naming::await_request wait;
        ise::naming::resolve_request find;
        ise::naming::describe_request about;
        wait.path = find.path = about.path = path;
        wait.wait = 10s;
        const auto began = self.now();
        auto waited = co_await server.try_call(ise::naming::wait_for, wait, 20s);
        auto found = co_await server.try_call(ise::naming::resolve, find, 20s);
        auto described = co_await server.try_call(ise::naming::describe, about, 20s);
        took = self.now() - began;
        if (!waited) answers.push_back(waited.error());
        if (!found) answers.push_back(found.error());
        if (!described) answers.push_back(described.error());
    });
    it.world.run_for(60s);
    REQUIRE(answers.size() == 3);
    for (const auto& one : answers) {
        CHECK(one.code() == (&one == &answers.front() ? ise::errc::refused : ise::errc::too_large));
        CHECK(one.message().find("a path of 8388608 bytes, max_path_bytes is 200") != std::string::npos);
        CHECK(one.message().size() < 500);
    }
    CHECK(took < 10s);
}

TEST_CASE("strangers: numbers that are chosen to collide are spread over the name server's tables") {
    constexpr std::size_t count = 1 << 15;
    const auto longest = [](auto table) {
        for (std::uint64_t number = 0; number < count; ++number) table.emplace(number, 0);
        std::unordered_map<std::uint64_t, int, typename decltype(table)::hasher> chosen(0, table.hash_function());
        for (std::uint64_t number = 0; number < count; ++number) chosen.emplace(number * table.bucket_count(), 0);
        std::size_t found = 0;
        for (std::size_t at = 0; at < chosen.bucket_count(); ++at) found = std::max(found, chosen.bucket_size(at));
        return found;
    };
    CHECK(longest(std::unordered_map<std::uint64_t, int>()) == count); // in the table of the library all meet
    CHECK(longest(ise::by_number<int>(0, ise::secret_hash({1, 2}))) < 32);
}

} // namespace strangers_test
