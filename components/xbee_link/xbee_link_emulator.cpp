#include <components/xbee_link/xbee_link_emulator.hpp>

#include <components/boat/find_component.hpp>
#include <components/boat_simulator/services.hpp>

#include <asio/buffer.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace atirma {
namespace {
using namespace std::chrono_literals;
// Nobody reads the port: a modem without flow control loses bytes, too.
constexpr std::size_t max_unwritten_bytes = 64 * 1024;
constexpr ise::duration write_again = 20ms;
constexpr std::size_t shore = 0, boat = 1;
constexpr double full_power_dbm = 25;
} // namespace

struct xbee_link_emulator::side {
    side(const xbee_link_options::end& how, xbee::modem_options modem) : options(how), device(modem) {}
    const xbee_link_options::end& options;
    xbee::modem device;
    std::unique_ptr<ise::stream> line;
    outgoing unwritten;
    std::array<std::byte, 1024> buffer{};
};

xbee_link_emulator::xbee_link_emulator(xbee_link_options options)
    : options_(std::move(options)), loss_given_(options_.extra_loss) {}
xbee_link_emulator::~xbee_link_emulator() = default;

void xbee_link_emulator::change(const xbee_link_options& now) {
    if (now.extra_loss == loss_given_) return;
    loss_given_ = now.extra_loss;
    options_.extra_loss = now.extra_loss;
    if (air_) air_->set_extra_loss(options_.up ? options_.extra_loss : 1);
}

ise::task<> xbee_link_emulator::run() {
    if (!(options_.speedup >= 0.1 && options_.speedup <= 1000))
        throw ise::error(ise::errc::invalid_argument,
                         fmt::format("the speedup is 0.1 to 1000, not {:g}", options_.speedup));
    started_ = now();
    distance_m_ = options_.distance_m;
    xbee::ether_options air;
    air.seed = options_.seed;
    air_ = std::make_unique<xbee::ether>(air);
    for (std::size_t which : {shore, boat}) {
        const auto& how = which == shore ? options_.shore : options_.boat;
        xbee::modem_options modem;
        modem.address = how.address;
        modem.api_mode = how.api_mode;
        modem.seed = options_.seed + 1 + which;
        sides_[which] = std::make_unique<side>(how, modem);
        xbee::place at;
        at.x_m = which == shore ? 0 : distance_m_;
        air_->attach(sides_[which]->device, at);
    }
    due_ = std::make_unique<ise::timer>(on(), [this] { turn(); });
    xbee_air_request initial;
    initial.up = options_.up;
    initial.extra_loss = options_.extra_loss;
    control(initial);
    spawn("shore modem", serve(shore));
    spawn("boat modem", serve(boat));
    if (!options_.boat_path.empty()) listen_to_boat();
    provide(services::air_control, [this](const xbee_air_request& request) { return control(request); });
    publish_every(services::air, 1s, [this] { return state(); });
    co_return;
}

/// The serial line of one modem, for as long as the component lives.
ise::task<> xbee_link_emulator::serve(std::size_t which) {
    auto& s = *sides_[which];
    for (;;) {
        if (s.options.open) {
            s.line = std::move(s.options.open(on()).value());
        } else {
            auto made = env().open_pseudo_terminal(on(), s.options.port);
            s.line = std::move(made.value().far_end);
            log().info("a modem is ready",
                       {{"port", made->device}, {"address", fmt::format("{:016X}", s.options.address)}});
        }
        co_await read(which);
        // Who had opened it closed it: another pseudo-terminal under the same name, without what he left behind.
        s.line.reset();
        s.unwritten.clear();
        co_await sleep(10ms);
    }
}

ise::task<> xbee_link_emulator::read(std::size_t which) {
    auto& s = *sides_[which];
    for (;;) {
        auto got = co_await s.line->read_some(asio::buffer(s.buffer));
        if (got.bytes > 0) {
            air_->advance(model_now());
            s.device.on_serial(model_now(), ise::bytes_view(s.buffer).first(got.bytes));
            turn();
        }
        if (got.problem) co_return;
    }
}

