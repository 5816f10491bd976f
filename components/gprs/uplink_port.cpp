#include <components/gprs/uplink_port.hpp>

#include <ise/core/sleep.hpp>
#include <ise/net/connect.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>
#include <asio/ip/address.hpp>
#include <fmt/format.h>

#include <algorithm>

namespace atirma::gprs {
namespace {
using namespace std::chrono_literals;
constexpr std::size_t unwritten_at_most = 2048; // then what is new overtakes what is old here, not in the kernel
constexpr ise::duration write_again = 50ms;

port_options checked(ise::loop& on, port_options options) {
    auto kind = options.shore.kind;
    if (kind != ise::protocol::tcp && kind != ise::protocol::tls && kind != ise::protocol::udp)
        throw ise::error(ise::errc::invalid_argument,
                         fmt::format("the uplink goes over tcp, tls or udp, not to {}", options.shore.text()));
    if (kind == ise::protocol::tls && !options.security.tls)
        throw ise::error(
            ise::errc::invalid_argument,
            fmt::format("the uplink to {} requires a certificate of the boat: give the folder with ca.pem, "
                        "certificate.pem and key.pem with --tls FOLDER or ISE_TLS",
                        options.shore.text()));
    options.link.datagrams = options.shore.kind == ise::protocol::udp;
    options.link.token = on.env().random();
    return options;
}
} // namespace

uplink_port::uplink_port(ise::loop& on, ise::logger log, port_options options, std::uint16_t boot)
    : loop_(on), log_(std::move(log)), options_(checked(on, std::move(options))), link_(boot, options_.link),
      wake_(on, [this] { service(); }) {}

void uplink_port::put(ise::bytes raw) {
    link_.put(std::move(raw));
    service();
}

void uplink_port::put_sealed(ise::bytes raw) {
    link_.put_sealed(std::move(raw));
    service();
}

void uplink_port::set_power(bool on) {
    if (power_ == on) return;
    power_ = on;
    if (!on && (stream_ || socket_) && closing_.empty()) close("the modem has no power");
}

ise::task<> uplink_port::run() {
    auto pause = options_.min_retry;
    for (;;) {
        std::string problem;
        while (!power_) co_await ise::sleep_for(loop_, options_.min_retry);
        if (link_.counters().sessions == 0) log_.info("the uplink calls the shore", {{"shore", options_.shore.text()}});
        if (options_.shore.kind == ise::protocol::udp) problem = co_await serve_datagrams();
        else problem = co_await serve_stream();
        if (link_.answered()) pause = options_.min_retry;
        link_.closed();
        stream_.reset();
        socket_.reset();
        unwritten_.clear();
        unsent_.clear();
        wake_.disarm();
        if (problem != trouble_ && !problem.empty())
            log_.warning(problem, {{"shore", options_.shore.text()}}); // once, not with every attempt
        trouble_ = problem;
        co_await ise::sleep_for(loop_, pause);
        pause = std::min(2 * pause, options_.max_retry);
    }
}

/// Until the connection is gone; says why.
ise::task<std::string> uplink_port::serve_stream() {
    auto until = ise::saturating_add(loop_.now(), options_.connect_time);
    auto made = co_await ise::net::connect_until(loop_, options_.shore, until, options_.security);
    if (!made && made.error().code() == ise::errc::cancelled) co_return std::string();
    if (!made) co_return made.error().message();
    if (!power_) co_return std::string();
    stream_ = std::move(*made);
    closing_.clear();
    link_.opened(loop_.now());
    service();
    for (;;) {
        auto got = co_await stream_->read_some(asio::buffer(buffer_));
        if (got.bytes > 0) came(ise::bytes_view(buffer_).first(got.bytes));
        if (!closing_.empty()) co_return closing_;
        if (got.problem == asio::error::operation_aborted) co_return std::string(); // we were cancelled
        if (auto verdict = stream_->verdict()) co_return verdict->message();        // of the certificates
        if (got.problem == asio::error::eof) co_return "the shore closed the connection";
        if (got.problem) co_return fmt::format("the connection to the shore broke: {}", got.problem.message());
    }
}

ise::task<std::string> uplink_port::serve_datagrams() {
    ise::endpoint here;
    here.kind = ise::protocol::udp;
    here.host = options_.shore.host.find(':') == std::string::npos ? "0.0.0.0" : "::";
    auto made = loop_.env().open_datagram(loop_, here);
    if (!made) co_return made.error().message();
    socket_ = std::move(*made);
    closing_.clear();
    link_.opened(loop_.now());
    service();
    for (;;) {
        auto [problem, got] = co_await socket_->receive();
        if (!problem && from_shore(got->peer)) came(got->content);
        if (!closing_.empty()) co_return closing_;
        if (problem == asio::error::operation_aborted) co_return std::string();
        if (problem) co_return fmt::format("the socket of the uplink broke: {}", problem.message());
    }
}

// The address of a name is not known here.
bool uplink_port::from_shore(const ise::endpoint& peer) const {
    if (peer.port != options_.shore.port) return false;
    std::error_code is_name, other;
    auto wanted = asio::ip::make_address(options_.shore.host, is_name);
    return is_name || wanted == asio::ip::make_address(peer.host, other);
}

void uplink_port::came(ise::bytes_view bytes) {
    bool was = link_.answered();
    link_.on_bytes(loop_.now(), bytes);
    if (link_.answered() && !was) {
        trouble_.clear();
        log_.info("the shore acknowledges", {{"waiting", std::to_string(link_.waiting())}});
    }
    service();
}

void uplink_port::service() {
    if (servicing_ || (!stream_ && !socket_)) return;
    servicing_ = true;
    link_.on_time(loop_.now());
    while (auto what = link_.take_order())
        if (on_order) on_order(*what);
    servicing_ = false;
    if (stream_) write();
    else write_datagrams();
    if (auto why = link_.trouble(loop_.now()); why && closing_.empty()) return close(*why);
    bool full = unwritten_.size() > 0 || !unsent_.empty();
    wake_.arm(full ? ise::saturating_add(loop_.now(), write_again) : link_.next_event());
}

void uplink_port::write() {
    for (;;) {
        while (unwritten_.size() < unwritten_at_most) {
            auto text = link_.take_text(loop_.now());
            if (text.empty()) break;
            unwritten_.add(text);
        }
        if (unwritten_.size() == 0) return;
        auto problem = unwritten_.write(*stream_);
        if (problem) return unwritten_.clear(); // the reader learns it, too
        if (unwritten_.size() > 0) return;
    }
}

void uplink_port::write_datagrams() {
    for (;;) {
        if (unsent_.empty()) unsent_ = link_.take_text(loop_.now());
        if (unsent_.empty()) return;
        auto problem = socket_->try_send(options_.shore, ise::as_bytes(unsent_));
        if (problem == asio::error::would_block) return;
        if (problem)
            trouble_ =
                fmt::format("cannot send to {}: {}", options_.shore.text(), problem.message()); // it is sent again
        unsent_.clear();
    }
}

void uplink_port::close(std::string why) {
    closing_ = std::move(why);
    wake_.disarm();
    if (stream_) stream_->close();
    else socket_->close();
}

} // namespace atirma::gprs
