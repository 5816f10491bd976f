// The tracking page with a scripted boat on course T1, without any of the middleware.
// page_preview [port [empty|ocean]]: prints "listening on URL", then obeys lines on stdin: silence, resume,
// receiver off, receiver on, nodes off, nodes on, rough, estimate, close (the server stops listening), open,
// quit. The end of stdin is quit too. A second boat, Vela, came 45 minutes ago and lies at anchor, unless `empty`.
// `ocean`: a track of 3000 fixes from the Canaries to the Caribbean by Iridium, every ten minutes, with an outage of
// two days.
#include <components/web_server/assets.hpp>
#include <components/web_server/downloads.hpp>
#include <components/web_server/page_data.hpp>
#include <components/web_server/track_state.hpp>
#include <components/web_server/web_component.hpp>
#include <ise/http/http_server.hpp>

#include <ise/core/real/environment.hpp>
#include <ise/core/task_scope.hpp>

#include <asio/io_context.hpp>
#include <asio/posix/stream_descriptor.hpp>
#include <asio/read_until.hpp>
#include <asio/steady_timer.hpp>
#include <asio/streambuf.hpp>

#include <fmt/format.h>

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <istream>
#include <numbers>
#include <string_view>

using namespace std::chrono_literals;

namespace {

atirma::utc_ms wall_clock() { return std::chrono::floor<std::chrono::milliseconds>(std::chrono::system_clock::now()); }

/// Sails round the triangle: pointing where it can, tacking where it cannot.
class scripted_boat {
public:
    scripted_boat(atirma::track_state& state, atirma::utc_ms start) : state_(state), time_(start) {
        course_ = {{28.1530, -15.4480, "Confital E"}, {28.1600, -15.4520, "La Isleta"}, {28.1545, -15.4580, "Bahía"}};
    }

    template <class Publish>
    void step(std::chrono::milliseconds dt, std::string source, Publish publish) {
        time_ += dt;
        double seconds = static_cast<double>(time_.time_since_epoch().count() % 100'000'000) / 1000;
        double wind_from = 28 + 9 * std::sin(seconds / 210) + 4 * std::sin(seconds / 37);
        double wind_mps = 6.4 + 1.6 * std::sin(seconds / 160) + 0.9 * std::sin(seconds / 23);
        const auto& target = course_[active_];
        if (atirma::distance_m(latitude_, longitude_, target.latitude_deg, target.longitude_deg) < 40)
            active_ = (active_ + 1) % course_.size();
        double wanted =
            atirma::bearing_deg(latitude_, longitude_, course_[active_].latitude_deg, course_[active_].longitude_deg);
        double off = std::remainder(wanted - wind_from, 360);
        if (std::abs(off) < 48) {
            if (std::abs(off) > 30) tack_ = off > 0 ? 1 : -1;
            if (++on_tack_ > 170) tack_ = -tack_, on_tack_ = 0;
            wanted = wind_from + 50 * tack_;
        }
        heading_ += std::clamp(std::remainder(wanted - heading_, 360), -9.0, 9.0);
        double angle = std::abs(std::remainder(heading_ - wind_from, 360));
        double speed =
            std::max(0.25, wind_mps * 0.27 * std::sin(std::min(angle, 135.0) * 0.75 * std::numbers::pi / 180));
        double cog = heading_ + 3 * std::sin(seconds / 11);
        double moved = speed * static_cast<double>(dt.count()) / 1000;
        latitude_ += moved * std::cos(cog * std::numbers::pi / 180) / 111195;
        longitude_ +=
            moved * std::sin(cog * std::numbers::pi / 180) / 111195 / std::cos(latitude_ * std::numbers::pi / 180);

        atirma::report_origin from{time_, time_, std::move(source), false};
        auto relative = std::remainder(wind_from - heading_, 360) * std::numbers::pi / 180;
        double ahead = wind_mps * std::cos(relative) + speed, across = wind_mps * std::sin(relative);
        if (!no_wind)
            publish(state_.apply(atirma::wind_update{from, std::atan2(across, ahead) * 180 / std::numbers::pi,
                                                     std::hypot(ahead, across), wind_from, wind_mps},
                                 time_));
        publish(state_.apply(
            atirma::navigation_update{
                .from = from,
                .heading_deg = heading_,
                .heel_deg = -std::copysign(4 + 2.1 * wind_mps * std::abs(std::sin(relative)), std::sin(relative)),
                .active_waypoint = active_},
            time_));
        publish(state_.apply(atirma::position_update{.from = from,
                                                     .latitude_deg = latitude_,
                                                     .longitude_deg = longitude_,
                                                     .speed_over_ground_mps = speed,
                                                     .course_over_ground_deg = cog,
                                                     .circular_error_m = rough ? std::optional(420.0) : std::nullopt,
                                                     .satellites = 9},
                             time_));
    }

