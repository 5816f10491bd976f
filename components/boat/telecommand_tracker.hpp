#pragma once
#include <components/boat/boat_clock.hpp>
#include <components/boat/link_stage.hpp>
#include <components/boat/services.hpp>
#include <components/boat/telecommand_table.hpp>

#include <ise/core/time.hpp>

#include <string_view>

namespace atirma {

/// How a link treats telecommands.
struct link_policy {
    link_id link = link_id::xbee;
    std::size_t max_open = 64;        ///< telecommands that are not decided (`check_place`); above: overloaded
    std::size_t max_remembered = 512; ///< decided ones that a repeated id still finds
    /// Until one that was delivered is sent again; nothing: never, as each attempt is paid for.
    std::optional<ise::duration> answer_time = std::chrono::seconds(15);
    ise::duration min_pause = std::chrono::seconds(2); ///< after an attempt that did not arrive; doubles
    ise::duration max_pause = std::chrono::seconds(60);
    /// One is given at a time, by priority, then by age; else all that are due, by age.
    bool one_at_a_time = false;
    std::string_view waits = "waits for the link";
    std::string_view is_given; ///< the text while an attempt lasts; empty: attempts are no change to tell
};

/// How an attempt went.
struct link_outcome {
    enum class kind : std::uint8_t {
        delivered, ///< it arrived at the boat's modem, as far as the link can know
        accepted,  ///< a gateway has it, and goes on with it
        refused,   ///< the link will never take it: failed, or expired where an attempt before may have arrived
        later,     ///< it certainly did not leave the shore
        unknown,   ///< it may have arrived
    };
    kind what = kind::later;
    std::string text;      ///< for people
    std::string reference; ///< accepted: the gateway's number
};
link_outcome make_outcome(link_outcome::kind what, std::string text, std::string reference = {});

/// A telecommand on its way over a link: all that is kept on disk of it where the link keeps it.
struct tracked_telecommand {
    std::uint32_t id = 0;
    boat_command command;
    std::uint32_t authority = 0; ///< the epoch that travels to the boat
    std::uint64_t order = 0;     ///< as they were asked for
    link_stage stage = link_stage::waiting;
    bool may_have_left = false; ///< an attempt ended in the dark, or another one follows a delivery
    bool unreadable = false;    ///< the boat cannot open the last attempt: it was sealed without a session
    std::string text;
    std::optional<ack_code> result;
    std::optional<float> value;
    std::optional<std::uint32_t> boat_obeys; ///< the epoch that the boat obeys, where its answer said so
    std::string reference;
    std::uint32_t attempts = 0;
    std::uint32_t failures = 0; ///< attempts since it was last delivered, or the link came up
    utc_time asked_at{}, changed_at{};
    ise::time_point expires_at{}, next_try{}; ///< by the tracker's clock
    utc_time valid_until{};                   ///< `expires_at`, as it was told when it was asked for
    std::optional<utc_time> executed_at;      ///< by the shore's clock
    std::uint32_t called_late = 0;            ///< answers of the boat that it is late, while it was not
};
telecommand_status status_of(const tracked_telecommand& entry, link_id link);

/// Whether `ack` may be the boat's answer to a telecommand of that kind that was sent under that epoch of authority (0:
/// none). Under an epoch it names one, with type 43: that of the telecommand if the boat did what needs authority, any
/// if the telecommand only asks, and any or none with no_authority and expired.
bool is_answer(const acknowledgement& ack, command_kind kind, std::uint32_t sent_under) noexcept;

/// Now, by the clock that validities and pauses are measured with, and as it is told.
struct tracker_time {
    ise::time_point now{};
    utc_time wall{};
};
/// For a tracker whose telecommands outlive the process: both are civil time.
constexpr tracker_time civil_tracker_time(utc_time at) noexcept { return {ise::time_point(at.time_since_epoch()), at}; }
/// A time of such a tracker, as civil time.
constexpr utc_time civil_time_of(ise::time_point at) noexcept {
    return utc_time(std::chrono::floor<std::chrono::milliseconds>(at.time_since_epoch()));
}

/// The telecommands that one link has in hand, from request to acknowledgement, without I/O: it decides what is sent
/// when, and again, and what a repeated id means. The boat executes an id once, so sending again is safe. Bounded. Not
/// thread safe.
///
///     auto id = tracker.submit(now, request, chosen_id);
///     while (auto due = tracker.next_due(now)) give due->raw to the link;     // after every call, and at next_event()
///     tracker.on_outcome(now, id, make_outcome(…));                           // how the link fared
///     tracker.on_acknowledgement(now, ack);
///     for (auto& change : tracker.take_changes()) keep it, publish it
class telecommand_tracker {
public:
    explicit telecommand_tracker(link_policy policy = link_policy()) : policy_(policy), table_(policy.max_remembered) {}

