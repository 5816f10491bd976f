// The tracking page with a scripted boat on course T1, without any of the middleware.
// page_preview [port [empty]]: prints "listening on URL", then obeys lines on stdin: silence, resume, receiver off,
// receiver on, rough, close (the server stops listening), open, quit. The end of stdin is quit too.
#include <components/web_server/http_server.hpp>
#include <components/web_server/track_state.hpp>

#include <asio/posix/stream_descriptor.hpp>
#include <asio/read_until.hpp>
#include <asio/steady_timer.hpp>
#include <asio/streambuf.hpp>

#include <fmt/format.h>

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
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
        if (atirma::distance_m(latitude_, longitude_, target.latitude_deg, target.longitude_deg) < 40) active_ = (active_ + 1) % course_.size();
        double wanted = atirma::bearing_deg(latitude_, longitude_, course_[active_].latitude_deg, course_[active_].longitude_deg);
        double off = std::remainder(wanted - wind_from, 360);
        if (std::abs(off) < 48) {
            if (std::abs(off) > 30) tack_ = off > 0 ? 1 : -1;
            if (++on_tack_ > 170) tack_ = -tack_, on_tack_ = 0;
            wanted = wind_from + 50 * tack_;
        }
        heading_ += std::clamp(std::remainder(wanted - heading_, 360), -9.0, 9.0);
        double angle = std::abs(std::remainder(heading_ - wind_from, 360));
        double speed = std::max(0.25, wind_mps * 0.27 * std::sin(std::min(angle, 135.0) * 0.75 * std::numbers::pi / 180));
        double cog = heading_ + 3 * std::sin(seconds / 11);
        double moved = speed * static_cast<double>(dt.count()) / 1000;
        latitude_ += moved * std::cos(cog * std::numbers::pi / 180) / 111195;
        longitude_ += moved * std::sin(cog * std::numbers::pi / 180) / 111195 / std::cos(latitude_ * std::numbers::pi / 180);

        atirma::report_origin from{time_, time_, std::move(source), false};
        auto relative = std::remainder(wind_from - heading_, 360) * std::numbers::pi / 180;
        double ahead = wind_mps * std::cos(relative) + speed, across = wind_mps * std::sin(relative);
        publish(state_.apply(atirma::wind_update{from, std::atan2(across, ahead) * 180 / std::numbers::pi, std::hypot(ahead, across), wind_from, wind_mps}, time_));
        publish(state_.apply(atirma::navigation_update{.from = from, .heading_deg = heading_, .heel_deg = -std::copysign(4 + 2.1 * wind_mps * std::abs(std::sin(relative)), std::sin(relative)), .active_waypoint = active_}, time_));
        publish(state_.apply(atirma::position_update{.from = from, .latitude_deg = latitude_, .longitude_deg = longitude_, .speed_over_ground_mps = speed, .course_over_ground_deg = cog, .circular_error_m = rough ? std::optional(420.0) : std::nullopt, .satellites = 9}, time_));
    }

    template <class Publish>
    void tell_course(Publish publish) {
        atirma::report_origin from{time_, time_, "xbee", false};
        publish(state_.apply(atirma::waypoints_update{from, course_, active_, true}, time_));
        publish(state_.apply(atirma::mode_update{from, "auto"}, time_));
        publish(state_.apply(atirma::power_update{from, 12.7, 0.8, 83.0}, time_));
    }

    atirma::utc_ms time() const { return time_; }
    bool rough = false;

private:
    atirma::track_state& state_;
    atirma::utc_ms time_;
    std::vector<atirma::track_waypoint> course_;
    std::size_t active_ = 1;
    double latitude_ = 28.1532, longitude_ = -15.4483, heading_ = 60;
    int tack_ = 1, on_tack_ = 0;
};

} // namespace

int main(int argc, char** argv) {
    asio::io_context context(1);
    atirma::track_options track;
    track.epoch = fmt::format("{:x}", wall_clock().time_since_epoch().count());
    track.stale_after = 6s;
    track.status_period = 1s;
    atirma::track_state state(track);
    auto port = static_cast<std::uint16_t>(argc > 1 ? std::atoi(argv[1]) : 0);
    atirma::http_options options;
    options.port = port;

    std::unique_ptr<atirma::http_server> server;
    atirma::sse_channel* events = nullptr;
    auto open = [&] {
        server = std::make_unique<atirma::http_server>(context, options);
        server->serve(atirma::page_assets());
        server->get("/track.gpx", [&](const auto&) { return atirma::http_reply{state.gpx(), "application/gpx+xml", 200, "a-tirma.gpx"}; });
        server->get("/track.kml", [&](const auto&) { return atirma::http_reply{state.kml(), "application/vnd.google-earth.kml+xml", 200, "a-tirma.kml"}; });
        server->get("/state.json", [&](const auto&) { return atirma::http_reply{state.snapshot(wall_clock()).data}; });
        events = &server->events("/events", [&](std::string_view last) { return state.snapshot(wall_clock(), last); });
        server->listen();
        options.port = server->port();
    };
    auto close = [&] { events = nullptr; server.reset(); };
    open();
    auto publish = [&](std::optional<atirma::page_event> event) {
        if (event && events) events->publish(*event);
    };

    // An hour and a half of the past, then as time goes; or a boat that was never heard, until "resume".
    bool empty = argc > 2 && std::string_view(argv[2]) == "empty";
    scripted_boat boat(state, wall_clock() - (empty ? 1s : 90min));
    while (!empty && boat.time() < wall_clock() - 4s) boat.step(4s, "xbee", publish);
    if (!empty) boat.tell_course(publish);

    bool silent = empty;
    asio::steady_timer timer(context);
    std::function<void()> tick = [&] {
        timer.expires_after(1s);
        timer.async_wait([&](std::error_code stopped) {
            if (stopped) return;
            if (!silent) {
                boat.step(wall_clock() - boat.time(), "xbee", publish);
                boat.tell_course(publish);
            }
            if (events) events->publish(state.status(wall_clock())), events->tick();
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
            if (line == "close") close();
            if (line == "open") open();
            if (line == "receiver off") publish(state.apply(atirma::feed_update{"xbee", false, wall_clock(), "the proxy does not answer"}, wall_clock()));
            if (line == "receiver on") publish(state.apply(atirma::feed_update{"xbee", true, wall_clock(), ""}, wall_clock()));
            fmt::print("ok {}\n", line);
            std::fflush(stdout);
            listen();
        });
    };
    listen();
    fmt::print("listening on {}\n", server->url());
    std::fflush(stdout);
    context.run();
}
