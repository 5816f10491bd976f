#include "examples.hpp"

#include <ise/packet/reflect.hpp>
#include <support/catch.hpp>

#include <list>
#include <map>
#include <set>
#include <unordered_map>
#include <unordered_set>

namespace reflect_test {

namespace {
struct no_default {
    explicit(false) no_default(int start) : value(start) {}
    int value;
};
struct awkward {
    char name[16];
    no_default must = 3;
    int grid[2][3];
    example::waypoint both[2];
    std::vector<int> list;
};
struct needs_all {
    int first;
    no_default second;
    char text[5];
    no_default third;
};
struct derived : example::position {};
struct single {
    int only[1];
};
} // namespace

TEST_CASE("a struct tells the number, the names and the types of its fields") {
    STATIC_REQUIRE(ise::field_count<example::position> == 6);
    CHECK(ise::field_names<example::position>[0] == "latitude_deg");
    CHECK(ise::field_names<example::position>[5] == "battery_mv");
    STATIC_REQUIRE(std::is_same_v<ise::field_type<example::position, 2>, float>);
    STATIC_REQUIRE(ise::field_count<example::empty> == 0);
    CHECK(ise::type_name<example::position> == "position");
    CHECK(ise::type_name<std::vector<example::position>> == "vector");
}

TEST_CASE("C arrays, nested structs and members without default are one field each") {
    STATIC_REQUIRE(ise::field_count<awkward> == 5);
    CHECK(ise::field_names<awkward>[3] == "both");
    STATIC_REQUIRE(std::is_same_v<ise::field_type<awkward, 2>, int[2][3]>);
    STATIC_REQUIRE(ise::field_count<needs_all> == 4);
    CHECK(ise::field_names<needs_all>[3] == "third");
    STATIC_REQUIRE(ise::field_count<single> == 1);
    STATIC_REQUIRE(ise::field_count<example::everything> == 25);
}

TEST_CASE("a struct that only adds a name to its base has the base's fields") {
    STATIC_REQUIRE(ise::field_count<derived> == 6);
    CHECK(ise::field_names<derived>[2] == "speed_kn");
}

TEST_CASE("for_each_field hands out names and fields that can be changed") {
    example::waypoint w{"a", 1, 2};
    std::string names;
    ise::for_each_field(w, [&](std::string_view name, auto& field) {
        names += std::string(name) + ' ';
        if constexpr (std::is_same_v<std::remove_cvref_t<decltype(field)>, double>) field += 1;
    });
    CHECK(names == "name latitude_deg longitude_deg ");
    CHECK(w.latitude_deg == 2);
}

namespace {
enum class flags : std::uint32_t { a = 1, high = 1u << 20, top = 1u << 31 };
enum class letters : char { comma = ',', quote = '\'', minus = '-' }; // char has no sign on ARM
enum class far : std::int16_t { one = 1000, two };
} // namespace
} // namespace reflect_test

template <>
struct ise::enum_range<reflect_test::far> {
    static constexpr int min = 990;
    static constexpr int max = 1010;
};

namespace reflect_test {

TEST_CASE("enumerators are found by name and value, flags and a chosen range included") {
    using list = std::vector<ise::enumerator>;
    CHECK(ise::enumerators<example::mode>() == list{{"idle", 0}, {"autopilot", 1}, {"manual", 7}});
    CHECK(ise::enumerators<flags>() == list{{"a", 1}, {"high", 1 << 20}, {"top", std::int64_t{1} << 31}});
    CHECK(ise::enumerators<letters>() == list{{"quote", '\''}, {"comma", ','}, {"minus", '-'}});
    CHECK(ise::enumerators<far>() == list{{"one", 1000}, {"two", 1001}});
}

namespace {
struct named_like_it {
    int serialize = 0;
    bool save = false;
};
} // namespace

TEST_CASE("maps and sets of unique keys are packets by what they have, others are not") {
    STATIC_REQUIRE(ise::packet<std::set<int>>);
    STATIC_REQUIRE(ise::packet<std::map<std::string, example::position>>);
    STATIC_REQUIRE(ise::packet<std::unordered_set<std::string>>);
    STATIC_REQUIRE(ise::packet<std::unordered_map<int, std::set<char>>>);
    STATIC_REQUIRE(ise::packet<named_like_it>);
    STATIC_REQUIRE_FALSE(ise::packet<std::multiset<int>>);
    STATIC_REQUIRE_FALSE(ise::packet<std::multimap<int, int>>);
    STATIC_REQUIRE_FALSE(ise::packet<std::unordered_multiset<int>>);
    STATIC_REQUIRE_FALSE(ise::packet<std::list<int>>);
}

} // namespace reflect_test
