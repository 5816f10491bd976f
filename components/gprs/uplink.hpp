#pragma once
#include <components/gprs/line_reader.hpp>

#include <ise/core/time.hpp>

#include <deque>
#include <functional>

namespace atirma::gprs {

struct uplink_options {
    std::string id = "atirma"; ///< how the boat calls itself
    /// Of what goes to the shore, each time that it goes: the key may change while a packet waits. Empty: it goes as it
    /// is.
    std::function<ise::bytes(ise::bytes)> seal;
    std::uint64_t token = 0;                        ///< of this start of the program, drawn at random
    bool datagrams = false;                         ///< the way may lose and reorder, and its address may change
    std::size_t capacity = 8192;                    ///< packets without acknowledgement; beyond, the oldest is given up
    std::size_t window = 32;                        ///< packets of history under way at a time
    ise::duration period = std::chrono::seconds(5); ///< an acknowledgement is expected once in this time
    ise::duration keepalive = std::chrono::seconds(60); ///< of silence; then it asks whether the shore is there
};

struct uplink_counters {
    std::uint64_t sessions = 0, half_open = 0;
    /// Packets; dropped: given up without acknowledgement.
    std::uint64_t sent = 0, resent = 0, acknowledged = 0, dropped = 0;
    std::uint64_t malformed = 0;
};

/// The boat's end of the uplink, without I/O. Keeps each packet until the shore has acknowledged it, through any number
/// of connections: after a new one the newest fix goes first, then what is measured meanwhile, and the rest as history.
///
///     link.put(packet);                                  // at any time
///     link.opened(now);                                  // a connection, or a socket for datagrams
///     for (;;) { text = link.take_text(now); … }         // after every call, as long as the way takes it; each a
///     datagram link.on_bytes(now, what_came);  link.on_time(now); // the latter when next_event() has come while (auto
///     what = link.take_order()) … if (auto why = link.trouble(now)) close it;        // half open, or nonsense
///     link.closed();
///
/// A way is half open when nothing was acknowledged for three periods; the time grows with the delay that is seen, and
/// after ways that brought nothing at all. Not thread safe.
class uplink {
public:
    /// `boot`: differs at each start of the program, for its numbers begin at 1 then.
    explicit uplink(std::uint16_t boot, uplink_options options = uplink_options());

    /// A packet of the boat: telemetry is numbered and kept, an acknowledgement of a telecommand goes as its outcome.
    void put(ise::bytes raw);
    /// A notice about the seal, sealed: kept and sent as telemetry is, under the key that it is about.
    void put_sealed(ise::bytes raw);

    void opened(ise::time_point now);
    void closed();
    void on_bytes(ise::time_point now, ise::bytes_view bytes);
    void on_time(ise::time_point now);
    ise::time_point next_event() const;
    /// What goes out next, one line or login and line; empty where there is nothing.
    std::string take_text(ise::time_point now);
    std::optional<order> take_order();
    /// Why this way is no good any more; nothing where it is.
    std::optional<std::string> trouble(ise::time_point now);

    void set_period(ise::duration period);

    /// Whether the shore has answered by this way.
    bool answered() const noexcept { return open_ && answered_; }
    std::size_t waiting() const noexcept { return ring_.size(); } ///< packets without acknowledgement
    ise::time_point heard_at() const noexcept { return heard_at_; }
    std::uint32_t last_number() const noexcept { return first_ + static_cast<std::uint32_t>(ring_.size()) - 1; }
    std::uint32_t acknowledged() const noexcept { return first_ - 1; }
    const uplink_counters& counters() const noexcept { return counters_; }

private:
    struct kept {
        ise::bytes raw;
        bool sealed = false; // already; else it is sealed when it is sent
        std::int64_t unix_s = 0;
        std::uint64_t sent_in = 0; // session, 0 for none
        ise::time_point sent_at{};
    };

    kept& keep(ise::bytes raw);
    kept& at(std::uint32_t number) { return ring_[number - first_]; }
    bool holds(std::uint32_t number) const noexcept { return number >= first_ && number - first_ < ring_.size(); }
    bool under_way(const kept& packet) const noexcept { return packet.sent_in == session_; }
    bool asks_for_key() const noexcept { return options_.datagrams && !key_; }
    void begin_history();
    void forget_first();
    void on_datagram(ise::time_point now, ise::bytes_view content);
    void take(ise::time_point now, line_reader& from);
    void on_challenge(ise::time_point now, const challenge& result);
    void on_receipt(ise::time_point now, const receipt& result);
    std::optional<std::uint32_t> choose();
    std::string login_text(ise::time_point now);
    ise::bytes sealed(ise::bytes raw) const { return options_.seal ? options_.seal(std::move(raw)) : raw; }
    std::string record_text(ise::time_point now, std::uint32_t number);
    ise::duration patience() const;
    ise::duration resend_after() const;

    uplink_options options_;
    std::uint16_t boot_;
    line_reader reader_;
    std::optional<std::uint64_t> key_; // of the address that the shore sees; over datagrams
    std::deque<kept> ring_;            // numbers first_, first_ + 1 …
    std::deque<outcome> outcomes_;
    std::deque<order> orders_;
    std::deque<std::uint32_t> again_; // to be sent again
    std::uint32_t first_ = 1;
    std::uint32_t old_ = 0;                     // the highest number when the way was opened
    std::uint32_t next_old_ = 1, next_new_ = 1; // the first not looked at, of either kind
    std::uint32_t fix_ = 0;                     // the newest fix, 0 for none
    std::size_t old_under_way_ = 0;
    std::uint64_t session_ = 0;
    std::optional<ise::time_point> asked_at_; // since when an acknowledgement is missing
    ise::time_point said_at_{}, heard_at_{}, login_at_{};
    ise::duration slowest_{}; // answer lately
    int factor_ = 1;
    std::size_t bad_lines_ = 0;
    bool open_ = false, answered_ = false, asked_again_ = false, login_due_ = false, gap_untold_ = false;
    uplink_counters counters_;
};

} // namespace atirma::gprs
