#pragma once
#include <components/iridium/at.hpp>

#include <ise/core/time.hpp>

#include <optional>
#include <string>

namespace atirma {

/// A 9602 as its serial line sees it, without I/O and without radio: AT commands in, answers out. A session is taken
/// out by `take_session`, held by whoever emulates the radio, and ended by `end_session`. Bounded. Not thread safe.
class modem_9602 {
public:
    explicit modem_9602(std::string imei) : imei_(std::move(imei)) {}

    void on_serial(ise::time_point now, ise::bytes_view in);
    ise::bytes take_serial() { return std::exchange(out_, {}); }

    struct session {
        std::uint16_t momsn = 0;
        ise::bytes message; ///< empty: a look for mail
        std::uint16_t received_mtmsn = 0;
    };
    /// A session that the host asked for; until it is ended the modem hears nothing.
    std::optional<session> take_session();
    /// `told.mo_status`, `mt_status`, `mtmsn` and `mt_queued` count; the rest is the modem's.
    void end_session(iridium::sbdix result, ise::bytes message);
    /// The gateway has something: `SBDRING` where the host wants to know.
    void ring();

    void on_time(ise::time_point now);
    ise::time_point next_event() const noexcept { return data_by_; }
    int signal_bars = 5; ///< of AT+CSQ, 0 … 5

    bool in_session() const noexcept { return in_session_; }
    std::uint16_t next_momsn() const noexcept { return momsn_; }
    const std::string& imei() const noexcept { return imei_; }

private:
    void on_command(ise::time_point now, std::string_view command);
    void on_data(std::byte b);
    void say(std::string_view line);
    void ok() { say("OK"); }
    void error() { say("ERROR"); }
    void begin_session();
    void say_message();

    std::string imei_;
    std::string line_;
    ise::bytes out_;
    ise::bytes mo_, mt_;
    ise::bytes data_;             // of AT+SBDWB
    std::size_t data_wanted_ = 0; // with its sum; 0: commands are read
    ise::time_point data_by_ = ise::time_point::max();
    std::uint16_t momsn_ = 1;
    std::uint16_t mtmsn_ = 0;
    std::optional<session> wanted_;
    bool echo_ = true, rings_ = false, ring_pending_ = false, in_session_ = false;
};

} // namespace atirma
