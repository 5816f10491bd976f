#pragma once
#include <ise/database/database.hpp>

namespace atirma {

/// What a link has carried and cost, by day and direction, in the table `spending` of its database. A day is
/// "2026-11-21". Errors of all: io_failed; malformed where the file is damaged. The database outlives it.
class spending_book {
public:
    /// Belongs into the schema of that database.
    static constexpr std::string_view table =
        "CREATE TABLE spending(day TEXT NOT NULL, to_boat INTEGER NOT NULL, messages INTEGER NOT NULL, bytes INTEGER "
        "NOT NULL, credits INTEGER NOT NULL,"
        " PRIMARY KEY(day, to_boat))";

    struct traffic {
        std::int64_t messages = 0;
        std::int64_t bytes = 0;
        std::int64_t credits = 0; ///< what is paid for
        bool empty() const noexcept { return messages == 0 && bytes == 0 && credits == 0; }
    };
    struct sums {
        traffic from_boat, to_boat;
        std::int64_t credits() const noexcept { return from_boat.credits + to_boat.credits; }
    };

    explicit spending_book(ise::database& of) : db_(of) {}

    /// Adds to that day; negative: it certainly cost nothing.
    ise::result<void> charge(const std::string& day, bool to_boat, const traffic& what);
    /// Of the days that begin so: "2026-11-21" is a day, "2026-11" a month, "" all. Never negative.
    ise::result<sums> spent(const std::string& days);

private:
    ise::database& db_;
};

} // namespace atirma
