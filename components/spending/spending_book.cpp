#include <components/spending/spending_book.hpp>

#include <algorithm>

namespace atirma {

ise::result<void> spending_book::charge(const std::string& day, bool to_boat, const traffic& what) {
    auto done = db_.execute("INSERT INTO spending(day, to_boat, messages, bytes, credits) VALUES(?, ?, ?, ?, ?) ON "
                            "CONFLICT(day, to_boat) DO UPDATE"
                            " SET messages = messages + excluded.messages, bytes = bytes + excluded.bytes, credits = "
                            "credits + excluded.credits",
                            {day, std::int64_t{to_boat}, what.messages, what.bytes, what.credits});
    if (!done) return done.error();
    return {};
}

ise::result<spending_book::sums> spending_book::spent(const std::string& days) {
    auto rows = db_.query(
        "SELECT to_boat, sum(messages), sum(bytes), sum(credits) FROM spending WHERE day LIKE ? GROUP BY to_boat",
        {days + "%"});
    if (!rows) return rows.error();
    sums made;
    for (const auto& row : *rows) {
        auto& into = row.integer(0) != 0 ? made.to_boat : made.from_boat;
        into.messages = std::max<std::int64_t>(0, row.integer(1));
        into.bytes = std::max<std::int64_t>(0, row.integer(2));
        into.credits = std::max<std::int64_t>(0, row.integer(3));
    }
    return made;
}

} // namespace atirma
