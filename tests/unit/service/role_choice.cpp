#include <ise/service/role_choice.hpp>

#include <support/catch.hpp>

namespace role_choice_test {

using namespace std::chrono_literals;

namespace {

constexpr ise::time_point start{1h};

ise::location member(std::string path, std::int32_t priority, bool ready = true, std::uint64_t incarnation = 1) {
    ise::location made;
    made.path = std::move(path);
    made.priority = priority;
    made.ready = ready;
    made.incarnation = incarnation;
    return made;
}

std::vector<std::string> order(const ise::role_choice& of) {
    std::vector<std::string> paths;
    for (const auto& one : of.candidates()) paths.push_back(one.path);
    return paths;
}

using list = std::vector<std::string>;

} // namespace

TEST_CASE("role choice: the one whose session broke is tried first, one in doubt last") {
    ise::role_choice of{ise::role_options()};
    of.know({member("a", 3), member("b", 2), member("c", 1)}, start);
    CHECK(order(of) == list{"a", "b", "c"});
    of.took(member("b", 2));
    of.lost(false);
    CHECK(order(of) == list{"b", "a", "c"});
    of.took(member("b", 2));
    of.lost(true);
    CHECK(order(of) == list{"a", "c", "b"});
    of.took(member("a", 3));
    of.lost(true);
    CHECK(order(of) == list{"b", "c", "a"});
}

TEST_CASE("role choice: one that is lost and not a member any more is not tried") {
    ise::role_choice of{ise::role_options()};
    of.know({member("a", 3), member("b", 2)}, start);
    of.took(member("a", 3));
    of.lost(false);
    of.know({member("b", 2)}, start + 1s);
    CHECK(order(of) == list{"b"});
}

TEST_CASE("role choice: a better member is one that was there for the steady time") {
    ise::role_choice of{ise::role_options::failback_after(5s)};
    of.know({member("b", 2)}, start);
    of.took(member("b", 2));
    CHECK_FALSE(of.better());
    of.know({member("a", 3), member("b", 2)}, start + 10s);
    REQUIRE(of.better());
    CHECK(of.better()->to.path == "a");
    CHECK(of.better()->at == start + 15s);

    SECTION("told again, it is no newer") {
        of.know({member("a", 3), member("b", 2)}, start + 12s);
        CHECK(of.better()->at == start + 15s);
    }
    SECTION("restarted, it is") {
        of.know({member("a", 3, true, 2), member("b", 2)}, start + 12s);
        CHECK(of.better()->at == start + 17s);
    }
    SECTION("not reached, it has to be there for the steady time again") {
        of.put_off("a", start + 15s);
        CHECK(of.better()->at == start + 20s);
    }
    SECTION("gone, it is none") {
        of.know({member("b", 2)}, start + 12s);
        CHECK_FALSE(of.better());
    }
    SECTION("stalled, it is none") {
        of.know({member("b", 2), member("a", 3, false)}, start + 12s);
        CHECK_FALSE(of.better());
    }
    SECTION("whoever is bound stays, unless the taken one has left") {
        CHECK_FALSE(of.better(true));
        of.know({member("a", 3)}, start + 12s);
        of.left(member("b", 2));
        REQUIRE(of.better(true));
        CHECK(of.better(true)->to.path == "a");
    }
    SECTION("nobody comes back without having somebody") {
        of.lost(false);
        CHECK_FALSE(of.better());
    }
}

TEST_CASE("role choice: a member of the same priority is no better, one that is ready is better than one that is not") {
    ise::role_choice of{ise::role_options()};
    of.know({member("a", 2), member("b", 2)}, start);
    of.took(member("b", 2));
    CHECK_FALSE(of.better());
    of.know({member("a", 2), member("b", 2, false)}, start + 1s);
    REQUIRE(of.better());
    CHECK(of.better()->to.path == "a");
}

TEST_CASE("role choice: one that is taken and not told of any more keeps its rank") {
    ise::role_choice of{ise::role_options()};
    of.know({member("a", 3), member("b", 2)}, start);
    of.took(member("a", 3));
    of.know({member("b", 2)}, start + 1s); // its lease is over, its session is not
    CHECK_FALSE(of.better());
}

TEST_CASE("role choice: told to stay, it stays") {
    ise::role_choice of{ise::role_options::no_failback()};
    of.know({member("a", 3), member("b", 2)}, start);
    of.took(member("b", 2));
    CHECK_FALSE(of.better());
}

TEST_CASE("role choice: one that has left the role is left at once, also by who stays") {
    ise::role_choice of{ise::role_options::no_failback()};
    of.know({member("a", 3), member("b", 2)}, start);
    of.took(member("a", 3));
    CHECK_FALSE(of.unlisted());
    of.know({member("b", 2)}, start + 1s);
    REQUIRE(of.unlisted());
    CHECK(of.unlisted()->path == "a");
    of.left(member("a", 3, true, 2)); // another life of it
    CHECK_FALSE(of.better());
    of.left(member("a", 3));
    REQUIRE(of.better());
    CHECK(of.better()->to.path == "b");
    CHECK(of.better()->at <= start);

    SECTION("it comes back") {
        of.know({member("a", 3), member("b", 2)}, start + 2s);
        CHECK_FALSE(of.better());
    }
    SECTION("the other is taken") {
        of.took(member("b", 2));
        CHECK_FALSE(of.better());
    }
}

} // namespace role_choice_test
