#pragma once
#include <apps/stress/wire.hpp>

#include <functional>
#include <string>

namespace atirma::stress {

/// A serial line between an emulated modem and who opens it, with somebody who reads along: makes a port under `link`
/// and passes on to `device` while somebody has it open. What the modem says meanwhile to nobody stays with the modem.
class serial_wire final : public ise::component {
public:
    using tap_maker = std::function<std::unique_ptr<tap>()>;
    serial_wire(std::string link, std::string device, tap_maker make)
        : link_(std::move(link)), device_(std::move(device)), make_(std::move(make)) {}

private:
    ise::task<> run() override;
    ise::task<> serve(std::unique_ptr<ise::stream> near);

    std::string link_, device_;
    tap_maker make_;
};

} // namespace atirma::stress