    template <class Publish>
    void tell_course(Publish publish) {
        atirma::report_origin from{time_, time_, "xbee", false};
        publish(state_.apply(atirma::waypoints_update{from, course_, active_, true}, time_));
        publish(state_.apply(atirma::mode_update{from, "automatic"}, time_));
        publish(state_.apply(atirma::power_update{from, 12.7, 0.8, 83.0}, time_));
        publish(state_.apply(atirma::signal_update{from, "xbee", -71.0}, time_));
    }

    atirma::utc_ms time() const { return time_; }
    bool rough = false, no_wind = false;

private:
    atirma::track_state& state_;
    atirma::utc_ms time_;
    std::vector<atirma::track_waypoint> course_;
    std::size_t active_ = 1;
    double latitude_ = 28.1532, longitude_ = -15.4483, heading_ = 60;
    int tack_ = 1, on_tack_ = 0;
};

/// 3000 fixes, one every ten minutes, from Gran Canaria to Barbados along the trade wind.
void cross(atirma::track_state& state, atirma::utc_ms now) {
    constexpr int fixes = 3000;
    atirma::configuration result;
    result.telemetry_period_s = {0, 0, 600};
    state.on_configuration(result);
    for (int i = 0; i < fixes; ++i) {
        auto at = now - 30s - (fixes - 1 - i) * 10min;
        if (i > 1800 && i < 2088) continue; // two days without a report
        double part = static_cast<double>(i) / (fixes - 1), swell = std::sin(i / 7.0);
        atirma::report_origin from{at, at + 20s, "iridium", false};
        state.on_report(atirma::link_id::iridium, at);
        state.apply(atirma::wind_update{from, 150, 5 + swell, 65 + 8 * swell, 7.5 + 1.5 * std::sin(i / 40.0)},
                    at + 20s);
        state.apply(atirma::navigation_update{.from = from, .heading_deg = 255 + 6 * swell, .heel_deg = 9 + 4 * swell},
                    at + 20s);
        state.apply(atirma::power_update{from, 12.4 + 0.5 * std::sin(i / 23.0), 0.4, 70 + 25 * std::sin(i / 23.0)},
                    at + 20s);
        state.apply(atirma::position_update{.from = from,
                                            .latitude_deg = 27.9 - 14.8 * part + 0.3 * std::sin(i / 90.0),
                                            .longitude_deg = -15.7 - 43.9 * part,
                                            .speed_over_ground_mps = 2.5 + 0.6 * swell,
                                            .course_over_ground_deg = 254.0 + 5 * swell,
                                            .satellites = 8},
                    at + 20s);
    }
    atirma::report_origin from{now - 30s, now - 10s, "iridium", false};
    state.apply(atirma::waypoints_update{from, {{13.1, -59.62, "Barbados"}, {14.0, -61.0, "Saint Lucia"}}, 1, false},
                now);
    state.apply(atirma::mode_update{from, "automatic"}, now);
    state.apply(atirma::feed_update{"iridium", true, now - 24h, "", true, std::nullopt}, now);
}

ise::http_response json_text(std::string text) {
    return ise::http_response{std::move(text), "application/json; charset=utf-8"};
}

} // namespace

