#pragma once
#include <components/boat/telemetry.hpp>
#include <components/byte_stream/outgoing.hpp>
#include <components/xbee/ether.hpp>
#include <components/xbee_link/services.hpp>

#include <ise/component/component.hpp>

#include <array>
#include <functional>
#include <memory>
#include <string>

namespace atirma {

struct xbee_link_options {
    /// Where programs find the serial port of each modem: a symbolic link to a pseudo-terminal.
    struct end {
        std::string port;
        std::uint64_t address = 0;
        std::uint8_t api_mode = 1;
        /// Makes the far end of its serial line instead, where that is no pseudo-terminal.
        std::function<ise::result<std::unique_ptr<ise::stream>>(ise::loop&)> open;
    };
    end shore{"/tmp/xbee-shore", 0x0013A20040000001, 1, {}};
    end boat{"/tmp/xbee-boat", 0x0013A20040000002, 2, {}};
    waypoint shore_position{28.1580, -15.4408}; ///< on land: the shore of La Isleta, above the bay of El Confital
    std::string boat_path;                      ///< whose `ground_truth` tells where the boat is; empty: `distance_m`
    double distance_m = 300;                    ///< until the boat's position is known
    double speedup = 1;                         ///< of the air's model time: airtime, retries, duty cycle
    double extra_loss = 0;
    bool up = true;
    std::uint64_t seed = 1;
};

/// Two emulated XBee 868 Pro and the air between them. Programs open the modems' ports as they would open real ones,
/// may close them, and open them again. Services: `air`, `air_control` (services.hpp).
class xbee_link_emulator final : public ise::component {
public:
    explicit xbee_link_emulator(xbee_link_options options = xbee_link_options());
    ~xbee_link_emulator() override;

    /// Takes over the loss of `now` while it runs.
    void change(const xbee_link_options& now);

private:
    struct side;

    ise::task<> run() override;
    ise::task<> serve(std::size_t which);
    ise::task<> read(std::size_t which);
    void listen_to_boat();
    void turn();
    void move_boat(double latitude_deg, double longitude_deg);
    xbee_air control(const xbee_air_request& request);
    xbee_air state();
    xbee::instant model_now() const;

    xbee_link_options options_;
    double loss_given_; // as a parameter; air_control may have chosen another since
    std::unique_ptr<xbee::ether> air_;
    std::array<std::unique_ptr<side>, 2> sides_;
    std::unique_ptr<ise::timer> due_;
    ise::time_point started_{};
    double distance_m_ = 0;
};

} // namespace atirma
