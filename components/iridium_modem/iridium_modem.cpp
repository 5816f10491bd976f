#include <components/iridium_modem/iridium_modem.hpp>

#include <components/boat/find_component.hpp>

#include <asio/buffer.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma {
namespace {
using namespace std::chrono_literals;
constexpr std::size_t max_unwritten_bytes = 16 * 1024; // nobody reads the port
constexpr ise::duration write_again = 20ms;
constexpr ise::duration gateway_time = 20s;
constexpr int radio_failures[] = {18, 32, 36, 17, 38}; // how sessions fail on the way

double in_range(const char* what, double value, double low, double high) {
    if (value >= low && value <= high) return value; // not a number fails
    throw ise::error(ise::errc::refused, fmt::format("{} is {:g} to {:g}, not {:g}", what, low, high, value));
}
} // namespace

iridium_modem::iridium_modem(iridium_modem_options options) : options_(std::move(options)), dice_(options_.seed) {}
iridium_modem::~iridium_modem() = default;

ise::task<> iridium_modem::run() {
    if (auto good = iridium::check_imei(options_.imei); !good) throw ise::error(good.error());
    in_range("the length of a session in s", options_.min_session_s, 0, 600);
    in_range("the length of a session in s", options_.max_session_s, options_.min_session_s, 600);
    modem_ = std::make_unique<modem_9602>(options_.imei);
    due_ = std::make_unique<ise::timer>(on(), [this] {
        modem_->on_time(now());
        turn();
    });
    iridium_sky_request initial;
    initial.free = options_.sky_free;
    initial.failures = options_.failures;
    control(initial);
    spawn("serial line", serve());
    if (!options_.gateway.empty()) {
        require(services::sbd_session);
        require(services::sbd_ring);
        spawn("ring alerts", hear_rings(find_component(*this, options_.gateway)));
    }
    provide(services::iridium_sky_control, [this](const iridium_sky_request& request) { return control(request); });
    publish_every(services::iridium_sky, 1s, [this] { return sky(); });
    co_return;
}

/// The serial line, for as long as the component lives.
ise::task<> iridium_modem::serve() {
    for (;;) {
        if (options_.open) {
            line_ = std::move(options_.open(on()).value());
        } else {
            auto made = env().open_pseudo_terminal(on(), options_.port);
            line_ = std::move(made.value().far_end);
            log().info("a modem is ready", {{"port", made->device}, {"imei", options_.imei}});
        }
        for (;;) {
            auto got = co_await line_->read_some(asio::buffer(buffer_));
            if (got.bytes > 0) {
                told_.port_in_use = true;
                modem_->on_serial(now(), ise::bytes_view(buffer_).first(got.bytes));
                turn();
            }
            if (got.problem) break;
        }
        // Who had opened it closed it: another pseudo-terminal under the same name, without what he left behind.
        line_.reset();
        unwritten_.clear();
        told_.port_in_use = false;
        co_await sleep(10ms);
    }
}

void iridium_modem::turn() {
    if (auto wanted = modem_->take_session()) spawn("session", hold_session(std::move(*wanted)));
    auto more = modem_->take_serial();
    if (unwritten_.size() + more.size() <= max_unwritten_bytes) unwritten_.add(more);
    if (!line_ || unwritten_.write(*line_)) unwritten_.clear();
    auto next = modem_->next_event();
    if (unwritten_.size() > 0) next = std::min(next, ise::saturating_add(now(), write_again));
    if (next == ise::time_point::max()) due_->disarm();
    else due_->arm(next);
}

ise::task<> iridium_modem::hold_session(modem_9602::session what) {
    ++told_.sessions;
    co_await sleep(std::chrono::duration_cast<ise::duration>(
        std::chrono::duration<double>(dice_.between(options_.min_session_s, options_.max_session_s))));
    iridium::sbdix result;
    ise::bytes message;
    bool sent_something = !what.message.empty();
    if (!told_.free || options_.gateway.empty()) result.mo_status = 32;
    else if (fail_next_ != 0) result.mo_status = std::exchange(fail_next_, 0);
    else if (dice_.chance(told_.failures)) result.mo_status = radio_failures[dice_.next() % std::size(radio_failures)];
    if (result.mo_status == 0) {
        sbd_session_request request;
        request.imei = options_.imei;
        request.momsn = what.momsn;
        request.data = std::move(what.message);
        request.received_mtmsn = what.received_mtmsn;
        auto gateway = find_component(*this, options_.gateway);
        auto reply = co_await gateway.try_call(services::sbd_session, request, gateway_time);
        if (reply) {
            result.mo_status = reply->mo_status;
            result.mt_status = reply->mt_status;
            result.mtmsn = reply->mtmsn;
            result.mt_queued = reply->mt_queued;
            message = std::move(reply->data);
        } else {
            if (reply.error().code() == ise::errc::cancelled) co_return;
            result.mo_status = reply.error().executed() == ise::execution::unknown ? 18 : 17;
            log().info("the gateway is not reached", {{"cause", reply.error().message()}});
        }
    }
    if (!result.mo_arrived()) {
        ++told_.sessions_failed;
        result.mt_status = 2;
    } else if (sent_something) {
        ++told_.messages_sent;
    }
    if (result.mt_status == 1) ++told_.messages_received;
    result.momsn = modem_->next_momsn();
    told_.last_session =
        fmt::format("{} ({})", iridium::encode_sbdix(result), iridium::explain_mo_status(result.mo_status));
    modem_->end_session(result, std::move(message));
    turn();
}

ise::task<> iridium_modem::hear_rings(ise::remote gateway) {
    for (;;) {
        try {
            auto rings = co_await gateway.subscribe(services::sbd_ring);
            for (;;) {
                auto alert = co_await rings.next();
                if (!alert) break;
                if (alert->imei != options_.imei || !told_.free) continue;
                ++told_.rings;
                modem_->ring();
                turn();
            }
        } catch (const ise::error& why) {
            // Also of a gateway that stops meanwhile (cancelled): our own end throws at the next suspension.
            log().debug("no ring alerts come", {{"cause", why.what()}});
        }
        co_await sleep(1s);
    }
}

iridium_sky iridium_modem::control(const iridium_sky_request& request) {
    auto failures = in_range("failures", request.failures.value_or(told_.failures), 0, 1);
    int status = request.fail_next.value_or(fail_next_);
    if (status != 0) in_range("fail_next", status, 10, 65);
    told_.failures = failures;
    told_.free = request.free.value_or(told_.free);
    fail_next_ = status;
    modem_->signal_bars = told_.free ? 5 : 0;
    return sky();
}

iridium_sky iridium_modem::sky() const {
    auto now_told = told_;
    now_told.momsn = modem_->next_momsn();
    return now_told;
}

} // namespace atirma
