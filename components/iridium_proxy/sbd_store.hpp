#pragma once
#include <components/boat/link_budget.hpp>
#include <components/boat/telecommand_tracker.hpp>
#include <components/iridium/message.hpp>
#include <components/iridium_proxy/queue_clock.hpp>
#include <components/iridium_proxy/services.hpp>
#include <components/spending/spending_book.hpp>

namespace atirma {

/// What of Iridium survives the proxy: each message of the boat, the telecommands, and what was spent. Errors of all:
/// io_failed; malformed where the file is damaged.
class sbd_store {
public:
    /// Of a damaged file, what can still be read is kept.
    static ise::result<sbd_store> open(const std::string& file, ise::when_damaged how = ise::when_damaged());

    /// Keeps a message before its sender is told that it was taken; true if it is new. It is counted as spent, too.
    ise::result<bool> add(const iridium::mo_message& message, std::string_view path, utc_time now,
                          std::uint64_t credits);
    struct kept_message {
        std::int64_t row = 0;
        iridium::mo_message message;
        utc_time received_at{};
    };
    /// Messages that were not handed on yet, oldest first, of the rows after that one.
    ise::result<std::vector<kept_message>> unpublished(std::size_t most, std::int64_t after = 0);
    ise::result<std::uint64_t> count_unpublished();
    ise::result<void> published(std::int64_t row);

    ise::result<std::vector<tracked_telecommand>> load();
    ise::result<void> save(const tracked_telecommand& entry);
    /// A new one where it was never kept.
    ise::result<queue_clock> clock();
    ise::result<void> keep(const queue_clock& clock);
    /// An attempt is about to be made: the entry as it is now, and what it will cost, at once.
    ise::result<void> begin_attempt(const tracked_telecommand& entry, utc_time now, std::size_t bytes,
                                    std::uint64_t credits);
    /// It certainly cost nothing.
    ise::result<void> refund(utc_time charged_at, std::size_t bytes, std::uint64_t credits);

    ise::result<iridium_spending> spent_on(utc_time day);
    ise::result<iridium_spending> spent_in_month_of(utc_time day);
    ise::result<iridium_spending> spent_ever();

    /// Forgets what was handed on or decided before then; spending stays.
    ise::result<void> forget_before(utc_time then);

private:
    explicit sbd_store(ise::database db) : db_(std::move(db)) {}
    ise::result<void> charge(utc_time at, bool to_boat, std::int64_t messages, std::int64_t bytes,
                             std::int64_t credits);
    ise::result<iridium_spending> spent(const std::string& days);

    ise::database db_;
};

} // namespace atirma
