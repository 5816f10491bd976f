#pragma once
#include <components/boat/random_source.hpp>
#include <components/xbee/at_command.hpp>
#include <components/xbee/decoder.hpp>
#include <components/xbee/duty_cycle.hpp>

#include <deque>
#include <map>
#include <string>
#include <vector>

namespace atirma::xbee {

struct modem_options {
    std::uint64_t address = 0x0013A20040000001;
    std::uint8_t api_mode = 1; ///< AP: 0 transparent, 1, 2
    double temperature_c = 27;
    std::uint64_t seed = 1; ///< of its back-off times
};

/// An XBee 868 Pro, emulated without I/O. Serial bytes and radio packets come in with their time, bytes and
/// transmissions are taken out; `advance` lets time pass, `next_event` says when it wants that. Time never goes back.
/// An `ether` drives the radio side of the modems that are attached to it. Queues are bounded. Not thread safe.
class modem {
public:
    static constexpr std::size_t max_payload = 100;
    static constexpr std::size_t max_queued = 16;        ///< transmissions; above: resource_error
    static constexpr std::size_t max_serial_out = 65536; ///< bytes that nobody takes; above: frames are dropped

    /// Starts with a modem status 0 (hardware reset) in its serial output, in API mode.
    explicit modem(modem_options options);

    // Serial side.
    void on_serial(instant now, ise::bytes_view bytes);
    ise::bytes take_serial();
    /// The CTS line: false while the duty cycle holds the transmitter or its queue is nearly full.
    bool clear_to_send() const noexcept;

    // Time.
    void advance(instant now);
    instant next_event() const noexcept;

    // Radio side.
    std::vector<transmission> take_transmissions();
    void on_air(instant now, const radio_packet& packet, double rssi_dbm);
    void on_damaged(instant now);            ///< heard, and not understood
    void on_carrier(instant until) noexcept; ///< somebody is heard sending until then

    void set_temperature(double celsius) noexcept { temperature_c_ = celsius; }
    std::uint64_t address() const noexcept { return options_.address; }
    std::uint64_t network() const { return number("ID"); }
    double duty_percent(instant now) {
        return 100.0 * static_cast<double>(duty_.used(now).count()) / static_cast<double>(duty_cycle::budget.count());
    }
    std::uint64_t refused_frames() const noexcept { return refused_; }

private:
    enum class phase : std::uint8_t { idle, waiting_duty, backing_off, sending, waiting_ack };
    struct job {
        radio_packet packet;
        std::uint8_t frame_id = 0;
        bool purge = false;
        unsigned retries = 0, deferred = 0;
    };
    struct answer {
        at_status status = at_status::ok;
        ise::bytes value;
    };

    // modem.cpp: radio
    void start_next(instant now);
    void attempt(instant now);
    void on_timer(instant now);
    void finish(instant now, delivery outcome);
    void enqueue(instant now, job work);
    bool seen_before(const radio_packet& packet);
    void deliver(instant now, const radio_packet& packet);
    // modem_serial.cpp: frames, commands, command mode
    void follow_api_mode();
    void put(const frame& f);
    void put_text(std::string_view text);
    void on_frame(instant now, const frame& f);
    void on_plain_byte(instant now, std::byte b);
    void on_command_line(instant now);
    void flush_transparent(instant now);
    void serial_timers(instant now);
    instant next_serial() const noexcept;
    answer execute(instant now, at_name name, ise::bytes_view parameter);
    answer read(instant now, const at_info& info);
    void restart(instant now, std::uint8_t cause);
    std::uint64_t number(std::string_view name) const;
    void count(std::string_view name);

    modem_options options_;
    double temperature_c_;
    std::uint64_t line_mode_; // register AP as the serial line follows it: an answer comes in the mode before
    frame_decoder decoder_;
    duty_cycle duty_;
    random_source random_;
    std::map<at_name, std::uint64_t> registers_;
    std::string node_identifier_ = " ";
    ise::bytes serial_out_, transparent_;
    std::vector<transmission> transmissions_;
    std::deque<job> jobs_;
    std::vector<std::pair<at_name, ise::bytes>> queued_at_;
    std::map<std::uint64_t, std::deque<std::uint32_t>> heard_;
    phase phase_ = phase::idle;
    instant timer_ = never, busy_until_{0}, last_serial_ = instant::min() / 2, guard_ends_ = never,
            command_ends_ = never, transparent_due_ = never, restart_at_ = never;
    std::string command_line_;
    unsigned plus_ = 0;
    std::uint32_t sequence_ = 0;
    std::uint64_t refused_ = 0;
    bool command_mode_ = false;
};

} // namespace atirma::xbee