int main(int argc, char** argv) {
    asio::io_context context(1);
    ise::real_environment env;
    auto host = env.adopt(context.get_executor(), true);
    ise::task_scope scope(host->loop(), [](const std::string&, std::exception_ptr) {});
    atirma::track_options track;
    track.epoch = fmt::format("{:x}", wall_clock().time_since_epoch().count());
    track.status_period = 1s;
    atirma::track_state state(track);
    auto port = static_cast<std::uint16_t>(argc > 1 ? std::atoi(argv[1]) : 0);
    ise::endpoint address{ise::protocol::tcp, "127.0.0.1", port, {}};

    std::unique_ptr<ise::http_server> server;
    ise::sse_channel *events = nullptr, *named = nullptr;
    std::string_view scene = argc > 2 ? argv[2] : "";
    bool empty = scene == "empty", ocean = scene == "ocean";
    atirma::track_options other = track;
    other.boat = "Vela";
    other.id = "vela";
    atirma::track_state vela(other);
    auto fleet = [&] {
        auto one = [](const atirma::track_state& of) {
            auto& at = of.position();
            return fmt::format(R"({{"id":"{}","name":"{}","stale_after_s":{},"position":{}}})", of.options().id,
                               of.options().boat, of.position_limits().stale_s,
                               at ? fmt::format(R"({{"latitude_deg":{},"longitude_deg":{},"measured_at":{}}})",
                                                at->latitude_deg, at->longitude_deg,
                                                at->from.measured_at.time_since_epoch().count())
                                  : "null");
        };
        return fmt::format(R"({{"now":{},"boats":[{}{}{}]}})", wall_clock().time_since_epoch().count(), one(state),
                           empty ? "" : ",", empty ? "" : one(vela));
    };
    auto open = [&] {
        server = std::make_unique<ise::http_server>(
            host->loop(), ise::logger(), atirma::page_limits(),
            [&](std::string name, ise::task<> body) { scope.spawn(std::move(name), std::move(body)); });
        server->serve(atirma::page_assets());
        server->serve_as("/embed", "/index.html", true);
        for (auto& [prefix, one] :
             {std::pair<std::string, atirma::track_state&>{"", state}, {"/a-tirma", state}, {"/vela", vela}}) {
            atirma::page_extras extras;
            if (!empty && !ocean) extras.boats = fleet;
            atirma::offer_page_data(*server, prefix, one, wall_clock, std::move(extras));
            atirma::offer_downloads(*server, prefix, one, nullptr, wall_clock);
        }
        for (auto id : {"", "a-tirma", "vela"}) atirma::offer_page(*server, id);
        server->get("/boats.json", [&](const auto&) { return json_text(fleet()); });
        server->get("/state.json", [&](const auto&) { return json_text(state.snapshot(wall_clock()).data); });
        auto snapshot = [&](std::string_view last) { return state.snapshot(wall_clock(), last); };
        events = &server->events("/events", snapshot);
        named = &server->events("/a-tirma/events", snapshot);
        server->events("/vela/events", [&](std::string_view last) { return vela.snapshot(wall_clock(), last); });
        server->listen(address).value();
        address = server->where();
    };
    auto close = [&] {
        events = named = nullptr;
        server.reset();
    };
    open();
    auto publish = [&](std::optional<ise::sse_event> event) {
        for (auto* stream : {events, named})
            if (event && stream) stream->publish(*event);
    };
    auto tell_feed = [&](const char* source, bool connected, const char* detail, bool link = true) {
        publish(state.apply(atirma::feed_update{source, connected, wall_clock(), detail, link, std::nullopt},
                            wall_clock()));
    };
    // Where the Iridium gateway believes the boat to be.
    auto estimate = [&](atirma::utc_ms at, double latitude, double longitude, double error_m) {
        atirma::position_update fix;
        fix.from = {at, at, "iridium", false};
        fix.latitude_deg = latitude;
        fix.longitude_deg = longitude;
        fix.circular_error_m = error_m;
        publish(state.apply(fix, at));
    };

    // An hour and a half of the past, then as time goes; or a boat that was never heard, until "resume".
    auto vela_at = [&](atirma::utc_ms at, double latitude_deg, double longitude_deg) {
        vela.apply(atirma::position_update{.from = {at, at, "gprs", false},
                                           .latitude_deg = latitude_deg,
                                           .longitude_deg = longitude_deg,
                                           .speed_over_ground_mps = 0.1},
                   at);
    };
    auto moor = [&] { vela_at(wall_clock() - 2s, 28.1505, -15.4408); };
    scripted_boat boat(state, wall_clock() - (empty || ocean ? 1s : 90min));
    if (ocean) cross(state, wall_clock());
    for (int step = 0; !empty && !ocean && boat.time() < wall_clock() - 4s; ++step) {
        boat.step(4s, step % 400 < 250 ? "xbee" : "gprs", publish);
        if (step % 430 == 300)
            estimate(boat.time() + 2s, 28.1522 + 0.0037 * (step / 430 % 3), -15.4575 + 0.0052 * (step / 430 % 2),
                     480 + 130 * (step / 430 % 3));
    }
    if (!empty && !ocean) {
        boat.tell_course(publish);
        for (auto link : {"xbee", "gprs", "iridium"}) tell_feed(link, true, "");
        tell_feed("communication", true, "node-1, backed by node-2", false);
        vela_at(wall_clock() - 45min, 28.1560, -15.4350); // from where it came to its anchorage
        moor();
    }

    bool silent = empty || ocean;
    asio::steady_timer timer(context);
    std::function<void()> tick = [&] {
        timer.expires_after(1s);
        timer.async_wait([&](std::error_code stopped) {
            if (stopped) return;
            if (!silent) {
                boat.step(wall_clock() - boat.time(), "xbee", publish);
                boat.tell_course(publish);
            }
            publish(state.status(wall_clock()));
            if (!empty && !ocean) {
                moor();
                publish(ise::sse_event{"", "fleet", fleet()});
            }
            if (events) events->tick();
            tick();
        });
    };
    tick();

    asio::posix::stream_descriptor input(context, ::dup(STDIN_FILENO));
    asio::streambuf buffer;
    std::function<void()> listen = [&] {
        asio::async_read_until(input, buffer, '\n', [&](std::error_code ended, std::size_t) {
            std::string line;
            std::istream stream(&buffer);
            std::getline(stream, line);
            if (ended || line == "quit") return context.stop();
            if (line == "silence") silent = true;
            if (line == "resume") silent = false;
            if (line == "rough") boat.rough = !boat.rough;
            if (line == "wind off") boat.no_wind = true;
            if (line == "wind on") boat.no_wind = false;
            if (line == "close") close();
            if (line == "open") open();
            if (line == "receiver off") tell_feed("xbee", false, "the proxy does not answer");
            if (line == "receiver on") tell_feed("xbee", true, "");
            if (line == "nodes off") tell_feed("communication", false, "it is not reached", false);
            if (line == "nodes on") tell_feed("communication", true, "node-2, without the other one", false);
            if (line == "estimate") estimate(wall_clock(), 28.1571, -15.4503, 900);
            fmt::print("ok {}\n", line);
            std::fflush(stdout);
            listen();
        });
    };
    listen();
    fmt::print("listening on {}\n", server->url());
    std::fflush(stdout);
    context.run();
    server.reset();
    scope.stop();
    for (context.restart(); scope.size() > 0; context.restart()) context.poll();
}
