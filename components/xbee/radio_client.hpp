#pragma once
#include <components/xbee/decoder.hpp>
#include <components/xbee/radio.hpp>

#include <deque>
#include <map>
#include <optional>
#include <string>
#include <variant>

namespace atirma::xbee {

/// Names a request until its outcome has been told; never reused by one client.
using token = std::uint64_t;

struct client_options {
    std::size_t window = 4;        ///< transmissions that the modem holds at a time
    std::size_t max_queued = 64;   ///< requests that wait for the modem; above: overloaded
    std::size_t max_events = 1024; ///< events that nobody takes; above: the oldest received packet goes
    instant send_timeout = std::chrono::seconds(60);
    instant at_timeout = std::chrono::seconds(2);
    instant remote_at_timeout = std::chrono::seconds(15);
    bool wake_transparent = true; ///< a modem that answers no frame is asked by +++ and set to AP=1
};

/// The modem answers; requests that waited are on their way.
struct radio_ready {
    api_mode mode = api_mode::plain;
};
/// The modem does not answer (any more). The client keeps trying by itself; requests wait until their time is up.
struct radio_silent {
    std::string reason;
};
/// How a transmission ended. Where not delivered, `executed` says whether the packet may have arrived all the same.
struct send_outcome {
    token id = 0;
    bool delivered = false;
    std::optional<delivery> code; ///< the modem's own word; nothing if it gave none in time
    std::uint8_t retries = 0;
    ise::execution executed = ise::execution::not_executed;
    std::string reason; ///< for people; empty where delivered
};
/// The answer to an AT command. Where `status` is empty none came in time, `reason` says so.
struct at_outcome {
    token id = 0;
    at_name command{};
    std::uint64_t address = 0; ///< of the remote modem; 0 for the local one
    std::optional<at_status> status;
    ise::bytes value;
    std::string reason;
};
struct packet_received {
    std::uint64_t source = 0;
    bool broadcast = false;
    ise::bytes payload;
};
/// The modem restarted by itself (frame 8A); what it held is told as unknown.
struct modem_restarted {
    std::uint8_t status = 0;
};
using client_event =
    std::variant<radio_ready, radio_silent, send_outcome, at_outcome, packet_received, modem_restarted>;

struct client_counters {
    std::uint64_t frames = 0, refused_frames = 0, skipped_bytes = 0, dropped_events = 0, delayed = 0;
};

/// The driver's side of a serial line to an XBee, without I/O. It owns neither port nor clock:
///
///     client.start(now);                       // the port is open
///     write(client.take_output());             // after every call below
///     client.on_bytes(now, what_was_read);     // or client.on_time(now) when next_event() has come
///     while (auto e = client.take_event()) …   // after every call, too
///     client.stop(now, "the port vanished");   // then start() again with the next port
///
/// Finds out by itself whether the modem speaks AP=1 or AP=2. Each accepted request ends in exactly one outcome event.
/// A transmission that the modem turned away for its duty cycle, a busy channel or lack of memory was certainly not
/// sent: it is tried again after a growing pause until its time is up. Not thread safe.
class radio_client {
public:
    explicit radio_client(client_options options = {}) : options_(options) {}

    void start(instant now);
    /// Ends every request; those already written may have been executed.
    void stop(instant now, std::string_view reason);

    /// Payloads above 100 bytes are refused here (too_large), a full queue is `overloaded`. May be called before the
    /// modem is ready, and while stopped: the request waits.
    ise::result<token> send(instant now, std::uint64_t destination, ise::bytes payload, std::uint8_t tx_options = 0,
                            std::optional<instant> timeout = {});
    ise::result<token> local_at(instant now, at_name command, ise::bytes parameter = {});
    ise::result<token> remote_at(instant now, std::uint64_t address, at_name command, ise::bytes parameter = {});

    void on_bytes(instant now, ise::bytes_view bytes);
    void on_time(instant now);
    /// When `on_time` wants to be called; `never` if nothing is due.
    instant next_event() const;

    ise::bytes take_output();
    std::optional<client_event> take_event();

    bool ready() const noexcept { return phase_ == phase::ready; }
    api_mode mode() const noexcept { return mode_; }
    std::size_t outstanding() const noexcept { return pending_.size(); }
    std::size_t queued() const noexcept { return waiting_.size(); }
    const client_counters& counters() const noexcept { return counters_; }

private:
    enum class phase : std::uint8_t { stopped, asking, quiet, plus, setting, leaving, ready };
    struct request {
        token id = 0;
        frame content; ///< its frame id is put in when it is written
        instant deadline{};
        bool is_send() const { return std::holds_alternative<transmit_request>(content); }
    };

    ise::result<token> accept(frame content, instant deadline);
    void pump(instant now);
    void write_request(instant now, request r);
    void settle(instant now, std::uint8_t frame_id, const frame& answer);
    void fail(const request& r, bool written, std::string reason);
    void fail_written(std::string reason);
    void on_frame(instant now, const frame& f);
    void ask(instant now);
    void find_again(instant now, std::string reason);
    void become_ready(instant now, api_mode mode);
    void on_phase_time(instant now);
    void write_text(std::string_view text);
    void tell(client_event event);
    void drain(instant now);

    client_options options_;
    phase phase_ = phase::stopped;
    api_mode mode_ = api_mode::plain;
    frame_decoder decoder_{api_mode::plain};
    std::deque<request> waiting_;
    std::map<std::uint8_t, request> pending_;
    std::deque<client_event> events_;
    ise::bytes output_;
    std::string command_reply_;
    client_counters counters_;
    instant phase_due_ = never, hold_until_{0}, pause_{0}, gap_due_ = never;
    token next_token_ = 1;
    std::uint8_t next_frame_id_ = 1;
    unsigned asked_ = 0, silent_requests_ = 0;
    bool told_silent_ = false;
};

} // namespace atirma::xbee
