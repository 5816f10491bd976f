#include "examples.hpp"

#include <ise/packet/adapt.hpp>
#include <ise/packet/compatibility.hpp>
#include <support/catch.hpp>

namespace evolution_test {

using example::failure_of;
using ise_test::Contains;

namespace {
enum class gear1 : std::uint8_t { low, high };
enum class gear2 : std::uint8_t { low, high, reverse };
enum class gear_other : std::uint8_t { low, fast };

struct leg1 {
    std::string to;
    bool operator==(const leg1&) const = default;
};
struct leg2 {
    std::string to;
    double speed_kn = 3.5;
    std::vector<std::string> notes{"none"};
    bool operator==(const leg2&) const = default;
};
struct plan1 {
    std::vector<leg1> legs;
    std::optional<leg1> next;
    std::variant<leg1, int> choice;
    std::map<std::string, leg1> named;
    leg1 pair[2];
    gear1 gear{};
    std::int32_t last = 0;
};
struct plan2 {
    std::vector<leg2> legs;
    std::optional<leg2> next;
    std::variant<leg2, int, std::string> choice;
    std::map<std::string, leg2> named;
    leg2 pair[2];
    gear2 gear{};
    std::int32_t last = 0;
    std::uint16_t added = 77;
};

template <class Reader, class Writer>
std::string diff() {
    return ise::incompatibility(ise::schema_of<Reader>(), ise::schema_of<Writer>()).value_or("compatible");
}
template <class Reader, class Writer>
Reader read_as(const Writer& written) {
    return ise::decode<Reader>(ise::adapt(ise::schema_of<Writer>(), ise::schema_of<Reader>(), ise::encode(written)));
}
} // namespace

TEST_CASE("a newer reader fills what an older writer lacks, also inside containers") {
    plan1 old;
    old.legs = {{"a"}, {"b"}};
    old.next = leg1{"n"};
    old.choice = leg1{"c"};
    old.named = {{"k", {"v"}}};
    old.pair[1].to = "p";
    old.gear = gear1::high;
    old.last = 5;
    auto got = read_as<plan2>(old);
    CHECK(got.legs == std::vector<leg2>{{"a"}, {"b"}});
    CHECK(got.next == leg2{"n"});
    CHECK(std::get<0>(got.choice) == leg2{"c"});
    CHECK(got.named.at("k") == leg2{"v"});
    CHECK(got.pair[1] == leg2{"p"});
    CHECK(got.gear == gear2::high);
    CHECK(got.last == 5);
    CHECK(got.added == 77);
}

TEST_CASE("an older reader skips what a newer writer adds, also inside containers") {
    plan2 fresh;
    fresh.legs = {{"a", 1, {"x", "y"}}, {"b", 2, {}}};
    fresh.next = leg2{"n", 9, {"z"}};
    fresh.choice = 4;
    fresh.gear = gear2::reverse;
    fresh.last = 6;
    auto got = read_as<plan1>(fresh);
    CHECK(got.legs == std::vector<leg1>{{"a"}, {"b"}});
    CHECK(got.next == leg1{"n"});
    CHECK(std::get<1>(got.choice) == 4);
    CHECK(got.gear == static_cast<gear1>(2)); // an unknown enumerator stays a number
    CHECK(got.last == 6);
}

TEST_CASE("an unknown alternative is an error that names the field") {
    plan2 fresh;
    fresh.choice = "new";
    auto why = failure_of([&] { read_as<plan1>(fresh); });
    CHECK(why.code() == ise::errc::malformed);
    CHECK(why.message() == "plan2.choice: holds alternative 2, only 0 to 1 are known");
}

TEST_CASE("equal layouts need no adapting, but the bytes are checked all the same") {
    ise::adapter same(ise::schema_of<example::everything>(), ise::schema_of<example::everything>());
    CHECK(same.is_identity());
    ise::bytes whole = ise::encode(example::filled());
    CHECK(same(whole) == whole);
    for (std::size_t size = 0; size < whole.size(); ++size)
        CHECK_THROWS_AS(same(ise::bytes_view(whole).first(size)), ise::error);
}

TEST_CASE("truncated and flipped bytes of an older writer are refused or read, nothing else") {
    plan1 old;
    old.legs = {{"a"}, {"bcd"}};
    old.next = leg1{"n"};
    ise::adapter to(ise::schema_of<plan1>(), ise::schema_of<plan2>());
    ise::bytes whole = ise::encode(old);
    for (std::size_t size = 0; size < whole.size(); ++size) {
        ise::bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
        CHECK_THROWS_AS(to(cut), ise::error);
    }
    for (std::size_t bit = 0; bit < whole.size() * 8; ++bit) {
        ise::bytes flipped = whole;
        flipped[bit / 8] ^= static_cast<std::byte>(1u << bit % 8);
        ise::bytes turned;
        try {
            turned = to(flipped);
        } catch (const ise::error& why) {
            REQUIRE(why.code() == ise::errc::malformed);
            continue;
        }
        REQUIRE(ise::try_decode<plan2>(turned).has_value());
    }
}

namespace {
struct reading {
    double latitude_deg = 0;
    std::vector<leg1> legs;
    gear1 gear{};
};
struct reading_f32 {
    float latitude_deg = 0;
    std::vector<leg1> legs;
    gear_other gear{};
};
struct inserted {
    double latitude_deg = 0;
    int number = 0;
    std::vector<leg1> legs;
    gear1 gear{};
};
struct leg_renamed {
    std::string destination;
};
struct renamed_inside {
    double latitude_deg = 0;
    std::vector<leg_renamed> legs;
    gear1 gear{};
};
struct swapped {
    std::vector<leg1> legs;
    double latitude_deg = 0;
    gear1 gear{};
};
} // namespace

TEST_CASE("what is incompatible is told as a diff with paths and both types") {
    CHECK(diff<reading, reading_f32>() == "the reader's reading and the writer's reading_f32 differ:\n"
                                          "  latitude_deg: reader f64, writer f32\n"
                                          "  gear: reader high=1, writer fast=1");
    CHECK_THAT((diff<reading, inserted>()),
               Contains("packet: reader has 'legs' as field 2, writer has 'number' (inserted at the writer"));
    CHECK_THAT((diff<reading, renamed_inside>()),
               Contains("legs[]: reader has 'to' as field 1, writer has 'destination' (renamed?"));
    CHECK_THAT((diff<reading, swapped>()), Contains("fields keep their order"));
    CHECK_THAT((diff<std::array<int, 2>, std::array<int, 3>>()), Contains("array<i32,2>, writer array<i32,3>"));
    CHECK_THAT((diff<std::optional<int>, int>()), Contains("reader optional<i32>, writer i32"));
    CHECK_THAT((diff<std::chrono::milliseconds, std::chrono::seconds>()), Contains("duration<i64,1/1000>"));
    CHECK(diff<plan1, plan2>() == "compatible");
    CHECK(diff<plan2, plan1>() == "compatible");
    CHECK(failure_of([] { read_as<reading>(reading_f32{}); }).code() == ise::errc::type_mismatch);
}

TEST_CASE("defaults cannot be made to grow without end by a hostile schema") {
    auto big = ise::schema::parse("struct{l:vector<struct{b:array<u8,200000000>}>}");
    auto small = ise::schema::parse("struct{l:vector<struct{}>}");
    REQUIRE(big.has_value());
    REQUIRE(small.has_value());
    ise::buffer out;
    out.append(std::uint32_t{1000});
    auto grown = failure_of([&] { ise::adapt(*small, *big, out.view()); });
    CHECK(grown.code() == ise::errc::too_large);
    CHECK_THAT(grown.message(), Contains("by its default values (max_total_bytes)"));
}

} // namespace evolution_test
