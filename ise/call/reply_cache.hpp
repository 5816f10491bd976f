#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/interval_set.hpp>
#include <ise/core/time.hpp>

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

namespace ise {

class incoming_calls;

/// What is known of the numbered calls of one client in one of its lives, over all of its sessions: which were begun,
/// and what they were answered. A client that lost its session asks again by the same number, and what ran once does
/// not run again. Bounded; without I/O.
class reply_cache {
public:
    static constexpr std::size_t max_replies = 1024;
    static constexpr std::size_t max_reply_bytes = 4u << 20;
    static constexpr std::size_t max_gaps = 1024; ///< in the numbers begun, of all ranges
    static constexpr std::size_t max_ranges = 64; ///< the least recently used gives way
    /// Each link of a client counts in a range of its own.
    static constexpr unsigned range_bits = 40;

    enum class state {
        fresh,     ///< never seen
        running,   ///< being served
        answered,  ///< the reply is kept
        forgotten, ///< it may have run, and its reply is not kept
    };
    /// Where a call came from, or where its answer goes.
    struct place {
        std::weak_ptr<incoming_calls> over; ///< of a session
        std::uint64_t id = 0;
    };

    /// `unsure`: there may have been a window of this client before. `room_of_all`: counts what all windows together
    /// take.
    explicit reply_cache(bool unsure, std::shared_ptr<std::size_t> room_of_all = std::make_shared<std::size_t>(0))
        : sure_from_(unsure ? ~std::uint64_t{0} : 0), room_of_all_(std::move(room_of_all)) {}
    ~reply_cache() { *room_of_all_ -= room_; }
    reply_cache(const reply_cache&) = delete;
    reply_cache& operator=(const reply_cache&) = delete;

    /// `again`: the client may have sent it before.
    state look(std::uint64_t number, bool again) const noexcept;
    void begin(std::uint64_t number, place from, time_point deadline, time_point now);
    /// The answer of a call that runs goes elsewhere now.
    void redirect(std::uint64_t number, place to);
    /// Where a running call came in first: its handler knows it by that.
    std::optional<place> origin(std::uint64_t number) const;
    /// Where the answer of a running call goes.
    const place* destination(std::uint64_t number) const noexcept;
    /// Keeps the answer, a whole frame, and says where it goes.
    std::optional<place> finish(std::uint64_t number, bytes_view frame, time_point now);
    const bytes* answer(std::uint64_t number) const noexcept;
    /// Nobody waits for it any more. It does not run again all the same.
    void give_up(std::uint64_t number);
    /// Makes room for others: none of these calls runs again all the same.
    void forget_answers();

    std::size_t replies() const noexcept { return replies_; }
    std::size_t reply_bytes() const noexcept { return reply_bytes_; }
    /// Bytes of memory for calls and answers.
    std::size_t room() const noexcept { return room_; }
    std::size_t running() const noexcept { return known_.size() - replies_; }
    /// When a call was begun or answered, or a session of the client ended.
    time_point last_used() const noexcept { return last_used_; }
    void touch(time_point now) noexcept { last_used_ = now; }

private:
    struct entry {
        place from;                        // while it runs
        std::unique_ptr<place> redirected; // where the answer goes instead
        time_point deadline{};
        bool answered = false;
        bytes frame;
    };
    struct known {
        std::uint64_t number;
        std::size_t slot;
    };
    struct range {
        std::uint64_t key;       // the upper bits of its numbers
        bool unsure;             // there may have been one of this key before
        std::uint64_t floor = 0; // numbers below it count as seen
        interval_set seen;
    };
    static std::uint64_t key_of(std::uint64_t number) noexcept { return number >> range_bits; }
    void note(std::uint64_t number);
    std::vector<known>::iterator reaching(std::uint64_t number) noexcept;
    entry* find(std::uint64_t number) noexcept;
    const entry* find(std::uint64_t number) const noexcept { return const_cast<reply_cache*>(this)->find(number); }
    template <class Condition>
    void drop_where(Condition condition);
    void drop(std::size_t slot) noexcept;
    void make_room(std::size_t bytes, time_point now);
    void took(std::size_t before, std::size_t after) noexcept;

    std::vector<known> known_;      // by number: a link of the client counts up, so that new ones mostly come last
    std::vector<entry> slots_;      // of those known, and of earlier ones, whose room waits for the next
    std::vector<std::size_t> free_; // slots; room for all, so that none is lost
    std::vector<range> ranges_;     // the most recently used first
    std::uint64_t sure_from_;       // ranges below it that are not known may have been
    std::size_t gaps_ = 0;          // intervals of all ranges
    std::size_t replies_ = 0;
    std::size_t reply_bytes_ = 0;
    std::size_t room_ = 0;
    std::shared_ptr<std::size_t> room_of_all_;
    time_point last_used_{};
};

/// Those of all clients. A client is known by a secret that it tells this provider only (wire::hello::reply_key): its
/// incarnation is listed, so that others could use up its numbers and get its answers. Clients without a secret, of
/// earlier versions, are known by their incarnation alone.
class reply_windows {
public:
    /// Without a session or a call, of whom is known what they called.
    static constexpr std::size_t max_idle_callers = 1024;
    static constexpr duration idle_caller_life = std::chrono::minutes(5); ///< then their answers are forgotten
    /// Of all; whose last call is longest ago forget their answers.
    static constexpr std::size_t max_kept_bytes = std::size_t{64} << 20;

    std::shared_ptr<reply_cache> of(std::uint64_t reply_key, std::uint64_t incarnation, time_point now,
                                    std::string_view who = {});
    /// After each answer, since that is what takes room.
    void tidy(time_point now) {
        if (now >= next_sweep_) sweep(now);
        if (*room_ > max_kept_bytes) make_room();
    }
    std::size_t size() const noexcept { return all_.size(); }
    std::size_t room() const noexcept { return *room_; }

private:
    void sweep(time_point now);
    void make_room();

    // By reply key and incarnation.
    std::map<std::tuple<std::uint64_t, std::uint64_t, std::string>, std::shared_ptr<reply_cache>> all_;
    // Its windows outlive it where a session does.
    std::shared_ptr<std::size_t> room_ = std::make_shared<std::size_t>(0);
    std::size_t sweep_at_ = max_idle_callers;
    time_point next_sweep_{};
    bool dropped_any_ = false;
};

} // namespace ise