    /// What the disk has kept, at the start. One that was being sent then is sent again.
    void restore(tracker_time at, std::vector<tracked_telecommand> kept);

    /// Takes a telecommand, or finds the one of that id. Gives its id. `chosen` serves where the request has none. One
    /// that has not left the shore goes under the highest epoch of authority that it was given with. Errors:
    /// invalid_argument, overloaded.
    ise::result<std::uint32_t> submit(tracker_time at, const telecommand_request& request, std::uint32_t chosen);
    /// Calls back the open ones whose place it takes (`boat_command::replaces`), under the same epoch of authority: the
    /// boat refuses those of an older one.
    void replace_older(tracker_time at, std::uint32_t id);
    /// Forgets one that could not be kept on disk.
    void forget(std::uint32_t id);

    struct due {
        std::uint32_t id = 0;
        ise::bytes raw;
        ise::duration remaining{}; ///< of its validity
    };
    /// One that is to be given to the link now; it counts as `sending`, and an outcome must follow.
    std::optional<due> next_due(tracker_time at);
    /// The same one, not given yet.
    const tracked_telecommand* first_due(tracker_time at);
    /// As it is sent now: each attempt says anew how long it is still valid.
    ise::bytes encoded(const tracked_telecommand& entry, tracker_time at) const;
    /// The first that is due waits until then for a reason, and with it all others.
    void hold(tracker_time at, ise::time_point until, const std::string& why);
    /// Whether the boat can open what is given of it now; before the outcome of that attempt.
    void mark_unreadable(std::uint32_t id, bool unreadable);
    /// The boat can open what is given from now on: those that it could not open are sent again.
    void repeat_unreadable(tracker_time at);
    void on_outcome(tracker_time at, std::uint32_t id, const link_outcome& outcome);
    /// A session of the boat took a message along: the oldest at the gateway.
    void on_delivered(tracker_time at);
    /// The gateway's later word about one that it had taken.
    void on_gateway_word(tracker_time at, std::uint32_t id, bool kept, const std::string& text);
    /// A packet of the boat came: what it says of the boat's clock. Answers need not be told here.
    void on_heard(tracker_time at, const packet_header& packet) { clock_.heard(at.now, packet, false); }
    /// False if nobody waits for it, or it is no answer (`is_answer`). Where the boat finds late what is not, its clock
    /// is wrong: it is sent again by that clock, a few times.
    bool on_acknowledgement(tracker_time at, const acknowledgement& ack);
    /// The same, of an answer that is no packet: it brings neither a time nor a value, and names no epoch.
    bool on_result(tracker_time at, std::uint32_t id, ack_code code);
    /// The way to the boat is open (again): what waits for an answer is due now.
    void on_link_up(tracker_time at);
    /// The boat has answered elsewhere: it is not sent any more. False where nothing can be called back: it is not
    /// known, decided, or on its way over a link that sends once, to a boat that can open it.
    bool recall(tracker_time at, std::uint32_t id, const std::string& why);
    void on_time(tracker_time at);
    /// When `on_time` and `next_due` have something to do; time_point::max() if never.
    ise::time_point next_event() const;
    /// When the validity of the next one ends; time_point::max() if there is none.
    ise::time_point next_expiry() const;

    /// Nothing where the id is not known (any more).
    const tracked_telecommand* find(std::uint32_t id) const { return table_.find(id); }
    /// In the order in which they go.
    std::vector<const tracked_telecommand*> open() const;
    std::size_t open_count() const noexcept { return table_.open().size(); }
    std::vector<tracked_telecommand> take_changes() { return std::exchange(changes_, {}); }
    const link_policy& policy() const noexcept { return policy_; }

private:
    void change(tracked_telecommand& e, tracker_time at, link_stage stage, std::string text);
    bool answer(tracker_time at, const acknowledgement& ack, bool is_packet);
    void give_up(tracked_telecommand& e, tracker_time at, const std::string& why);
    bool may_be_sent(const tracked_telecommand& e) const;
    bool link_is_taken() const;

    link_policy policy_;
    telecommand_table<tracked_telecommand> table_;
    std::vector<tracked_telecommand> changes_;
    boat_clock clock_;
    std::uint64_t next_order_ = 1;
    ise::time_point held_until_{};
};

} // namespace atirma
