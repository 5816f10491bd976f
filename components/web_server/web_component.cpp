#include <components/web_server/web_component.hpp>

#include <components/boat/boat_names.hpp>
#include <components/web_server/assets.hpp>
#include <components/web_server/track_json.hpp>
#include <ise/http/http_answers.hpp>

#include <asio/ip/address.hpp>
#include <fmt/format.h>

namespace atirma {
namespace {
using namespace std::chrono_literals;
constexpr ise::duration tick_period = 10s; // of http_server's streams
constexpr ise::duration watch_period = 1s; // of the links, and of the archive

ise::http_response page_error(int status, std::string_view what) {
    ise::http_response made;
    made.content_type = "text/html; charset=utf-8";
    made.body = fmt::format("<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" "
                            "content=\"width=device-width\"><title>{0} {1}</title><h1>{0} {1}</h1><p>{2}</p>"
                            "<p><a href=\"/\">To the boat's position</a></p></html>\n",
                            status, ise::reason_of(status), what);
    return made;
}

ise::http_response json_response(std::string text) {
    ise::http_response made;
    made.content_type = "application/json; charset=utf-8";
    made.body = std::move(text);
    return made;
}

ise::endpoint endpoint_of(const page_address& at) {
    std::error_code not_numeric;
    auto address = asio::ip::make_address(at.address, not_numeric);
    if (not_numeric)
        throw ise::error(ise::errc::invalid_argument,
                         fmt::format("web server: \"{}\" is not a numeric IP address; use such as 127.0.0.1, 0.0.0.0 "
                                     "or :: (--address)",
                                     at.address));
    ise::endpoint made;
    made.host = address.to_string();
    made.port = at.port;
    return made;
}
} // namespace

ise::http_limits page_limits() {
    ise::http_limits made;
    made.max_connections = 4000;
    made.message.max_body_bytes = 4096; // nothing there takes a body
    made.times.idle = 15s;
    return made;
}

web_server::web_server(web_server_options options) : options_(std::move(options)) { forget_boats(); }
web_server::~web_server() = default;

utc_ms web_server::clock() const { return std::chrono::floor<std::chrono::milliseconds>(wall()); }

/// What stands before and after a life of the component: the first boat, of which nothing is known.
void web_server::forget_boats() {
    boats_.clear();
    boats_.push_back(std::make_unique<boat_page>(
        *this, boat_source{options_.track.boat, address_of(options_.track.boat), options_.telemetry}, options_.track,
        nullptr));
}

void web_server::make_boats() {
    std::vector<boat_source> sources;
    sources.push_back({options_.track.boat, "", options_.telemetry});
    for (std::size_t number = 2; number <= options_.boats; ++number) {
        auto boat = boat_name(number);
        sources.push_back({boat, "", {of_boat(std::string(communication_role), boat)}});
    }
    for (const auto& text : options_.more_boats) sources.push_back(parse_boat(text));
    name_boats(sources);
    boats_.clear();
    for (auto& source : sources)
        boats_.push_back(std::make_unique<boat_page>(*this, std::move(source), options_.track, archive_.get()));
}

ise::task<> web_server::run() {
    // However this flow ends, the sockets go with it, on their own thread, and what was heard is on disk.
    struct closing {
        web_server& self;
        ~closing() {
            for (auto& boat : self.boats_) boat->withdraw();
            self.streams_.clear();
            self.server_.reset();
            self.keep();
        }
    } guard{*this};
    check(options_.tiles);
    server_.reset();
    forget_boats();
    archive_.reset();
    archives_filled_ = 0;
    if (!options_.archive.file.empty()) {
        ise::when_damaged how(log(),
                              [this] { return std::chrono::floor<std::chrono::system_clock::duration>(wall()); });
        auto opened = track_archive::open(options_.archive, std::move(how));
        if (!opened) throw ise::error(opened.error());
        archive_ = std::move(*opened);
    }
    options_.track.epoch =
        fmt::format("{:x}", env().random()); // no client shall take up where another life of this server ended
    make_boats();
    for (auto& boat : boats_) boat->restore();
    listen();
    require(services::telemetry);
    for (auto& boat : boats_) boat->follow();
    if (server_ && options_.on_listening) options_.on_listening(server_->url()); // people need no name server
    auto next_status = now(), next_tick = now() + tick_period;
    for (;;) {
        for (auto& boat : boats_) boat->watch();
        fill_archive();
        keep();
        if (now() >= next_status) {
            next_status = now() + options_.track.status_period;
            auto fleet = boats_.size() > 1 ? fleet_json() : std::string();
            for (auto& boat : boats_) {
                boat->publish(boat->state().status(clock()));
                if (!fleet.empty()) boat->publish({"", "fleet", fleet});
            }
        }
        if (now() >= next_tick) {
            next_tick = now() + tick_period;
            tick();
        }
        co_await sleep(watch_period);
    }
}

/// A damaged archive was replaced by an empty one.
void web_server::fill_archive() {
    if (!archive_ || archives_filled_ == archive_->statistics().begun_anew) return;
    archives_filled_ = archive_->statistics().begun_anew;
    for (auto& boat : boats_) boat->fill_archive();
}

void web_server::keep() {
    if (!archive_) return;
    if (archives_filled_ == archive_->statistics().begun_anew)
        for (auto& boat : boats_) boat->keep_progress();
    auto kept = archive_->commit(clock());
    if (!kept && !disk_failed_)
        log().warning("the track cannot be kept; the page goes on, and tries again",
                      {{"cause", kept.error().message()}});
    if (kept && disk_failed_)
        log().info("the track is kept again", {{"given_up", std::to_string(archive_->statistics().given_up)}});
    disk_failed_ = !kept;
}

void web_server::tick() {
    for (auto& [path, stream] : streams_)
        if (auto dropped = stream->tick())
            log().info(
                "viewers were dropped: they took nothing for a minute; they may come back and go on where they were",
                {{"stream", path}, {"viewers", std::to_string(dropped)}});
}

void web_server::listen() {
    const auto& http = options_.http;
    auto server =
        std::make_unique<ise::http_server>(on(), log(), http.limits, [this](std::string name, ise::task<> body) {
            spawn(std::move(name), std::move(body));
        });
    server->on_error(page_error);
    server->serve(page_assets());
    server->serve_as("/embed", "/index.html", true);
    if (!options_.tiles.url.empty()) server->allow_images(origin_of(options_.tiles.url));
    page_extras extras;
    extras.tiles = options_.tiles;
    if (boats_.size() > 1) extras.boats = [this] { return fleet_json(); };
    for (auto& boat : boats_) boat->offer(*server, boat == boats_.front(), extras, streams_);
    server->get("/boats.json", [this](const ise::http_request&) { return json_response(fleet_json()); });
    server->get("/api/status", [this](const ise::http_request&) { return json_response(status_json()); });
    if (auto listening = server->listen(endpoint_of(http)); !listening)
        throw ise::error(listening.error().code(), fmt::format("web server: {} (--address {}, --port {})",
                                                               listening.error().message(), http.address, http.port));
    server_ = std::move(server);
    log().info("the page is served", {{"url", server_->url()}});
}

/// All boats, in few words: for the list on the page.
std::string web_server::fleet_json() const {
    json all = json::array();
    for (const auto& boat : boats_) {
        json one = {{"id", boat->source().id},
                    {"name", boat->source().name},
                    {"stale_after_s", boat->state().position_limits().stale_s}};
        if (const auto& at = boat->state().position())
            one["position"] = {{"latitude_deg", rounded(at->latitude_deg, 6)},
                               {"longitude_deg", rounded(at->longitude_deg, 6)},
                               {"measured_at", to_json(at->from.measured_at)},
                               {"link", at->from.source}};
        else one["position"] = nullptr;
        all.push_back(std::move(one));
    }
    return to_text({{"now", to_json(clock())}, {"boats", std::move(all)}});
}

std::string web_server::status_json() const {
    json output = {{"now", to_json(clock())}, {"boats", json::object()}};
    auto of_boat = [this](const boat_page& boat) {
        const auto& counted = boat.feed().statistics();
        json one;
        one["packets"] = {{"received", counted.received},
                          {"duplicates", counted.duplicates},
                          {"malformed", counted.malformed},
                          {"by_type", counted.by_type}};
        one["links"] = boat.links();
        one["events_published"] = boat.events();
        one["position"] = nullptr;
        if (const auto& at = boat.state().position()) {
            auto age = clock() - at->from.measured_at;
            one["position"] = {
                {"latitude_deg", rounded(at->latitude_deg, 7)},
                {"longitude_deg", rounded(at->longitude_deg, 7)},
                {"measured_at", to_json(at->from.measured_at)},
                {"link", at->from.source},
                {"age_s", static_cast<double>(age.count()) / 1000},
                {"stale", static_cast<double>(age.count()) / 1000 >= boat.state().position_limits().stale_s}};
        }
        return one;
    };
    output.update(of_boat(*boats_.front())); // as long as there was one boat only, this was all
    for (const auto& boat : boats_) output["boats"][boat->source().id] = of_boat(*boat);
    if (server_) {
        auto http = server_->statistics();
        output["http"] = {{"requests", http.requests},
                          {"connections", http.connections},
                          {"open_connections", http.open_connections},
                          {"refused", http.connections_refused},
                          {"displaced", http.connections_displaced},
                          {"requests_refused", http.requests_refused},
                          {"failed", http.handlers_failed}};
    }
    for (const auto& [path, stream] : streams_) {
        const auto& s = stream->statistics();
        output["streams"][path] = {{"clients", stream->clients()},       {"accepted", s.accepted},
                                   {"refused_full", s.refused},          {"left", s.left},
                                   {"resynchronised", s.resynchronised}, {"events_skipped", s.events_skipped},
                                   {"dropped_slow", s.dropped_slow}};
    }
    if (archive_) {
        const auto& a = archive_->statistics();
        output["archive"] = {{"fixes", a.fixes},     {"packets", a.packets}, {"written", a.written},
                             {"removed", a.removed}, {"waiting", a.waiting}, {"given_up", a.given_up},
                             {"trouble", a.trouble}};
    }
    return to_text(output);
}

} // namespace atirma
