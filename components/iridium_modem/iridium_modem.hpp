#pragma once
#include <components/boat/random_source.hpp>
#include <components/byte_stream/outgoing.hpp>
#include <components/iridium_gateway/services.hpp>
#include <components/iridium_modem/modem_9602.hpp>
#include <components/iridium_modem/services.hpp>

#include <ise/component/component.hpp>

#include <array>
#include <functional>
#include <memory>
#include <string>

namespace atirma {

struct iridium_modem_options {
    std::string port = "/tmp/iridium-boat"; ///< a symbolic link to its pseudo-terminal
    /// Makes the far end of its serial line instead, where that is no pseudo-terminal.
    std::function<ise::result<std::unique_ptr<ise::stream>>(ise::loop&)> open;
    std::string imei = "300234010753370";
    std::string gateway = "atirma/iridium/gateway"; ///< path or endpoint of the gateway; empty: no network service
    double min_session_s = 4;
    double max_session_s = 12;
    double failures = 0; ///< part of the sessions that fail on the radio link
    bool sky_free = true;
    std::uint64_t seed = 1;
};

/// An emulated 9602: programs open its port as they would open a real one. Its sessions go to a gateway component,
/// after the time that a session takes, and fail as sessions do. Services: `iridium_sky`, `iridium_sky_control`
/// (services.hpp).
class iridium_modem final : public ise::component {
public:
    explicit iridium_modem(iridium_modem_options options = iridium_modem_options());
    ~iridium_modem() override;

private:
    ise::task<> run() override;
    ise::task<> serve();
    ise::task<> hold_session(modem_9602::session what);
    ise::task<> hear_rings(ise::remote gateway);
    void turn();
    struct iridium_sky control(const iridium_sky_request& request);
    struct iridium_sky sky() const;

    iridium_modem_options options_;
    std::unique_ptr<modem_9602> modem_;
    random_source dice_;
    struct iridium_sky told_;
    int fail_next_ = 0;
    std::unique_ptr<ise::stream> line_;
    std::unique_ptr<ise::timer> due_;
    outgoing unwritten_;
    std::array<std::byte, 512> buffer_{};
};

} // namespace atirma
