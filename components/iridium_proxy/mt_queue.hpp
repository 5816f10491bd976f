#pragma once
#include <components/iridium_proxy/services.hpp>

#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace atirma {

/// A telecommand on its way over Iridium: all that is kept on disk of it.
struct mt_entry {
    std::uint32_t id = 0;
    boat_command command;
    std::uint32_t authority = 0; ///< the epoch that travels to the boat
    std::uint64_t order = 0;     ///< as they were asked for
    iridium_stage stage = iridium_stage::waiting;
    bool may_have_left = false; ///< an attempt ended in the dark
    std::string text;
    std::optional<ack_code> result;
    std::optional<float> value;
    std::optional<std::uint32_t> boat_obeys; ///< the epoch that the boat obeys, where its answer said so
    std::string reference;
    std::uint32_t attempts = 0;
    utc_time asked_at{}, expires_at{}, changed_at{}, next_try{};
};

telecommand_status status_of(const mt_entry& entry);

/// How giving a message to the gateway went.
struct mt_outcome {
    enum class kind { accepted, refused, later, unknown };
    kind what = kind::later;
    std::string reference; ///< accepted
    std::string text;      ///< for people
};

struct mt_queue_options {
    std::size_t max_open = 64;        ///< above: overloaded
    std::size_t max_remembered = 512; ///< decided ones that a repeated id still finds
    std::uint32_t bytes_per_credit = 50;
    std::chrono::seconds min_pause{5}; ///< after an attempt that may succeed later; doubles
    std::chrono::seconds max_pause{900};
};

/// What one message costs.
std::uint64_t credits_of(std::size_t bytes, std::uint32_t bytes_per_credit) noexcept;

/// The telecommands that wait for Iridium, without I/O, on civil time since they outlive the process: one is given to
/// the gateway at a time, by priority, then by age. What the gateway has taken is not sent again: it keeps it until the
/// boat opens a session, and each message is paid for. Bounded. Not thread safe.
class mt_queue {
public:
    explicit mt_queue(mt_queue_options options = mt_queue_options()) : options_(options) {}

    /// What the disk has kept, at the start. One that was being sent then is sent again.
    void restore(utc_time now, std::vector<mt_entry> kept);

    /// Takes a telecommand, or finds the one of that id. Gives its id. `chosen` serves where the request has none. One
    /// that has not left the shore goes under the highest epoch of authority that it was given with. Errors:
    /// invalid_argument, overloaded.
    ise::result<std::uint32_t> submit(utc_time now, const telecommand_request& request, std::uint32_t chosen);
    /// Forgets one that could not be kept on disk.
    void forget(std::uint32_t id);

    struct due {
        std::uint32_t id = 0;
        ise::bytes raw;
        std::uint64_t credits = 0;
    };
    /// What is to be given to the gateway now; it counts as `sending`, and an outcome must follow. Nothing where
    /// today's budget does not reach for it: it waits for midnight then, and those behind it, too.
    std::optional<due> next_due(utc_time now, std::optional<std::uint64_t> budget_left);
    void on_outcome(utc_time now, std::uint32_t id, const mt_outcome& outcome);
    /// A session of the boat took a message along: the oldest at the gateway.
    void on_delivered(utc_time now);
    /// The gateway's later word about one that it had taken.
    void on_gateway_word(utc_time now, std::uint32_t id, bool kept, const std::string& text);
    /// False if nobody waits for it, or it is no answer (`is_answer`).
    bool on_acknowledgement(utc_time now, const acknowledgement& ack);
    /// The boat has answered elsewhere. True if nothing more of it leaves the shore: what the gateway has cannot be
    /// called back, and what is being given to it goes through.
    bool recall(utc_time now, std::uint32_t id, const std::string& why);
    void on_time(utc_time now);
    /// When `on_time` and `next_due` have something to do; utc_time::max() if never.
    utc_time next_event() const;

    const mt_entry* find(std::uint32_t id) const;
    std::vector<const mt_entry*> open() const; ///< in the order in which they go
    std::vector<mt_entry> take_changes();      ///< as they are now, each once, in order

private:
    void change(mt_entry& e, utc_time now, iridium_stage stage, std::string text);
    const mt_entry* first_waiting(utc_time now) const;
    std::chrono::seconds pause_of(const mt_entry& e) const;

    mt_queue_options options_;
    std::map<std::uint32_t, mt_entry> entries_;
    std::vector<std::uint32_t> decided_; // as they were decided
    std::vector<std::uint32_t> changed_;
    std::uint64_t next_order_ = 1;
    std::size_t open_ = 0;
    utc_time budget_until_{}; // no budget before then
};

} // namespace atirma
