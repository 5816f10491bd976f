#include <components/xbee/modem_port.hpp>

#include <ise/core/sleep.hpp>

#include <asio/error.hpp>
#include <fmt/format.h>

#include <algorithm>

namespace atirma::xbee {
namespace {
// A line that takes no more is asked again after this long: at 9600 baud twenty bytes have left by then.
constexpr instant write_again = std::chrono::milliseconds(20);
} // namespace

modem_port::modem_port(ise::loop& on, ise::logger log, port_options options)
    : loop_(on), log_(std::move(log)), options_(std::move(options)), client_(options_.client), wake_(on, [this] {
          client_.on_time(now());
          service();
      }) {}

ise::result<token> modem_port::send(std::uint64_t destination, ise::bytes payload, ise::duration timeout) {
    auto accepted = client_.send(now(), destination, std::move(payload), 0, timeout);
    service();
    return accepted;
}

ise::result<token> modem_port::local_at(at_name command, ise::bytes parameter) {
    auto accepted = client_.local_at(now(), command, std::move(parameter));
    service();
    return accepted;
}

ise::task<> modem_port::run() {
    auto pause = options_.min_retry;
    for (;;) {
        ise::serial_options wanted;
        wanted.device = options_.device;
        wanted.baud = options_.baud;
        wanted.hardware_flow_control = options_.hardware_flow_control;
        auto opened = loop_.env().open_serial(loop_, wanted);
        std::string problem;
        if (opened) {
            stream_ = std::move(*opened);
            ++openings_;
            trouble_ = "the modem has not answered yet";
            log_.info("serial port opened", {{"device", options_.device}});
            client_.start(now());
            service();
            auto opened_at = loop_.now();
            problem = co_await serve();
            client_.stop(now(), problem);
            stream_.reset();
            unwritten_.clear();
            if (loop_.now() - opened_at > options_.max_retry) pause = options_.min_retry;
        } else {
            problem = opened.error().message();
        }
        bool stopping = problem == "serial port closed";
        if (problem != trouble_ && !stopping)
            log_.warning(problem, {{"device", options_.device}}); // once, not with every attempt
        trouble_ = problem;
        service();
        co_await ise::sleep_for(loop_, pause);
        pause = std::min(pause * 2, options_.max_retry);
    }
}

/// Reads until the port is gone; says why.
ise::task<std::string> modem_port::serve() {
    for (;;) {
        auto got = co_await stream_->read_some(asio::buffer(buffer_));
        if (got.bytes > 0) {
            client_.on_bytes(now(), ise::bytes_view(buffer_).first(got.bytes));
            service();
        }
        if (got.problem == asio::error::operation_aborted) co_return "serial port closed"; // we were cancelled
        if (got.problem == asio::error::eof) co_return fmt::format("serial port {} is gone", options_.device);
        if (got.problem) co_return fmt::format("serial port {} is gone: {}", options_.device, got.problem.message());
    }
}

// Events may ask for more, which makes more output: all of it in one go, however deep it began.
void modem_port::service() {
    if (servicing_) return;
    servicing_ = true;
    while (auto event = client_.take_event()) {
        on_own_event(*event);
        if (on_event) on_event(*event);
    }
    servicing_ = false;
    write();
    auto next = client_.next_event();
    if (!unwritten_.empty()) next = std::min(next, now() + write_again);
    if (next == never) wake_.disarm();
    else wake_.arm(ise::time_point(std::max(next, now())));
}

void modem_port::on_own_event(const client_event& event) {
    if (std::holds_alternative<radio_ready>(event)) {
        trouble_.clear();
        log_.info("the modem answers", {{"api_mode", std::to_string(static_cast<int>(client_.mode()))}});
    } else if (const auto* silent = std::get_if<radio_silent>(&event)) {
        trouble_ = "the modem does not answer: " + silent->reason;
        log_.warning(trouble_, {{"device", options_.device}});
    } else if (const auto* restarted = std::get_if<modem_restarted>(&event)) {
        log_.warning("the modem restarted", {{"status", std::to_string(restarted->status)}});
    }
}

void modem_port::write() {
    auto more = client_.take_output();
    unwritten_.insert(unwritten_.end(), more.begin(), more.end());
    while (stream_ && !unwritten_.empty()) {
        asio::const_buffer rest(unwritten_.data(), unwritten_.size());
        auto moved = stream_->try_write(std::span(&rest, 1));
        if (moved.problem && moved.problem != asio::error::would_block) {
            unwritten_.clear(); // the reader learns it, too
            return;
        }
        if (moved.bytes == 0) return;
        unwritten_.erase(unwritten_.begin(), unwritten_.begin() + static_cast<std::ptrdiff_t>(moved.bytes));
    }
    if (!stream_) unwritten_.clear();
}

} // namespace atirma::xbee