// A boat that is not there (any more) stays where it was seen last.
void xbee_link_emulator::listen_to_boat() {
    auto follow = [](xbee_link_emulator& self, ise::remote whom) -> ise::task<> {
        for (;;) {
            try {
                auto options = ise::subscribe_options::keep_latest();
                auto truths = co_await whom.subscribe(services::truth, options);
                for (;;) {
                    auto truth = co_await truths.next();
                    if (!truth) break;
                    self.move_boat(truth->latitude_deg, truth->longitude_deg);
                }
            } catch (const ise::error& why) {
                // Also of a boat that stops meanwhile (cancelled): our own end throws at the next suspension.
                self.log().debug("the boat's position is not known", {{"cause", why.what()}});
            }
            co_await self.sleep(1s);
        }
    };
    require(services::truth);
    spawn("boat's position", follow(*this, find_component(*this, options_.boat_path)));
}

void xbee_link_emulator::move_boat(double latitude_deg, double longitude_deg) {
    constexpr double metres_per_degree = 111'195, radians_per_degree = 0.017453292519943295;
    const auto& home = options_.shore_position;
    xbee::place to;
    to.x_m = std::remainder(longitude_deg - home.longitude_deg, 360) * metres_per_degree *
             std::cos(home.latitude_deg * radians_per_degree);
    to.y_m = (latitude_deg - home.latitude_deg) * metres_per_degree;
    if (!std::isfinite(to.x_m) || !std::isfinite(to.y_m)) return;
    distance_m_ = std::hypot(to.x_m, to.y_m);
    air_->move(sides_[boat]->device, to);
}

/// Lets the model's time pass, and carries what it made.
void xbee_link_emulator::turn() {
    air_->advance(model_now());
    auto next = ise::time_point::max();
    for (auto& s : sides_) {
        auto more = s->device.take_serial();
        if (s->unwritten.size() + more.size() <= max_unwritten_bytes) s->unwritten.add(more);
        if (!s->line || s->unwritten.write(*s->line)) s->unwritten.clear();
        if (s->unwritten.size() > 0) next = std::min(next, ise::saturating_add(now(), write_again));
    }
    if (auto event = air_->next_event(); event != xbee::never) {
        auto after_s = std::chrono::duration<double>(event - model_now()).count() / options_.speedup;
        // Rounded up: just before the event there is nothing to do, again and again.
        auto after =
            std::chrono::duration_cast<ise::duration>(std::chrono::duration<double>(std::clamp(after_s, 0.0, 3600.0))) +
            10us;
        next = std::min(next, ise::saturating_add(now(), after));
    }
    if (next == ise::time_point::max()) due_->disarm();
    else due_->arm(next);
}

xbee_air xbee_link_emulator::control(const xbee_air_request& request) {
    if (request.extra_loss && !(*request.extra_loss >= 0 && *request.extra_loss <= 1))
        throw ise::error(ise::errc::refused, fmt::format("extra_loss is 0 to 1, not {:g}", *request.extra_loss));
    if (request.shore_temperature_c && !(*request.shore_temperature_c >= -40 && *request.shore_temperature_c <= 125))
        throw ise::error(ise::errc::refused,
                         fmt::format("a temperature is -40 to 125 °C, not {:g}", *request.shore_temperature_c));
    options_.up = request.up.value_or(options_.up);
    options_.extra_loss = request.extra_loss.value_or(options_.extra_loss);
    air_->set_extra_loss(options_.up ? options_.extra_loss : 1);
    if (request.shore_temperature_c) sides_[shore]->device.set_temperature(*request.shore_temperature_c);
    return state();
}

xbee_air xbee_link_emulator::state() {
    auto time = model_now();
    xbee_air result;
    result.up = options_.up;
    result.extra_loss = options_.extra_loss;
    result.distance_m = distance_m_;
    result.strength_dbm = air_->strength_dbm(full_power_dbm, std::max(1.0, distance_m_));
    result.shore_duty_percent = sides_[shore]->device.duty_percent(time);
    result.boat_duty_percent = sides_[boat]->device.duty_percent(time);
    result.delivered = air_->delivered();
    result.lost = air_->lost();
    result.collided = air_->collided();
    result.model_time_s = std::chrono::duration<double>(time).count();
    return result;
}

xbee::instant xbee_link_emulator::model_now() const {
    auto passed_s = std::chrono::duration<double>(now() - started_).count() * options_.speedup;
    return std::chrono::duration_cast<xbee::instant>(std::chrono::duration<double>(passed_s));
}

} // namespace atirma
