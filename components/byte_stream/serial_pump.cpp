#include <components/byte_stream/serial_pump.hpp>

#include <ise/core/sleep.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>
#include <fmt/format.h>

#include <algorithm>

namespace atirma {
namespace {
// A line that takes no more is asked again after this long: at 9600 baud twenty bytes have left by then.
constexpr ise::duration write_again = std::chrono::milliseconds(20);
} // namespace

serial_pump::serial_pump(ise::loop& on, ise::logger log, serial_driver& driver, options chosen)
    : loop_(on), log_(std::move(log)), driver_(driver), options_(std::move(chosen)), wake_(on, [this] {
          driver_.on_time(loop_.now());
          service();
      }) {}

ise::task<> serial_pump::run() {
    const auto& device = options_.port.device;
    auto pause = options_.min_retry;
    for (;;) {
        auto opened = loop_.env().open_serial(loop_, options_.port);
        std::string problem;
        if (opened) {
            stream_ = std::move(*opened);
            ++openings_;
            trouble_ = "the modem has not answered yet";
            log_.info("serial port opened", {{"device", device}});
            auto opened_at = loop_.now();
            driver_.on_open(opened_at);
            service();
            problem = co_await serve();
            driver_.on_closed(loop_.now(), problem);
            stream_.reset();
            unwritten_.clear();
            if (loop_.now() - opened_at > options_.max_retry) pause = options_.min_retry;
        } else {
            problem = opened.error().message();
        }
        bool stopping = problem == "serial port closed";
        if (problem != trouble_ && !stopping) log_.warning(problem, {{"device", device}}); // once, not every attempt
        trouble_ = problem;
        service();
        co_await ise::sleep_for(loop_, pause);
        pause = std::min(pause * 2, options_.max_retry);
    }
}

/// Reads until the port is gone; says why.
ise::task<std::string> serial_pump::serve() {
    for (;;) {
        auto got = co_await stream_->read_some(asio::buffer(buffer_));
        if (got.bytes > 0) {
            driver_.on_bytes(loop_.now(), ise::bytes_view(buffer_).first(got.bytes));
            service();
        }
        if (got.problem == asio::error::operation_aborted) co_return "serial port closed"; // we were cancelled
        auto gone = fmt::format("serial port {} is gone", options_.port.device);
        if (got.problem == asio::error::eof) co_return gone;
        if (got.problem) co_return fmt::format("{}: {}", gone, got.problem.message());
    }
}

// Events may ask for more, which makes more output: all of it in one go, however deep it began.
void serial_pump::service() {
    if (servicing_) return;
    servicing_ = true;
    while (driver_.handle_event()) {}
    servicing_ = false;
    unwritten_.add(driver_.take_output());
    if (!stream_ || unwritten_.write(*stream_)) unwritten_.clear(); // the reader learns of a problem, too
    auto next = driver_.next_event();
    if (unwritten_.size() > 0) next = std::min(next, ise::saturating_add(loop_.now(), write_again));
    if (next == ise::time_point::max()) wake_.disarm();
    else wake_.arm(std::max(next, loop_.now()));
}

void serial_pump::on_silence(const std::string& reason) {
    trouble_ = "the modem does not answer: " + reason;
    log_.warning(trouble_, {{"device", options_.port.device}});
}

} // namespace atirma
