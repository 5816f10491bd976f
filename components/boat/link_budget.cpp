#include <components/boat/link_budget.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma {
namespace {

std::chrono::year_month_day date_of(utc_time at) { return {std::chrono::floor<std::chrono::days>(at)}; }

std::string limit_text(std::string_view whose, std::uint64_t left, const std::string& when) {
    auto state = left == 0 ? std::string("is spent") : fmt::format("has {} left, which is too little", left);
    return fmt::format("{} budget {}: it goes on at {}", whose, state, when);
}

bool is_low(const std::optional<std::uint64_t>& limit, const std::optional<std::uint64_t>& left) noexcept {
    return limit && left.value_or(0) <= *limit / 10;
}

} // namespace

link_budget budget_after(std::uint64_t daily, std::uint64_t spent_today, std::uint64_t monthly,
                         std::uint64_t spent_this_month) noexcept {
    link_budget made;
    if (daily > 0) {
        made.daily = daily;
        made.daily_left = daily - std::min(daily, spent_today);
    }
    if (monthly > 0) {
        made.monthly = monthly;
        made.monthly_left = monthly - std::min(monthly, spent_this_month);
    }
    return made;
}

std::optional<budget_end> end_of_budget(const link_budget& of, std::uint64_t needed, utc_time now) {
    budget_end made;
    if (of.monthly && of.monthly_left.value_or(0) < needed) { // the later end
        auto today = date_of(now);
        auto next = today.year() / today.month() / 1 + std::chrono::months(1);
        made.month = true;
        made.until = std::chrono::sys_days(next);
        made.text = limit_text("this month's", of.monthly_left.value_or(0), day_text(made.until) + " 00:00 UTC");
        return made;
    }
    if (!of.daily || of.daily_left.value_or(0) >= needed) return std::nullopt;
    made.until = std::chrono::floor<std::chrono::days>(now) + std::chrono::days(1);
    made.text = limit_text("today's", of.daily_left.value_or(0), "00:00 UTC");
    return made;
}

bool is_low(const link_budget& of) noexcept {
    return is_low(of.daily, of.daily_left) || is_low(of.monthly, of.monthly_left);
}

std::string month_text(utc_time at) {
    auto date = date_of(at);
    return fmt::format("{:04}-{:02}", static_cast<int>(date.year()), static_cast<unsigned>(date.month()));
}

std::string day_text(utc_time at) {
    return fmt::format("{}-{:02}", month_text(at), static_cast<unsigned>(date_of(at).day()));
}

} // namespace atirma
