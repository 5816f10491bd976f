#include <ise/core/time_text.hpp>

#include <support/catch.hpp>

using namespace std::chrono_literals;

TEST_CASE("times are written as ISO 8601 has them, with as many decimals as wanted, and never rounded up") {
    constexpr std::chrono::sys_days day = 2026y / 11 / 21;
    CHECK(ise::iso_8601(day) == "2026-11-21T00:00:00Z");
    CHECK(ise::iso_8601(day + 17h + 30min + 5s + 250ms) == "2026-11-21T17:30:05Z");
    CHECK(ise::iso_8601(day + 23h + 59min + 59s + 999'999us, 3) == "2026-11-21T23:59:59.999Z");
    CHECK(ise::iso_8601(day + 7us, 6) == "2026-11-21T00:00:00.000007Z");
    CHECK(ise::iso_8601(day + 7ns, 9) == "2026-11-21T00:00:00.000000007Z");
    // Before 1970 a fraction still counts forwards.
    CHECK(ise::iso_8601(std::chrono::sys_time<std::chrono::milliseconds>(-1ms), 3) == "1969-12-31T23:59:59.999Z");
    CHECK(ise::iso_8601(std::chrono::sys_days(9999y / 12 / 31), 1) == "9999-12-31T00:00:00.0Z");
}

TEST_CASE("durations are read with a unit, and seconds without one") {
    auto read = [](std::string_view text) { return ise::parse_duration(text).value(); };
    CHECK(read("5s") == 5s);
    CHECK(read("250ms") == 250ms);
    CHECK(read("20us") == 20us);
    CHECK(read("1.5m") == 90s);
    CHECK(read("2min") == 2min);
    CHECK(read("2h") == 2h);
    CHECK(read("3") == 3s);
    CHECK(read("0") == 0s);
    for (auto wrong : {"", "s", "-1s", "5 s", "5x", "1e300h", "nan", "inf", "5s ", "0x"})
        CHECK_THAT(ise::parse_duration(wrong).error().message(),
                   ise_test::Contains(std::string("'") + wrong + "' is not a duration: write 5s"));
    CHECK_THAT(ise::parse_duration("5\x1b").error().message(), ise_test::StartsWith("'5 ' is not a duration"));
}
