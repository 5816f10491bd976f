#include <components/web_server/web_component.hpp>

#include <components/boat/find_component.hpp>
#include <components/web_server/track_json.hpp>

#include <ise/core/executor.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {
using namespace std::chrono_literals;
constexpr ise::duration tick_period = 10s; // of http_server's streams
constexpr ise::duration watch_period = 1s; // of the links
}

web_server::web_server(web_server_options options)
    : options_(std::move(options)), state_(std::make_unique<track_state>(options_.track)), feed_(std::make_unique<telemetry_feed>(*state_)) {}
web_server::~web_server() = default;

utc_ms web_server::clock() const { return std::chrono::floor<std::chrono::milliseconds>(wall()); }

ise::task<> web_server::run() {
    events_out_ = nullptr;
    server_.reset();
    auto track = options_.track;
    track.epoch = fmt::format("{:x}", env().random()); // no client shall take up where another life of this server ended
    state_ = std::make_unique<track_state>(std::move(track));
    feed_ = std::make_unique<telemetry_feed>(*state_);
    if (!options_.headless) listen();
    // However this flow ends, the sockets go with it, on their own thread.
    struct closing {
        web_server& self;
        ~closing() {
            self.events_out_ = nullptr;
            self.server_.reset();
        }
    } guard{*this};
    require(services::telemetry);
    for (const auto& path : options_.telemetry) spawn("telemetry of " + path, follow(path));
    if (server_ && options_.on_listening) options_.on_listening(server_->url()); // people need no name server
    auto next_status = now(), next_tick = now() + tick_period;
    for (;;) {
        watch_links();
        if (now() >= next_status) {
            next_status = now() + state_->options().status_period;
            publish(state_->status(clock()));
        }
        if (now() >= next_tick) {
            next_tick = now() + tick_period;
            if (events_out_) events_out_->tick();
        }
        co_await sleep(watch_period);
    }
}

void web_server::listen() {
    auto executor = on().get_executor();
    const auto* context = ise::executor_cast<asio::io_context::executor_type>(executor);
    if (!context)
        throw ise::error(ise::errc::invalid_argument, "the web server needs a loop on an asio::io_context of one thread: start it without an executor, "
                                                      "or headless where there is none (as in the virtual world)");
    auto http = options_.http;
    if (!http.log) http.log = [this](std::string_view line) { log().warning(line); };
    auto server = std::make_unique<http_server>(context->context(), std::move(http));
    server->serve(page_assets());
    events_out_ = &server->events("/events", [this](std::string_view last) { return state_->snapshot(clock(), last); });
    server->get("/track.gpx", [this](const http_request&) { return http_reply{state_->gpx(), "application/gpx+xml", 200, "a-tirma.gpx"}; });
    server->get("/track.kml", [this](const http_request&) { return http_reply{state_->kml(), "application/vnd.google-earth.kml+xml", 200, "a-tirma.kml"}; });
    server->get("/api/status", [this](const http_request&) { return http_reply{status_json()}; });
    server->listen();
    server_ = std::move(server);
    log().info("the page is served", {{"url", server_->url()}});
}

ise::task<> web_server::follow(std::string path) {
    auto proxy = find_component(*this, path);
    auto pause = 500ms;
    show_link(path, false, "waits for it");
    // Of a communication node also what it kept before the page started.
    telemetry_follower follower(*this, proxy, [this, &pause](const telemetry_packet& packet) {
        pause = 500ms;
        watch_links();
        for (const auto& event : feed_->take(packet, clock())) publish(event);
    });
    follower.from = clock() - options_.track.max_age;
    struct registered {
        web_server& self;
        const std::string& path;
        ~registered() { self.followers_.erase(path); }
    } guard{*this, path};
    followers_[path] = &follower;
    for (;;) {
        std::string why;
        try {
            co_await follower.run();
            why = "its provider has ended the subscription";
        } catch (const ise::error& problem) {
            why = problem.what(); // also of a provider that stops meanwhile; our own end throws at the next suspension
        }
        show_link(path, false, why);
        co_await sleep(pause);
        pause = std::min(2 * pause, std::chrono::milliseconds(5000));
    }
}

void web_server::publish(const page_event& event) {
    ++events_;
    if (events_out_) events_out_->publish(event);
}

/// A subscription heals by itself: that it is cut off now shows only here.
void web_server::watch_links() {
    for (const auto& [path, follower] : followers_)
        if (follower->connected() || links_[path]) show_link(path, follower->connected(), follower->connected() ? "" : "it is not reached");
}

void web_server::show_link(const std::string& path, bool connected, std::string detail) {
    auto known = links_.find(path);
    if (known != links_.end() && known->second == connected) return;
    links_[path] = connected;
    feed_update told;
    told.source = path.substr(path.rfind('/') + 1); // "xbee", as reports name their link
    told.connected = connected;
    told.since = clock();
    told.detail = std::move(detail);
    if (auto event = state_->apply(told, clock())) publish(*event);
}

std::string web_server::status_json() const {
    json told;
    const auto& counted = feed_->statistics();
    told["now"] = to_json(clock());
    told["packets"] = {{"received", counted.received}, {"duplicates", counted.duplicates}, {"malformed", counted.malformed}, {"by_type", counted.by_type}};
    told["links"] = links_;
    told["events_published"] = events_;
    if (const auto& at = state_->position()) {
        auto age = clock() - at->from.measured_at;
        told["position"] = {{"latitude_deg", rounded(at->latitude_deg, 7)}, {"longitude_deg", rounded(at->longitude_deg, 7)},
                            {"measured_at", to_json(at->from.measured_at)}, {"age_s", static_cast<double>(age.count()) / 1000},
                            {"stale", age > state_->options().stale_after}};
    } else {
        told["position"] = nullptr;
    }
    if (server_) {
        auto http = server_->statistics();
        told["http"] = {{"requests", http.requests}, {"connections", http.connections}, {"open_connections", http.open_connections},
                        {"refused", http.connections_refused}, {"failed", http.handlers_failed}};
    }
    if (events_out_) {
        const auto& streams = events_out_->statistics();
        told["streams"] = {{"clients", events_out_->clients()}, {"accepted", streams.accepted}, {"resynchronised", streams.resynchronised},
                           {"events_skipped", streams.events_skipped}, {"dropped_slow", streams.dropped_slow}};
    }
    return to_text(told);
}

} // namespace atirma
