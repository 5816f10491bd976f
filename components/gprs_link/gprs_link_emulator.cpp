#include <components/gprs_link/gprs_link_emulator.hpp>

#include <components/gprs_link/datagram_relay.hpp>
#include <components/gprs_link/stream_relay.hpp>

#include <fmt/format.h>

#include <charconv>

namespace atirma {
namespace {
using namespace std::chrono_literals;

ise::duration seconds(double count) {
    return std::chrono::duration_cast<ise::duration>(std::chrono::duration<double>(count));
}

void check(const char* what, const std::optional<double>& value, double most, ise::errc kind) {
    if (!value || (*value >= 0 && *value <= most)) return; // not a number fails
    throw ise::error(kind, fmt::format("{} is 0 to {:g}, not {:g}", what, most, *value));
}

void check(const carrier_request& request, ise::errc kind) {
    check("outage_s", request.outage_s, 86400, kind);
    check("delay_s", request.delay_s, 600, kind);
    check("jitter_s", request.jitter_s, 600, kind);
    check("loss", request.loss, 1, kind);
}

struct window {
    double start_s = 0, length_s = 0;
};
window parse_outage(const std::string& text) {
    window made;
    const auto* last = text.data() + text.size();
    auto [plus, no_start] = std::from_chars(text.data(), last, made.start_s);
    bool good = no_start == std::errc{} && plus != last && *plus == '+';
    if (good) {
        auto [end, no_length] = std::from_chars(plus + 1, last, made.length_s);
        good = no_length == std::errc{} && end == last;
    }
    if (!good || !(made.start_s >= 0 && made.start_s <= 1e6 && made.length_s > 0 && made.length_s <= 86400))
        throw ise::error(ise::errc::invalid_argument,
                         fmt::format("'{}' is not an outage: its start and length in seconds, such as 120+60", text));
    return made;
}
} // namespace

struct gprs_link_emulator::carrying {
    carrying(gprs_link_emulator& self, const gprs_link_options& options)
        : air(options.seed),
          streams(self.on(), self.log(), air, ise::endpoint::parse(options.proxy_tcp).value(), spawner(self)),
          datagrams(self.on(), self.log(), air, ise::endpoint::parse(options.proxy_udp).value(), spawner(self)),
          up_again(self.on(), [this, &self] {
              until = ise::time_point::max();
              self.switch_to(true);
          }) {}
    static std::function<void(std::string, ise::task<>)> spawner(gprs_link_emulator& self) {
        return [&self](std::string name, ise::task<> body) { self.spawn(std::move(name), std::move(body)); };
    }

    carrier_air air;
    stream_relay streams;
    datagram_relay datagrams;
    std::vector<ise::endpoint> listening;
    ise::timer up_again;
    ise::time_point until = ise::time_point::max(); // of an outage
};

gprs_link_emulator::gprs_link_emulator(gprs_link_options options) : options_(std::move(options)) {}
gprs_link_emulator::~gprs_link_emulator() = default;

ise::task<> gprs_link_emulator::run() {
    carrier_request initial;
    initial.up = options_.up;
    initial.delay_s = options_.delay_s;
    initial.jitter_s = options_.jitter_s;
    initial.loss = options_.loss;
    check(initial, ise::errc::invalid_argument);
    std::vector<window> windows;
    for (const auto& text : options_.outages) windows.push_back(parse_outage(text));
    for (const auto& [text, kind] :
         {std::pair(options_.proxy_tcp, ise::protocol::tcp), std::pair(options_.proxy_udp, ise::protocol::udp)})
        if (ise::endpoint::parse(text).value().kind != kind)
            throw ise::error(ise::errc::invalid_argument,
                             fmt::format("{} is no {} endpoint of a proxy", text, ise::name_of(kind)));
    carrying_ = std::make_unique<carrying>(*this, options_);
    control(initial);
    listen();
    for (const auto& one : windows)
        spawn("outage", hold(ise::saturating_add(now(), seconds(one.start_s)), seconds(one.length_s)));
    provide(services::carrier_control, [this](const carrier_request& request) { return control(request); });
    publish_every(services::carrier, 1s, [this] { return state(); });
    if (options_.on_listening) options_.on_listening(carrying_->listening);
    co_return;
}

ise::task<> gprs_link_emulator::hold(ise::time_point from, ise::duration length) {
    co_await sleep_till(from);
    carrier_request request;
    request.outage_s = std::chrono::duration<double>(length).count();
    control(request);
}

void gprs_link_emulator::listen() {
    auto& c = *carrying_;
    for (const auto& text : options_.listen) {
        auto at = ise::endpoint::parse(text).value();
        if (at.kind == ise::protocol::tcp) c.listening.push_back(c.streams.open(at).value());
        else if (at.kind == ise::protocol::udp) c.listening.push_back(c.datagrams.open(at).value());
        else
            throw ise::error(ise::errc::invalid_argument,
                             fmt::format("a boat calls over tcp or udp, not {}: such as tcp://127.0.0.1:0", text));
        log().info("the boat can call", {{"at", c.listening.back().text()}});
    }
}

carrier_state gprs_link_emulator::control(const carrier_request& request) {
    check(request, ise::errc::refused);
    auto& c = *carrying_;
    if (request.delay_s) c.air.delay = seconds(*request.delay_s);
    if (request.jitter_s) c.air.jitter = seconds(*request.jitter_s);
    if (request.loss) c.air.loss = *request.loss;
    if (request.drop || request.change_address) c.streams.drop_all();
    if (request.change_address) {
        c.datagrams.change_addresses();
        ++c.air.address_changes;
    }
    if (request.half_open) {
        c.streams.freeze_all();
        c.datagrams.freeze_all();
    }
    if (request.up || request.outage_s) {
        c.up_again.disarm();
        c.until = ise::time_point::max();
    }
    if (request.outage_s && *request.outage_s > 0) {
        c.until = ise::saturating_add(now(), seconds(*request.outage_s));
        c.up_again.arm(c.until);
        switch_to(false);
    } else if (request.up || request.outage_s) {
        switch_to(request.up.value_or(true));
    }
    return state();
}

void gprs_link_emulator::switch_to(bool up) {
    auto& c = *carrying_;
    if (c.air.up != up) log().info(up ? "the carrier is up" : "the carrier is down");
    c.air.up = up;
    c.streams.look_again();
}

carrier_state gprs_link_emulator::state() {
    auto& c = *carrying_;
    carrier_state result;
    for (const auto& at : c.listening) result.listening.push_back(at.text());
    result.up = c.air.up;
    if (c.until != ise::time_point::max())
        result.outage_left_s = std::chrono::duration<double>(c.until - now()).count();
    result.delay_s = std::chrono::duration<double>(c.air.delay).count();
    result.jitter_s = std::chrono::duration<double>(c.air.jitter).count();
    result.loss = c.air.loss;
    result.connections = c.streams.calls() + c.datagrams.flows();
    result.half_open = c.streams.frozen() + c.datagrams.frozen();
    result.turned_away = c.air.turned_away;
    result.dropped = c.air.dropped;
    result.address_changes = c.air.address_changes;
    result.bytes_up = c.air.bytes_up;
    result.bytes_down = c.air.bytes_down;
    result.datagrams_lost = c.air.datagrams_lost;
    result.held_bytes = c.streams.held();
    return result;
}

} // namespace atirma
