#include <components/iridium/sbd_port.hpp>

#include <ise/core/sleep.hpp>

#include <asio/error.hpp>
#include <fmt/format.h>

#include <algorithm>

namespace atirma::iridium {
namespace {
constexpr ise::duration write_again = std::chrono::milliseconds(20); // a line that takes no more
}

sbd_port::sbd_port(ise::loop& on, ise::logger log, sbd_port_options options)
    : loop_(on), log_(std::move(log)), options_(std::move(options)), client_(options_.client), wake_(on, [this] {
          client_.on_time(loop_.now());
          service();
      }) {}

ise::result<void> sbd_port::send(ise::bytes message) {
    auto taken = client_.send(loop_.now(), std::move(message));
    service();
    return taken;
}

void sbd_port::check() {
    client_.check(loop_.now());
    service();
}

ise::task<> sbd_port::run() {
    auto pause = options_.min_retry;
    for (;;) {
        ise::serial_options wanted;
        wanted.device = options_.device;
        wanted.baud = options_.baud;
        auto opened = loop_.env().open_serial(loop_, wanted);
        std::string problem;
        if (opened) {
            stream_ = std::move(*opened);
            trouble_ = "the modem has not answered yet";
            log_.info("serial port opened", {{"device", options_.device}});
            auto opened_at = loop_.now();
            client_.start(opened_at);
            service();
            problem = co_await serve();
            client_.stop();
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
ise::task<std::string> sbd_port::serve() {
    for (;;) {
        auto got = co_await stream_->read_some(asio::buffer(buffer_));
        if (got.bytes > 0) {
            client_.on_bytes(loop_.now(), ise::bytes_view(buffer_).first(got.bytes));
            service();
        }
        if (got.problem == asio::error::operation_aborted) co_return "serial port closed"; // we were cancelled
        if (got.problem == asio::error::eof) co_return fmt::format("serial port {} is gone", options_.device);
        if (got.problem) co_return fmt::format("serial port {} is gone: {}", options_.device, got.problem.message());
    }
}

// Events may ask for more, which makes more output: all of it in one go, however deep it began.
void sbd_port::service() {
    if (servicing_) return;
    servicing_ = true;
    while (auto event = client_.take_event()) {
        note(*event);
        if (on_event) on_event(*event);
    }
    servicing_ = false;
    write();
    auto next = client_.next_event();
    if (!unwritten_.empty()) next = std::min(next, ise::saturating_add(loop_.now(), write_again));
    if (next == ise::time_point::max()) wake_.disarm();
    else wake_.arm(std::max(next, loop_.now()));
}

void sbd_port::note(const sbd_event& event) {
    if (const auto* ready = std::get_if<sbd_ready>(&event)) {
        trouble_.clear();
        log_.info("the modem answers", {{"imei", ready->imei}});
    } else if (const auto* silent = std::get_if<sbd_silent>(&event)) {
        trouble_ = "the modem does not answer: " + silent->reason;
        log_.warning(trouble_, {{"device", options_.device}});
    } else if (const auto* lost = std::get_if<sbd_gave_up>(&event)) {
        log_.warning(lost->message ? "a message was given up" : "looking for messages was given up",
                     {{"cause", lost->reason}});
    }
}

void sbd_port::write() {
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

} // namespace atirma::iridium
