#pragma once
#include <components/boat/services.hpp>

#include <ise/core/time.hpp>

#include <deque>
#include <map>
#include <optional>

namespace atirma {

struct book_options {
    link_id link = link_id::xbee;
    std::size_t max_open = 64;                            ///< telecommands that are not decided; above: overloaded
    std::size_t max_remembered = 512;                     ///< decided ones that a repeated id still finds
    ise::duration answer_time = std::chrono::seconds(15); ///< until one that was delivered is sent again
    ise::duration min_pause = std::chrono::seconds(2);    ///< after one that was not delivered; doubles
    ise::duration max_pause = std::chrono::seconds(60);
};

/// Whether `ack` may be the boat's answer to a telecommand of that kind that was sent under that epoch of authority (0:
/// none). Under an epoch it names one, as the boat answers type 42 with 43: that of the telecommand if the boat did
/// what needs authority, any if the telecommand only asks, and any or none with no_authority.
bool is_answer(const acknowledgement& ack, command_kind kind, std::uint32_t sent_under) noexcept;

/// The telecommands that one link has in hand, from request to acknowledgement, without I/O: it decides what is sent
/// when, and again, and what a repeated id means. The boat executes an id once, so sending again is safe. Bounded. Not
/// thread safe.
///
///     auto id = book.submit(now, wall, request, chosen_id);
///     while (auto due = book.next_due(now, wall)) give due->raw to the link;  // after every call, and at next_event()
///     book.on_outcome(now, wall, id, delivered, "…");                            // how the link fared
///     book.on_acknowledgement(wall, ack);
///     for (auto& change : book.take_changes()) publish it
class command_book {
public:
    explicit command_book(book_options options = book_options()) : options_(options) {}

    /// Takes a telecommand, or finds the one of that id. Gives its id. `chosen` serves where the request has none. One
    /// that has not left the shore goes under the highest epoch of authority that it was given with. Errors:
    /// invalid_argument, overloaded.
    ise::result<std::uint32_t> submit(ise::time_point now, utc_time wall, const telecommand_request& request,
                                      std::uint32_t chosen);

    struct due {
        std::uint32_t id = 0;
        ise::bytes raw;
        ise::duration remaining{}; ///< of its validity
    };
    /// One that is to be given to the link now; it counts as given, and an outcome must follow.
    std::optional<due> next_due(ise::time_point now, utc_time wall);
    /// The link's word: it arrived at the boat's modem (or what `reason` says instead), or not (`certain`: it never
    /// left the shore).
    void on_outcome(ise::time_point now, utc_time wall, std::uint32_t id, bool delivered, bool certain,
                    const std::string& reason);
    /// False if nobody waits for it, or it is no answer (`is_answer`).
    bool on_acknowledgement(utc_time wall, const acknowledgement& ack);
    /// The way to the boat is open (again): what waits for an answer is due now.
    void on_link_up(ise::time_point now);
    /// The boat has answered elsewhere: it is not sent any more. False where it is not known, or decided.
    bool recall(utc_time wall, std::uint32_t id, const std::string& why);
    void on_time(ise::time_point now, utc_time wall);
    /// When `on_time` and `next_due` have something to do; time_point::max() if never.
    ise::time_point next_event() const;
    /// When the validity of the next one ends; time_point::max() if there is none.
    ise::time_point next_expiry() const;

    /// Nothing where the id is not known (any more).
    const telecommand_status* find(std::uint32_t id) const;
    std::vector<telecommand_status> open() const;
    std::vector<telecommand_status> take_changes();
    std::size_t open_count() const noexcept { return open_; }

private:
    struct entry {
        telecommand_status status;
        boat_command command;
        std::uint32_t authority = 0;
        ise::time_point expires{};
        ise::time_point next_try{};
        ise::duration pause{};
        bool at_link = false;
    };
    void change(entry& e, utc_time wall, telecommand_stage stage, std::string text);

    book_options options_;
    std::map<std::uint32_t, entry> entries_;
    std::deque<std::uint32_t> order_;   // as they were asked for
    std::deque<std::uint32_t> decided_; // as they were decided
    std::vector<telecommand_status> changes_;
    std::size_t open_ = 0;
};

} // namespace atirma
