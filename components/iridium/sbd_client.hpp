#pragma once
#include <components/boat/random_source.hpp>
#include <components/iridium/at.hpp>

#include <ise/core/time.hpp>

#include <deque>
#include <optional>
#include <string>
#include <variant>

namespace atirma::iridium {

struct sbd_client_options {
    ise::duration answer_time = std::chrono::seconds(5);    ///< of the modem to a command
    ise::duration session_time = std::chrono::seconds(120); ///< to AT+SBDIX
    ise::duration min_pause = std::chrono::seconds(10);     ///< between the attempts for one message
    ise::duration max_pause = std::chrono::seconds(30);
    ise::duration late_pause = std::chrono::seconds(180); ///< after status 36
    ise::duration give_up = std::chrono::seconds(300);    ///< after the first attempt
    std::uint64_t seed = 1;
};

struct sbd_ready {
    std::string imei;
};
struct sbd_silent {
    std::string reason;
}; ///< the modem does not answer; it is asked on
struct sbd_attempt {
    sbdix status;
}; ///< a session is over
struct sbd_sent {
    std::uint16_t momsn = 0;
}; ///< the message is at the gateway
struct sbd_gave_up {
    std::string reason;
    bool message = false; ///< one was lost by it, not only a look for mail
};
struct sbd_received {
    ise::bytes data;
    std::uint16_t mtmsn = 0;
};
using sbd_event = std::variant<sbd_ready, sbd_silent, sbd_attempt, sbd_sent, sbd_gave_up, sbd_received>;

/// The host's side of a 9602, without I/O: starts the modem, takes one message at a time through sessions until it is
/// at the gateway or `give_up` is over, fetches what waits there, and looks for mail when the modem rings. Bounded. Not
/// thread safe.
///
///     client.start(now);                            // the port is open
///     client.on_bytes(now, …); client.on_time(now); // at next_event()
///     write client.take_output(); hear client.take_event();
class sbd_client {
public:
    explicit sbd_client(sbd_client_options options = sbd_client_options()) : options_(options), dice_(options.seed) {}

    void start(ise::time_point now);
    /// The port is gone; a message in hand waits for it within its time.
    void stop();

    /// One message of 1 … 340 bytes. Errors: overloaded (one is in hand), too_large, invalid_argument (empty).
    ise::result<void> send(ise::time_point now, ise::bytes message);
    /// Looks for messages at the gateway, with the next session.
    void check(ise::time_point now);

    void on_bytes(ise::time_point now, ise::bytes_view in);
    void on_time(ise::time_point now);
    ise::time_point next_event() const;
    ise::bytes take_output() { return std::exchange(output_, {}); }
    std::optional<sbd_event> take_event();

    bool ready() const noexcept { return step_ >= step::idle; }
    bool has_message() const noexcept { return message_.has_value(); }

private:
    enum class step { off, starting, idle, clearing, offering, writing, in_session, fetching, fetched };

    void command(ise::time_point now, std::string_view text, ise::duration within);
    void on_line(ise::time_point now, std::string_view line);
    void on_done(ise::time_point now, bool ok);
    void start_step(ise::time_point now);
    void go_on(ise::time_point now);
    void begin(ise::time_point now);
    void end_session(ise::time_point now);
    void failed(ise::time_point now, std::string reason, ise::duration pause);
    void lost_modem(ise::time_point now, std::string reason, bool pause = false);
    void binary(ise::time_point now);
    void fetch_failed(std::string reason);
    bool wanted() const noexcept { return message_ || check_; }

    sbd_client_options options_;
    random_source dice_;
    step step_ = step::off;
    std::size_t start_at_ = 0;
    bool told_silent_ = false;
    bool pausing_ = false; // before the modem is asked again
    std::optional<ise::bytes> message_;
    bool check_ = false, rang_ = false;
    bool carrying_ = false; // the session under way has the message
    bool fetch_ = false;    // a message lies in the modem
    unsigned fetch_failures_ = 0;
    ise::time_point first_try_ = ise::time_point::max(); // of what is wanted now
    ise::time_point next_try_{};
    ise::time_point answer_by_ = ise::time_point::max();
    std::string last_reason_ = "the modem did not answer";
    std::optional<sbdix> told_;
    int write_result_ = -1;
    std::string imei_;
    std::string line_;
    ise::bytes binary_; // of AT+SBDRB
    ise::bytes output_;
    std::deque<sbd_event> events_;
};

} // namespace atirma::iridium
