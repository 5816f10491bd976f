// Charges of the boat's mobile contract, and its behaviour when the budget is spent.
#include "quay.hpp"

#include <ise/database/database.hpp>

#include <support/catch.hpp>

namespace budget_test {

using namespace std::chrono_literals;
using namespace atirma;
using gprs_test::quay;

namespace {

/// A proxy with a disk that outlives it.
struct paid_quay : quay {
    explicit paid_quay(const std::string& protocol = "tcp", std::uint32_t fixes = 5) : quay(protocol, fixes) {
        static int number = 0;
        options.database = "memory:paid" + std::to_string(++number);
        disk.emplace(ise::database::open(options.database, {}).value());
        world.wall_start += 14h; // 22:00
    }
    std::optional<ise::database> disk;

    telecommand_reply tell(std::uint32_t id, boat_command what) {
        std::optional<ise::result<telecommand_reply>> answer;
        user([&answer, id, what](ise::component& self) -> ise::task<> {
            auto shore = at_proxy(self);
            telecommand_request request;
            request.id = id;
            request.command = what;
            answer = co_await shore.try_call(services::telecommand, request, 20s);
        });
        REQUIRE(until([&] { return answer.has_value(); }));
        if (*answer) return **answer;
        telecommand_reply refused;
        refused.state = telecommand_stage::failed;
        refused.text = answer->error().message();
        return refused;
    }
};

} // namespace

TEST_CASE("gprs budget: both ways are counted with their headers, by day and month, and over a kill of the proxy") {
    for (const auto* protocol : {"tcp", "udp"}) {
        INFO(protocol);
        paid_quay it(protocol);
        it.options.daily_budget = 1'000'000;
        it.options.monthly_budget = 20'000'000;
        it.start();
        REQUIRE(it.until([&] { return it.complete(); }));
        it.world.run_for(30s);
        REQUIRE(it.seen.state);
        auto before = *it.seen.state;
        CHECK(before.today.from_boat_bytes > 5 * 100); // five packets in base64, and what is around them
        CHECK(before.today.from_boat_bytes < 5 * 1000);
        CHECK(before.today.to_boat_bytes > 5 * 28);
        CHECK(before.today.bytes() == before.this_month.bytes());
        CHECK(before.budget.daily == 1'000'000u);
        CHECK(*before.budget.daily_left == 1'000'000 - before.today.bytes());
        CHECK(*before.budget.monthly_left == 20'000'000 - before.this_month.bytes());
        CHECK(before.budget_notice.empty());
        it.proxy->crash();
        it.seen.state.reset();
        it.world.run_for(2s);
        it.proxy->restart();
        REQUIRE(it.until([&] { return it.seen.state && it.seen.state->connected; }));
        CHECK(it.seen.state->today.bytes() >= before.today.bytes());
        CHECK(it.seen.state->day == before.day);
        it.world.run_for(2h + 1min); // past midnight
        CHECK(it.seen.state->day > before.day);
        CHECK(it.seen.state->today.bytes() < it.seen.state->this_month.bytes());
    }
}

TEST_CASE(
    "gprs budget: when it is spent only what saves the boat or bytes is sent, telemetry goes on, until midnight") {
    paid_quay it("tcp", 500);
    it.options.daily_budget = 4000;
    it.start();
    REQUIRE(it.until([&] { return it.seen.state && !it.seen.state->budget_notice.empty(); }));
    CHECK(it.seen.state->budget.daily_left == 0u);
    CHECK(it.seen.state->budget_notice.starts_with("today's budget is spent: it goes on at 00:00 UTC"));
    auto packets = it.seen.telemetry.size();
    auto no = it.tell(1, commands::ping());
    CHECK(no.state == telecommand_stage::failed);
    CHECK(no.text.ends_with("GPRS: today's budget is spent: it goes on at 00:00 UTC; send it over another link, or "
                            "raise the budget"));
    CHECK(it.tell(2, commands::tack_now()).state == telecommand_stage::failed);
    CHECK(it.tell(3, commands::set_mode{sailing_mode::return_home}).state == telecommand_stage::acknowledged);
    CHECK(it.tell(4, commands::emergency_beacon{true}).state == telecommand_stage::acknowledged);
    CHECK(it.tell(5, commands::set_telemetry_period{link_id::gprs, 600}).state == telecommand_stage::acknowledged);
    CHECK(it.tell(6, commands::set_telemetry_period{link_id::xbee, 600}).state == telecommand_stage::failed);
    it.world.run_for(1min);
    CHECK(it.seen.telemetry.size() > packets); // an unacknowledged boat would only send more
    REQUIRE(it.until([&] { return it.seen.state->budget_notice.empty(); }, 3h));
    CHECK(it.tell(7, commands::ping()).state == telecommand_stage::acknowledged);
}

TEST_CASE("gprs budget: the month's outlasts the day's, and without a file there is none") {
    paid_quay it("udp", 500);
    it.options.monthly_budget = 3000;
    it.start();
    REQUIRE(it.until([&] { return it.seen.state && !it.seen.state->budget_notice.empty(); }));
    CHECK(it.seen.state->budget_notice.find("this month's budget is spent") == 0);
    it.world.run_for(3h); // past midnight
    CHECK_FALSE(it.seen.state->budget_notice.empty());
    CHECK(it.tell(1, commands::ping()).state == telecommand_stage::failed);

    quay without;
    without.options.daily_budget = 5;
    without.start_proxy();
    without.world.run_for(5s);
    CHECK(without.warned("--daily-budget and --monthly-budget need --database FILE"));
}

} // namespace budget_test
