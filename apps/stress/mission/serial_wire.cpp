#include "serial_wire.hpp"

#include <ise/core/environment.hpp>

#include <asio/buffer.hpp>

#include <array>

namespace atirma::stress {
namespace {

using namespace std::chrono_literals;

constexpr unsigned baud = 115200; // a pseudo-terminal has none
constexpr ise::duration pause = 10ms;

} // namespace

ise::task<> serial_wire::run() {
    for (;;) {
        auto made = env().open_pseudo_terminal(on(), link_);
        auto serving = serve(std::move(made.value().far_end));
        co_await std::move(serving);
        co_await sleep(pause);
    }
}

/// Until who had opened it closes it.
ise::task<> serial_wire::serve(std::unique_ptr<ise::stream> near) {
    auto line = std::make_shared<wire>();
    line->near = std::move(near);
    line->by = make_();
    std::array<std::byte, 1024> buffer;
    auto first = co_await line->near->read_some(asio::buffer(buffer)); // whoever opens a modem speaks first
    if (first.bytes == 0) co_return;
    ise::serial_options port;
    port.device = device_;
    port.baud = baud;
    while (!line->far) {
        auto opened = env().open_serial(on(), port);
        if (opened) line->far = std::move(*opened);
        else co_await sleep(pause); // the emulator makes another one after each end
    }
    ise::bytes_view said(buffer.data(), first.bytes);
    line->by->wrote(said);
    const asio::const_buffer piece(said.data(), said.size());
    (void)line->far->try_write(std::span(&piece, 1)); // a modem's first commands fit; else they are sent again
    auto carrying = carry(*this, line);
    co_await std::move(carrying);
}

} // namespace atirma::stress
