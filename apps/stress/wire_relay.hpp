#pragma once
#include "taps.hpp"

#include <ise/component/component.hpp>
#include <ise/core/environment.hpp>

#include <functional>
#include <memory>
#include <string>

namespace atirma::stress {

/// Passes connections on and reads along. What the caller writes is `wrote`, what it is told is `read`.
class wire_relay final : public ise::component {
public:
    wire_relay(std::string listen, std::string onward, std::function<std::unique_ptr<tap>()> make)
        : listen_(std::move(listen)), onward_(std::move(onward)), make_(std::move(make)) {}

private:
    struct line {
        std::unique_ptr<ise::stream> near, far;
        std::unique_ptr<tap> by;
    };
    ise::task<> run() override;
    ise::task<> carry(std::shared_ptr<line> what);
    static ise::task<> pump(std::shared_ptr<line> what, bool outward);

    std::string listen_, onward_;
    std::function<std::unique_ptr<tap>()> make_;
};

} // namespace atirma::stress
