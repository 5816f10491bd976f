#pragma once
#include <ise/core/ring.hpp>
#include <ise/net/outbox.hpp>
#include <ise/session/conversation.hpp>
#include <ise/subscription/send_queue.hpp>
#include <ise/subscription/subscriber_group.hpp>
#include <ise/wire/messages.hpp>

#include <cstdint>
#include <memory>
#include <utility>

namespace ise {

/// The session that subscribers are reached over, and what is held for all of them together.
class subscriber_line {
public:
    conversation& over() const noexcept { return over_; }
    net::connection& wire() const noexcept { return over_.wire(); }
    std::size_t& held_bytes() noexcept { return held_bytes_; }
    std::size_t held_bytes() const noexcept { return held_bytes_; }
    /// Of these, what open runs (`common_run`) have reserved.
    std::size_t& reserved_bytes() noexcept { return reserved_bytes_; }
    /// Gives back what open runs have reserved and do not use.
    void settle() noexcept {
        if (reserved_bytes_ > 0) settle_all();
    }
    /// Of these, what the packet that is being published has taken at other subscribers of its publication.
    std::size_t held_by(const subscriber_group& group, std::uint64_t sequence) const noexcept {
        return newest_.of == &group && newest_.sequence == sequence ? newest_.bytes : 0;
    }
    void hold(std::size_t size, const subscriber_group& group, std::uint64_t sequence) noexcept {
        newest_ = {&group, sequence, held_by(group, sequence) + size};
        held_bytes_ += size;
    }
    /// Tells a subscriber that its subscription is over, and how many packets it does not get for that.
    virtual void end(std::uint64_t id, const failure& why, std::uint64_t lost) = 0;
    /// A subscription has moved to another session, or its publication has gone.
    virtual void forget(std::uint64_t id) noexcept = 0;

protected:
    explicit subscriber_line(conversation& over) noexcept : over_(over) {}
    ~subscriber_line() = default;
    /// Settles the publications of all that are reached over it.
    virtual void settle_all() noexcept = 0;

private:
    struct packet_share {
        const subscriber_group* of = nullptr;
        std::uint64_t sequence = 0;
        std::size_t bytes = 0;
    };
    conversation& over_;
    std::size_t held_bytes_ = 0;
    std::size_t reserved_bytes_ = 0;
    packet_share newest_;
};

/// One subscriber at the provider: its queue, its policy, and the session it is reached over, if any.
class remote_subscriber final : public net::publication_source {
public:
    remote_subscriber(subscriber_group& of, const wire::subscribe& terms, subscriber_info info, bool takes_objects);
    ~remote_subscriber();

    void attach(subscriber_line& over, std::uint64_t id);
    /// The session is gone; packets go on being kept by the policy until it comes back or the linger is over.
    void detach();
    /// Its session is destroyed without having ended, as its loop has.
    void let_go(const subscriber_line& of);
    bool attached() const noexcept { return line_ != nullptr; }

    /// False: the queue is full, and the policy is to end it then.
    bool offer(const published_packet& packet);
    struct run_room {
        std::size_t packets;
        std::size_t cost;
    };
    /// For how many packets right behind this one, the newest, it has room, and of what cost together; none where they
    /// have to be offered.
    run_room room_for_run(const shared_bytes& newest) const noexcept;
    /// Reserves bytes of its session for a run.
    void reserve(std::size_t cost) noexcept;
    /// Ends the run: releases the reserved bytes and appends the run's packets, of `size` bytes, to the queue.
    void extend(std::size_t packets, std::size_t size, std::size_t reserved) noexcept;
    /// Whether it is given objects, where there are any; else frames.
    void take_objects(bool wanted) noexcept;
    /// A packet was published that is not meant for this one.
    void pass() noexcept { ++skipped_; }
    void grant(std::uint64_t total);
    /// A lossless one that is connected and full: a publisher that waits waits for it.
    bool holds_up() const noexcept;
    bool take(net::outbox& out, std::size_t quantum) override;
    /// It comes back. Goes on at the first packet that did not arrive: of a lossless one, what was sent in vain goes
    /// again.
    void resume(const wire::subscribe& terms, bool takes_objects);
    /// Ends it at the subscriber, if that is reached.
    void end(const failure& why);
    /// When it must have moved, or been heard, where it holds up a publisher that waits since then.
    time_point held_up_until(time_point since);
    /// The first of these two.
    time_point stalled_at(time_point since) const;
    /// It lingers, and vanishes in this turn.
    void vanish_now();
    /// Packets did not fit while it was out of reach.
    bool overrun() const noexcept { return beyond_ > 0; }
    /// The longest packet that it accepts, where it is reached now; otherwise there is no limit.
    std::uint64_t longest() const noexcept;
    /// Packets that did not arrive and are not sent any more if it ends now.
    std::uint64_t unsent() const noexcept { return queue_.size() + in_pieces() + beyond_; }

    const wire::ticket& ticket() const noexcept { return ticket_; }
    std::uint64_t id() const noexcept { return id_; }
    subscriber_line* line() const noexcept { return line_; }
    const subscriber_info& info() const noexcept { return info_; }
    std::uint64_t dropped() const noexcept { return dropped_; }
    std::size_t queued() const noexcept { return queue_.size(); }
    bool loses_nothing() const noexcept {
        return policy_ == wire::overflow::lossless || policy_ == wire::overflow::disconnect;
    }

private:
    void wake();
    void stay_within_bytes() noexcept;
    void resume_at(std::uint64_t next);
    send_queue::stretch pop(std::uint64_t most);
    void keep(const send_queue::stretch& sent);
    void forget_arrived();
    void limit_sent();
    void forget_sent();
    std::size_t held() const noexcept { return queue_.cost() + sent_packets_.cost(); }
    void put_alone(net::outbox& out);
    void note_skipped(std::uint64_t sequence, std::uint32_t skipped);
    bool make_room(std::size_t more);
    void drop_oldest(std::uint64_t& reason);
    /// Whether a packet of `more` bytes does not fit. Of the held bytes, `same` are copies of that packet.
    bool full(std::size_t more, std::size_t same = 0) const noexcept;
    void put_object(net::outbox& out);
    void write_objects();
    void stop_lingering();
    bool may_send() const noexcept;

    subscriber_group& group_;
    subscriber_line* line_ = nullptr;
    std::uint64_t id_ = 0;
    wire::ticket ticket_{};
    bool takes_objects_ = false;
    wire::overflow policy_;
    std::size_t depth_;
    std::uint64_t credit_; // lossless: total granted
    duration min_interval_;
    send_queue queue_;
    send_queue sent_packets_;  // lossless: not known to have arrived
    std::size_t resent_ = 0;   // of queue_, at its front: they do not count towards the depth
    std::uint64_t beyond_ = 0; // packets that did not fit; of one that loses nothing
    std::uint64_t sent_ = 0;
    std::uint64_t dropped_ = 0;
    std::uint32_t skipped_ = 0; // since the last packet that was queued
    // Sent packets with skipped ones before them, and how many: those that did not arrive are counted anew. Bounded.
    ring<std::pair<std::uint64_t, std::uint32_t>> sent_skips_;
    time_point next_allowed_{};
    time_point full_since_ = time_point::max(); // lossless: nothing was taken since
    const std::size_t max_bytes_;               // that wait
    subscriber_info info_;
    std::unique_ptr<timer> linger_;
};

} // namespace ise
