#pragma once
#include <components/iridium/sbd_client.hpp>

#include <ise/core/environment.hpp>
#include <ise/core/log.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/task.hpp>

#include <array>
#include <functional>
#include <memory>
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
class sbd_port {
public:
    sbd_port(ise::loop& on, ise::logger log, sbd_port_options options);

    /// Hears every event, on the loop; may ask for more. Set it before `run()`.
    std::function<void(const sbd_event&)> on_event;

    /// Opens the port and serves it until it is cancelled. Never fails: what is wrong is logged and shown by
    /// `trouble()`.
    ise::task<> run();

    ise::result<void> send(ise::bytes message);
    void check();

    bool ready() const noexcept { return stream_ && client_.ready(); }
    bool has_message() const noexcept { return client_.has_message(); }
    /// Why nothing can be sent now; empty where it can.
    const std::string& trouble() const noexcept { return trouble_; }

private:
    void service();
    void write();
    void note(const sbd_event& event);
    ise::task<std::string> serve();

    ise::loop& loop_;
    ise::logger log_;
    sbd_port_options options_;
    sbd_client client_;
    std::unique_ptr<ise::stream> stream_;
    ise::timer wake_;
    ise::bytes unwritten_;
    std::array<std::byte, 512> buffer_{};
    std::string trouble_ = "the port was not opened yet";
    bool servicing_ = false;
};

} // namespace atirma::iridium
