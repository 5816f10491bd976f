#include <components/boat/link_budget.hpp>

#include <support/catch.hpp>

namespace link_budget_test {

using namespace std::chrono_literals;
using std::chrono::sys_days;
using namespace atirma;

TEST_CASE("link budget: what is left never falls below nothing, and a limit of 0 is none") {
    auto none = budget_after(0, 500, 0, 500);
    CHECK_FALSE(none.daily);
    CHECK_FALSE(none.monthly_left);
    CHECK_FALSE(end_of_budget(none, 1'000'000, utc_time(0ms)));
    CHECK_FALSE(is_low(none));
    auto over = budget_after(100, 500, 1000, 899);
    CHECK(over.daily_left == 0);
    CHECK(over.monthly_left == 101);
    CHECK(is_low(over));
    CHECK_FALSE(is_low(budget_after(100, 89, 1000, 899)));
    CHECK(is_low(budget_after(100, 0, 1000, 900)));
}

TEST_CASE("link budget: its end names the limit and when it goes on, over days, months and years of UTC") {
    const utc_time noon = sys_days(2026y / 12 / 31) + 12h;
    auto today = end_of_budget(budget_after(100, 100, 1000, 100), 1, noon);
    REQUIRE(today);
    CHECK_FALSE(today->month);
    CHECK(today->until == sys_days(2027y / 1 / 1));
    CHECK(today->text == "today's budget is spent: it goes on at 00:00 UTC");
    auto month = end_of_budget(budget_after(100, 100, 1000, 1000), 1, noon);
    REQUIRE(month);
    CHECK(month->month);
    CHECK(month->until == sys_days(2027y / 1 / 1));
    CHECK(month->text == "this month's budget is spent: it goes on at 2027-01-01 00:00 UTC");
    auto little = end_of_budget(budget_after(100, 97, 0, 0), 4, noon);
    REQUIRE(little);
    CHECK(little->text == "today's budget has 3 left, which is too little: it goes on at 00:00 UTC");
    CHECK_FALSE(end_of_budget(budget_after(100, 97, 0, 0), 3, noon));
    CHECK(end_of_budget(budget_after(0, 0, 5, 5), 1, sys_days(2026y / 1 / 31))->until == sys_days(2026y / 2 / 1));
    CHECK(day_text(noon) == "2026-12-31");
    CHECK(month_text(noon) == "2026-12");
}

} // namespace link_budget_test
