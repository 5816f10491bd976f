#pragma once
#include <components/boat/packet_header.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace atirma {

/// The budget of a link, in the unit that its operator charges (Iridium: credits; GPRS: bytes), and what is left. Days
/// and months are those of UTC. A missing value: unlimited.
struct link_budget {
    std::optional<std::uint64_t> daily;
    std::optional<std::uint64_t> daily_left;
    std::optional<std::uint64_t> monthly;
    std::optional<std::uint64_t> monthly_left;
    bool operator==(const link_budget&) const = default;
};

/// The budget after that spending. A limit of 0: unlimited.
link_budget budget_after(std::uint64_t daily, std::uint64_t spent_today, std::uint64_t monthly,
                         std::uint64_t spent_this_month) noexcept;

/// The limit that a spending exceeds.
struct budget_end {
    bool month = false; ///< this month's budget, else today's
    utc_time until{};   ///< 00:00 UTC of the next day or month
    std::string text;   ///< "today's budget is spent: it goes on at 00:00 UTC"
};
/// Nothing where `needed` is within the budget.
std::optional<budget_end> end_of_budget(const link_budget& of, std::uint64_t needed, utc_time now);

/// Whether at most a tenth of today's or this month's budget is left.
bool is_low(const link_budget& of) noexcept;

/// "2026-11-21" and "2026-11", UTC.
std::string day_text(utc_time at);
std::string month_text(utc_time at);

} // namespace atirma
