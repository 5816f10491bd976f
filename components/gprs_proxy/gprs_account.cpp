#include <components/gprs_proxy/gprs_account.hpp>

#include <array>

namespace atirma {
namespace {
constexpr std::array<std::string_view, 1> account_schema{spending_book::table};
}

ise::result<gprs_account> gprs_account::open(const std::string& file, std::uint64_t daily, std::uint64_t monthly,
                                             utc_time now, ise::when_damaged how) {
    auto opened = ise::database::open(file, account_schema, ise::when_damaged::keeping_readable(std::move(how)));
    if (!opened) return opened.error();
    gprs_account made(std::move(*opened), daily, monthly);
    if (auto known = made.read(now); !known) return known.error();
    return made;
}

void gprs_account::count(bool to_boat, std::size_t bytes, bool datagram) {
    auto& into = to_boat ? waiting_.to_boat : waiting_.from_boat;
    ++into.messages;
    into.bytes += static_cast<std::int64_t>(bytes);
    into.credits += static_cast<std::int64_t>(bytes + (datagram ? datagram_bytes : segment_bytes));
}

ise::result<void> gprs_account::keep(utc_time now) {
    auto kept = file_.transaction([&]() -> ise::result<void> {
        spending_book book(file_);
        for (bool to_boat : {false, true}) {
            const auto& what = to_boat ? waiting_.to_boat : waiting_.from_boat;
            if (what.empty()) continue;
            if (auto charged = book.charge(day_text(now), to_boat, what); !charged) return charged;
        }
        return {};
    });
    if (!kept) return kept;
    waiting_ = {};
    return read(now);
}

ise::result<void> gprs_account::read(utc_time now) {
    spending_book book(file_);
    auto today = book.spent(day_text(now)), month = book.spent(month_text(now));
    if (!today) return today.error();
    if (!month) return month.error();
    today_ = *today;
    month_ = *month;
    return {};
}

gprs_spending gprs_account::of(const spending_book::sums& kept) const {
    gprs_spending made;
    made.from_boat_bytes = static_cast<std::uint64_t>(kept.from_boat.credits + waiting_.from_boat.credits);
    made.to_boat_bytes = static_cast<std::uint64_t>(kept.to_boat.credits + waiting_.to_boat.credits);
    return made;
}

link_budget gprs_account::budget() const {
    return budget_after(daily_, today().bytes(), monthly_, this_month().bytes());
}

} // namespace atirma
