#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/time.hpp>
#include <ise/net/udp/interval_set.hpp>

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

namespace ise {

class session;

/// What is known of the numbered calls of one client in one of its lives, over all of its sessions: which were begun,
/// and what they were answered. A client that lost its session asks again by the same number, and what ran once does
/// not run again. Bounded; without I/O.
class reply_window {
public:
    static constexpr std::size_t max_replies = 1024;
    static constexpr std::size_t max_reply_bytes = 4u << 20;
    static constexpr std::size_t max_gaps = 1024;

    enum class state {
        fresh,     ///< never seen
        running,   ///< being served
        answered,  ///< the reply is kept
        forgotten, ///< it may have run, and its reply is not kept
    };
    /// Where a call came from, or where its answer goes.
    struct place {
        std::weak_ptr<session> over;
        std::uint64_t id = 0;
    };

    /// `unsure`: there may have been a window of this client before.
    explicit reply_window(bool unsure) : unsure_(unsure) {}

    /// `again`: the client may have sent it before.
    state look(std::uint64_t number, bool again) const noexcept;
    void begin(std::uint64_t number, place from, time_point deadline, time_point now);
    /// The answer of a call that runs goes elsewhere now.
    void redirect(std::uint64_t number, place to);
    /// Where a running call came in first: its handler knows it by that.
    std::optional<place> origin(std::uint64_t number) const;
    /// Keeps the answer, a whole frame, and says where it goes.
    std::optional<place> finish(std::uint64_t number, bytes_view frame);
    const bytes* answer(std::uint64_t number) const noexcept;
    /// Nobody waits for it any more. It does not run again all the same.
    void give_up(std::uint64_t number);

    std::size_t replies() const noexcept { return replies_; }
    std::size_t reply_bytes() const noexcept { return reply_bytes_; }
    std::size_t running() const noexcept { return known_.size() - replies_; }
    time_point last_used() const noexcept { return last_used_; }

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
    std::vector<known>::iterator reaching(std::uint64_t number) noexcept;
    entry* find(std::uint64_t number) noexcept;
    const entry* find(std::uint64_t number) const noexcept { return const_cast<reply_window*>(this)->find(number); }
    void drop(std::size_t slot);
    void make_room(time_point now);

    std::vector<known> known_;      // by number: a link of the client counts up, so that new ones mostly come last
    std::vector<entry> slots_;      // of those known, and of earlier ones, whose room waits for the next
    std::vector<std::size_t> free_; // slots
    net::udp::interval_set seen_;
    std::uint64_t floor_ = 0; // numbers below it count as seen
    std::size_t replies_ = 0;
    std::size_t reply_bytes_ = 0;
    time_point last_used_{};
    bool unsure_;
};

/// Those of all clients, by incarnation.
class reply_windows {
public:
    static constexpr std::size_t max_idle = 1024;
    static constexpr duration idle_life = std::chrono::minutes(5);

    std::shared_ptr<reply_window> of(std::uint64_t incarnation, time_point now);
    std::size_t size() const noexcept { return all_.size(); }

private:
    void sweep(time_point now);

    std::map<std::uint64_t, std::shared_ptr<reply_window>> all_;
    std::size_t sweep_at_ = 64;
    bool dropped_any_ = false;
};

} // namespace ise
