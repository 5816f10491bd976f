#pragma once
#include <components/gprs/line_reader.hpp>
#include <components/gprs/number_set.hpp>

#include <ise/core/endpoint.hpp>
#include <ise/core/time.hpp>
#include <ise/net/fair_places.hpp>
#include <ise/transport/udp/cookie.hpp>

#include <deque>
#include <list>
#include <memory>
#include <set>
#include <vector>

namespace atirma::gprs {

struct shore_options {
    std::string boat_id = "atirma";                      ///< whose login is taken
    ise::duration login_time = std::chrono::seconds(10); ///< a connection that has not logged in by then is cut off
    ise::duration silence = std::chrono::minutes(3);     ///< of the boat; then its way is half open, and given up
    std::size_t max_strangers = 16;     ///< connections without a login; `ise::net::fair_places` decides
    std::size_t max_login_bytes = 1024; ///< that a stranger may send before he has logged in
    std::size_t max_bad_lines = 8;      ///< one after the other, of the boat's own connection
    std::size_t max_unsafe = 4096;      ///< records that wait until they are safe; further ones come again
    std::size_t max_boots = 8;          ///< lives of the boat whose numbers are remembered
    std::size_t max_orders = 256;       ///< telecommands of which it is known to whom they went
    ise::net::udp::secret secret{};     ///< drawn at random; the keys of addresses follow from it
};

/// A way to the boat: a connection, or a socket for datagrams and who is at the other end.
struct way {
    /// Names the connection or the socket; given by the shell, never reused for a connection.
    std::uint64_t channel = 0;
    ise::endpoint peer;
    bool datagrams = false;
    bool operator==(const way&) const = default;
};

/// This text goes that way.
struct send_text {
    way to;
    std::string text;
};
/// The connection is to be closed.
struct cut_off {
    way whom;
    std::string reason;
    bool stranger = false;
};
/// A datagram that no boat sent: dropped.
struct stranger_datagram {
    ise::endpoint from;
    std::string reason;
};
struct boat_came {
    way by;
    bool moved = false; ///< it was there by another way or address a moment ago
};
struct boat_went {
    std::string reason;
};
/// A record that came for the first time. It is acknowledged once `safe` was told of it; after `refused` it comes
/// again.
struct record_came {
    std::uint64_t life = 0; ///< of the boat's numbering, for `safe`
    std::uint32_t number = 0;
    bool history = false;
    ise::bytes raw;
};
struct outcome_came {
    outcome what;
};
/// Something that a person should know of.
struct remark {
    std::string text;
};
using shore_event =
    std::variant<send_text, cut_off, stranger_datagram, boat_came, boat_went, record_came, outcome_came, remark>;

struct shore_counters {
    std::uint64_t connections = 0, logins = 0, moves = 0;
    std::uint64_t records = 0, resends = 0, history = 0; ///< first time; again; first time and late
    std::uint64_t postponed = 0;                         ///< not taken for lack of room: they come again
    std::uint64_t given_up = 0;                          ///< numbers that the boat will not send any more
    std::uint64_t malformed = 0, strangers_cut_off = 0, stranger_datagrams = 0, half_open = 0;
    std::uint64_t challenges = 0;       ///< logins by datagram that were asked to show their key
    std::uint64_t strange_outcomes = 0; ///< of telecommands that did not go to that life of the boat
};

/// The shore's end of the uplink, without I/O: who is the boat and who a stranger, what came, what is acknowledged,
/// where telecommands go. It owns neither socket nor clock; what it decides is taken by `take_event()` after every
/// call, and all times come from one clock.
///
/// The boat's last login says by which way it is there: an earlier connection is cut off. Datagrams of another address
/// are a stranger's until a login shows the key that the shore sent there, and as long as the boat is there over a
/// connection. Boot and token of a login name a life of the boat: the numbers of one life say nothing about another's,
/// and its answers count for the telecommands that went to it. Acknowledgements are cumulative over the numbers of one
/// life. Not thread safe.
class shore {
public:
    explicit shore(shore_options options = shore_options())
        : options_(std::move(options)), places_(options_.max_strangers) {}

    /// A connection was accepted, and ended by itself.
    void connected(ise::time_point now, way by);
    void disconnected(ise::time_point now, std::uint64_t channel, const std::string& reason);
    void on_bytes(ise::time_point now, std::uint64_t channel, ise::bytes_view bytes);
    void on_datagram(ise::time_point now, const way& by, ise::bytes_view content);
    /// These numbers of a life may be acknowledged.
    void safe(std::uint64_t life, const std::vector<std::uint32_t>& numbers);
    /// That one cannot be read here: it is as if it had not come.
    void refused(std::uint64_t life, std::uint32_t number);
    /// False, and nothing was sent, where the boat is not there.
    bool send(const order& what);
    void on_time(ise::time_point now);
    /// When `on_time` has something to do; time_point::max() if never.
    ise::time_point next_event() const;
    std::optional<shore_event> take_event();

    const std::optional<way>& boat() const noexcept { return boat_; }
    ise::time_point came_at() const noexcept { return came_at_; }   ///< the last login by this way
    ise::time_point heard_at() const noexcept { return heard_at_; } ///< the boat's last line
    std::uint16_t boot() const noexcept { return boot_; }           ///< of the last login
    std::uint32_t acknowledged() const;                             ///< of that boot
    std::uint32_t announced() const;                                ///< the highest number that the boat told of
    std::size_t unsafe() const noexcept { return unsafe_; }
    std::size_t strangers() const noexcept { return strangers_.size(); }
    const shore_counters& counters() const noexcept { return counters_; }

private:
    struct life { // of the boat's numbering
        std::uint16_t boot = 0;
        std::uint64_t token = 0;
        std::uint64_t id = 0;
        number_set received, safe;
        std::uint32_t announced = 0;
        bool heard = false; // of what it holds
    };
    struct stranger {
        way by;
        ise::time_point until{};
        std::size_t bytes = 0;
        line_reader reader;
        std::unique_ptr<ise::net::fair_places::place> place;
    };

    life& life_of(std::uint16_t boot);
    life* life_by(std::uint64_t id);
    const life* known(std::uint16_t boot) const;
    void take(ise::time_point now, const ise::result<line>& got);
    void take_login(const login& outcome);
    void take_record(record&& outcome);
    void admit(ise::time_point now, const way& by, const login& outcome, line_reader reader);
    void lose_boat(const std::string& reason);
    void cut_stranger(std::list<stranger>::iterator who, std::string reason);
    void acknowledge();
    void send_to_boat(std::string text);
    std::uint64_t key_of(const way& by) const;
    void start_afresh(life& of);
    template <class E>
    void tell(E event) {
        events_.push_back(shore_event(std::move(event)));
    }

    shore_options options_;
    ise::net::fair_places places_; // before the strangers, who hold them
    std::optional<way> boat_;
    line_reader reader_;            // of the boat's connection
    std::list<stranger> strangers_; // as they came
    std::list<life> lives_;         // the one that was heard last is first
    std::set<std::uint16_t> owed_;  // boots whose acknowledgement is to be sent
    std::deque<shore_event> events_;
    shore_counters counters_;
    ise::time_point came_at_{}, heard_at_{};
    std::size_t unsafe_ = 0, bad_lines_ = 0;
    std::deque<std::pair<std::uint32_t, std::uint64_t>> orders_; // id, and the life that it went to last
    std::uint64_t last_life_ = 0;
    std::uint64_t token_ = 0;
    std::uint16_t boot_ = 0;
};

} // namespace atirma::gprs
