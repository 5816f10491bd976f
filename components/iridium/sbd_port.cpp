#include <components/iridium/sbd_port.hpp>

namespace atirma::iridium {
namespace {

serial_pump::options pump_options_of(const sbd_port_options& port) {
    serial_pump::options made;
    made.port.device = port.device;
    made.port.baud = port.baud;
    made.min_retry = port.min_retry;
    made.max_retry = port.max_retry;
    return made;
}

} // namespace

sbd_port::sbd_port(ise::loop& on, ise::logger log, sbd_port_options options)
    : loop_(on), log_(log), client_(options.client), pump_(on, std::move(log), *this, pump_options_of(options)) {}

ise::result<void> sbd_port::send(ise::bytes message) {
    auto taken = client_.send(loop_.now(), std::move(message));
    pump_.service();
    return taken;
}

void sbd_port::check() {
    client_.check(loop_.now());
    pump_.service();
}

bool sbd_port::handle_event() {
    auto event = client_.take_event();
    if (!event) return false;
    if (const auto* ready = std::get_if<sbd_ready>(&*event)) {
        pump_.on_answer();
        log_.info("the modem answers", {{"imei", ready->imei}});
    } else if (const auto* silent = std::get_if<sbd_silent>(&*event)) {
        pump_.on_silence(silent->reason);
    } else if (const auto* lost = std::get_if<sbd_gave_up>(&*event)) {
        log_.warning(lost->message ? "a message was given up" : "looking for messages was given up",
                     {{"cause", lost->reason}});
    }
    if (on_event) on_event(*event);
    return true;
}

} // namespace atirma::iridium
