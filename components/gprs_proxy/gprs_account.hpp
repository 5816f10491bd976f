#pragma once
#include <components/boat/link_budget.hpp>
#include <components/gprs_proxy/services.hpp>
#include <components/spending/spending_book.hpp>

#include <cstddef>
#include <string>

namespace atirma {

/// Charges of the boat's mobile contract, by day and month of UTC, in a file that survives the proxy. Charged
/// are the bytes of what passes and an estimate of what is around it: headers of IP, TCP and UDP, acknowledgements of
/// TCP, and the packets that open and close a connection. Without I/O but for `open` and `keep`.
class gprs_account {
public:
    static constexpr std::size_t connection_bytes = 280; ///< seven packets of TCP without content
    static constexpr std::size_t segment_bytes = 80;  ///< two headers of IP and TCP: content, and its acknowledgement
    static constexpr std::size_t datagram_bytes = 28; ///< headers of IP and UDP

    /// Limits in bytes; 0: unlimited. `file` as that of `database`. Errors: io_failed, malformed.
    static ise::result<gprs_account> open(const std::string& file, std::uint64_t daily, std::uint64_t monthly,
                                          utc_time now, ise::when_damaged how = ise::when_damaged());

    void connected() { waiting_.from_boat.credits += connection_bytes; }
    void count(bool to_boat, std::size_t bytes, bool datagram);
    /// Writes what was counted since the last call. Nothing is lost where that fails: it is written with the next call.
    ise::result<void> keep(utc_time now);

    gprs_spending today() const { return of(today_); }
    gprs_spending this_month() const { return of(month_); }
    link_budget budget() const;

private:
    gprs_account(ise::database file, std::uint64_t daily, std::uint64_t monthly)
        : file_(std::move(file)), daily_(daily), monthly_(monthly) {}
    gprs_spending of(const spending_book::sums& kept) const;
    ise::result<void> read(utc_time now);

    ise::database file_;
    std::uint64_t daily_, monthly_;
    spending_book::sums today_, month_, waiting_; ///< kept, and not yet
};

} // namespace atirma
