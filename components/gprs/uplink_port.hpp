#pragma once
#include <components/byte_stream/outgoing.hpp>
#include <components/gprs/uplink.hpp>

#include <ise/core/environment.hpp>
#include <ise/core/log.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/task.hpp>
#include <ise/transport/security.hpp>

#include <array>
#include <functional>
#include <memory>

namespace atirma::gprs {

struct port_options {
    ise::endpoint shore;    ///< of the proxy, or of a carrier before it: tcp, tls or udp
    ise::security security; ///< with `tls` for a tls endpoint
    uplink_options link;    ///< `datagrams` follows from the endpoint, `token` is drawn
    ise::duration connect_time = std::chrono::seconds(20);
    ise::duration min_retry = std::chrono::seconds(1); ///< between attempts; doubles as long as nothing is acknowledged
    ise::duration max_retry = std::chrono::seconds(30);
};

/// The thin shell around `uplink`: dials the shore through the environment, over a connection or by datagrams, and
/// dials again when that ended or is half open. Packets may be put at any time. Used on one loop; must outlive `run()`.
class uplink_port {
public:
    /// Throws ise::error (invalid_argument) for an endpoint that is neither tcp, tls nor udp, for tls without
    /// certificates, and as `uplink`.
    uplink_port(ise::loop& on, ise::logger log, port_options options, std::uint16_t boot);

    /// Hears every telecommand, on the loop. Set it before `run()`.
    std::function<void(const order&)> on_order;

    /// Serves the link until it is cancelled. Never fails: what is wrong is logged and shown by `trouble()`.
    ise::task<> run();

    void put(ise::bytes raw);
    void put_sealed(ise::bytes raw); ///< see uplink
    /// Without power the way is closed and none is opened; packets are kept.
    void set_power(bool on);
    void set_period(ise::duration period) { link_.set_period(period); }

    bool connected() const noexcept { return link_.answered(); }
    /// Why nothing arrives now; empty where it does, as far as is known.
    const std::string& trouble() const noexcept { return trouble_; }
    const uplink& link() const noexcept { return link_; }

private:
    ise::task<std::string> serve_stream();
    ise::task<std::string> serve_datagrams();
    void came(ise::bytes_view bytes);
    void service();
    void write();
    void write_datagrams();
    void close(std::string why);
    bool from_shore(const ise::endpoint& peer) const;

    ise::loop& loop_;
    ise::logger log_;
    port_options options_;
    uplink link_;
    std::unique_ptr<ise::stream> stream_;
    std::unique_ptr<ise::datagram_socket> socket_;
    ise::timer wake_;
    outgoing unwritten_;
    std::string unsent_;  // a datagram that the kernel had no room for
    std::string closing_; // why this way was closed by ourselves
    std::array<std::byte, 1024> buffer_{};
    std::string trouble_ = "the shore was not called yet";
    bool servicing_ = false, power_ = true;
};

} // namespace atirma::gprs
