#pragma once
#include <components/byte_stream/serial_pump.hpp>
#include <components/xbee/radio_client.hpp>

#include <functional>
#include <string>

namespace atirma::xbee {

struct port_options {
    std::string device = "/dev/ttyUSB0";
    unsigned baud = 9600;
    bool hardware_flow_control = false;
    client_options client;
    ise::duration min_retry = std::chrono::milliseconds(250); ///< between attempts to open it; doubles
    ise::duration max_retry = std::chrono::seconds(5);
};

/// The thin shell around `radio_client`: the serial port of a modem, opened through the environment and opened again
/// when it vanished. Requests may be made at any time; they wait for port and modem until their time is up, and each
/// ends in one event. Used on one loop; must outlive `run()`.
class modem_port final : private serial_driver {
public:
    modem_port(ise::loop& on, ise::logger log, port_options options);

    /// Hears every event, on the loop; may make new requests. Set it before `run()`.
    std::function<void(const client_event&)> on_event;

    /// Opens the port and serves it until it is cancelled. Never fails: what is wrong is logged and shown by
    /// `trouble()`.
    ise::task<> run() { return pump_.run(); }

    ise::result<token> send(std::uint64_t destination, ise::bytes payload, ise::duration timeout);
    ise::result<token> local_at(at_name command, ise::bytes parameter = {});

    bool is_open() const noexcept { return pump_.is_open(); }
    bool modem_ready() const noexcept { return client_.ready(); }
    api_mode mode() const noexcept { return client_.mode(); }
    /// Why nothing can be sent now; empty where it can.
    const std::string& trouble() const noexcept { return pump_.trouble(); }
    /// Times that the port was opened.
    std::uint64_t openings() const noexcept { return pump_.openings(); }
    /// Requests that the modem or the queue before it holds.
    std::size_t in_hand() const noexcept { return client_.outstanding() + client_.queued(); }
    const client_counters& counters() const noexcept { return client_.counters(); }
    const port_options& options() const noexcept { return options_; }

private:
    instant now() const { return loop_.now().time_since_epoch(); }
    void on_open(ise::time_point now) override { client_.start(now.time_since_epoch()); }
    void on_bytes(ise::time_point now, ise::bytes_view bytes) override {
        client_.on_bytes(now.time_since_epoch(), bytes);
    }
    void on_time(ise::time_point now) override { client_.on_time(now.time_since_epoch()); }
    void on_closed(ise::time_point now, const std::string& reason) override {
        client_.stop(now.time_since_epoch(), reason);
    }
    bool handle_event() override;
    ise::bytes take_output() override { return client_.take_output(); }
    ise::time_point next_event() const override { return ise::time_point(client_.next_event()); }

    ise::loop& loop_;
    ise::logger log_;
    port_options options_;
    radio_client client_;
    serial_pump pump_;
};

} // namespace atirma::xbee
