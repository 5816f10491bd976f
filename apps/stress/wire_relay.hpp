#pragma once
#include "wire.hpp"

#include <ise/core/environment.hpp>

#include <functional>
#include <string>

namespace atirma::stress {

/// Passes connections on and reads along. What the caller writes is `wrote`, what it is told is `read`.
class wire_relay final : public ise::component {
public:
    using tap_maker = std::function<std::unique_ptr<tap>()>;
    wire_relay(std::string listen, std::string onward, tap_maker make,
               std::function<void(const ise::endpoint&)> on_listening = {})
        : listen_(std::move(listen)), onward_(std::move(onward)), make_(std::move(make)),
          on_listening_(std::move(on_listening)) {}

private:
    ise::task<> run() override;
    ise::task<> connect(std::shared_ptr<wire> what);

    std::string listen_, onward_;
    tap_maker make_;
    std::function<void(const ise::endpoint&)> on_listening_;
};

/// The same for datagrams of one caller at a time: the one that was heard last.
class datagram_wire final : public ise::component {
public:
    datagram_wire(std::string listen, std::string onward, wire_relay::tap_maker make,
                  std::function<void(const ise::endpoint&)> on_listening = {})
        : listen_(std::move(listen)), onward_(std::move(onward)), make_(std::move(make)),
          on_listening_(std::move(on_listening)) {}

private:
    struct ends;
    ise::task<> run() override;
    static ise::task<> inward(std::shared_ptr<ends> between, std::shared_ptr<ise::datagram_socket> far);

    std::string listen_, onward_;
    wire_relay::tap_maker make_;
    std::function<void(const ise::endpoint&)> on_listening_;
};

} // namespace atirma::stress
