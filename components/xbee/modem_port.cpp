#include <components/xbee/modem_port.hpp>

namespace atirma::xbee {
namespace {

serial_pump::options pump_options_of(const port_options& port) {
    serial_pump::options made;
    made.port.device = port.device;
    made.port.baud = port.baud;
    made.port.hardware_flow_control = port.hardware_flow_control;
    made.min_retry = port.min_retry;
    made.max_retry = port.max_retry;
    return made;
}

} // namespace

modem_port::modem_port(ise::loop& on, ise::logger log, port_options options)
    : loop_(on), log_(log), options_(std::move(options)), client_(options_.client),
      pump_(on, std::move(log), *this, pump_options_of(options_)) {}

ise::result<token> modem_port::send(std::uint64_t destination, ise::bytes payload, ise::duration timeout) {
    auto accepted = client_.send(now(), destination, std::move(payload), 0, timeout);
    pump_.service();
    return accepted;
}

ise::result<token> modem_port::local_at(at_name command, ise::bytes parameter) {
    auto accepted = client_.local_at(now(), command, std::move(parameter));
    pump_.service();
    return accepted;
}

bool modem_port::handle_event() {
    auto event = client_.take_event();
    if (!event) return false;
    if (std::holds_alternative<radio_ready>(*event)) {
        pump_.on_answer();
        log_.info("the modem answers", {{"api_mode", std::to_string(static_cast<int>(client_.mode()))}});
    } else if (const auto* silent = std::get_if<radio_silent>(&*event)) {
        pump_.on_silence(silent->reason);
    } else if (const auto* restarted = std::get_if<modem_restarted>(&*event)) {
        log_.warning("the modem restarted", {{"status", std::to_string(restarted->status)}});
    }
    if (on_event) on_event(*event);
    return true;
}

} // namespace atirma::xbee
