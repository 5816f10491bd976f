#pragma once
#include <components/gprs_link/services.hpp>

#include <ise/component/component.hpp>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace atirma {

struct gprs_link_options {
    std::vector<std::string> listen{"tcp://127.0.0.1:0"}; ///< where the boat calls, tcp and udp
    std::string proxy_tcp = "tcp://127.0.0.1:7420";       ///< where its connections go on to
    std::string proxy_udp = "udp://127.0.0.1:7420";       ///< and its datagrams
    double delay_s = 0.3;                                 ///< each way
    double jitter_s = 0.2;                                ///< added to it at most
    double loss = 0;                                      ///< part of the datagrams
    std::vector<std::string> outages;                     ///< "START+LENGTH", seconds after it was started
    bool up = true;
    std::uint64_t seed = 1;
    std::function<void(const std::vector<ise::endpoint>&)> on_listening; ///< on the component's loop
};

/// The carrier between boat and proxy, in user space: connections and datagrams are passed on late, or not, as
/// `carrier_control` says. Services: `carrier`, `carrier_control` (services.hpp). Options that make no sense, and an
/// endpoint that is taken, end `run()` with an error that says so.
class gprs_link_emulator final : public ise::component {
public:
    explicit gprs_link_emulator(gprs_link_options options = gprs_link_options());
    ~gprs_link_emulator() override;

private:
    struct carrying; // what lives from one run() to the next

    ise::task<> run() override;
    ise::task<> hold(ise::time_point from, ise::duration length);
    void listen();
    carrier_state control(const carrier_request& request);
    carrier_state state();
    void switch_to(bool up);

    gprs_link_options options_;
    std::unique_ptr<carrying> carrying_;
};

} // namespace atirma
