#pragma once
#include <components/byte_stream/serial_pump.hpp>
#include <components/iridium/sbd_client.hpp>

#include <functional>
#include <string>

namespace atirma::iridium {

struct sbd_port_options {
    std::string device; ///< "/dev/ttyUSB1"
    unsigned baud = 19200;
    sbd_client_options client;
    ise::duration min_retry = std::chrono::milliseconds(250); ///< between attempts to open it; doubles
    ise::duration max_retry = std::chrono::seconds(5);
};

/// The thin shell around `sbd_client`: the serial port of a 9602, opened through the environment and opened again when
/// it vanished. Used on one loop; must outlive `run()`.
class sbd_port final : private serial_driver {
public:
    sbd_port(ise::loop& on, ise::logger log, sbd_port_options options);

    /// Hears every event, on the loop; may ask for more. Set it before `run()`.
    std::function<void(const sbd_event&)> on_event;

    /// Opens the port and serves it until it is cancelled. Never fails: what is wrong is logged and shown by
    /// `trouble()`.
    ise::task<> run() { return pump_.run(); }

    ise::result<void> send(ise::bytes message);
    void check();

    bool ready() const noexcept { return pump_.is_open() && client_.ready(); }
    bool has_message() const noexcept { return client_.has_message(); }
    /// Why nothing can be sent now; empty where it can.
    const std::string& trouble() const noexcept { return pump_.trouble(); }

private:
    void on_open(ise::time_point now) override { client_.start(now); }
    void on_bytes(ise::time_point now, ise::bytes_view bytes) override { client_.on_bytes(now, bytes); }
    void on_time(ise::time_point now) override { client_.on_time(now); }
    void on_closed(ise::time_point, const std::string&) override { client_.stop(); }
    bool handle_event() override;
    ise::bytes take_output() override { return client_.take_output(); }
    ise::time_point next_event() const override { return client_.next_event(); }

    ise::loop& loop_;
    ise::logger log_;
    sbd_client client_;
    serial_pump pump_;
};

} // namespace atirma::iridium
