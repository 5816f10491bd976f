#include <components/nmea_bridge/nmea_bridge.hpp>

#include <components/boat/find_component.hpp>
#include <components/nmea_bridge/sentences.hpp>
#include <components/nmea_bridge/signalk.hpp>

namespace atirma {
namespace {
using namespace std::chrono_literals;

/// The place of a packet in telemetry_body.
template <class P>
constexpr std::size_t kind_of() {
    return telemetry_body(P{}).index();
}

} // namespace

nmea_bridge::nmea_bridge(nmea_bridge_options options) : options_(std::move(options)) {}
nmea_bridge::~nmea_bridge() = default;

ise::task<> nmea_bridge::run() {
    known_ = newest_reports();
    packets_ = 0;
    // However this flow ends, the sockets go with it.
    struct closing {
        nmea_bridge& self;
        ~closing() {
            self.nmea_.reset();
            self.signalk_.reset();
        }
    } guard{*this};
    nmea_ = std::make_unique<line_outlet>(*this, options_.nmea, [this] { return nmea_now(std::nullopt); });
    auto self = signalk::identity(options_.vessel, options_.vessel_uuid);
    signalk_ = std::make_unique<line_outlet>(*this, options_.signalk, [this, self] {
        return signalk::hello(self, clock()) + signalk::about(options_.vessel, clock()) + signalk_now(std::nullopt);
    });
    for (const auto* one : {&nmea_, &signalk_}) {
        auto where = (*one)->status().listens;
        if (!where.empty() && options_.on_listening) options_.on_listening(where);
    }
    require(services::telemetry);
    publish_every(services::bridge, 5s, [this] { return status(); });
    for (const auto& path : options_.telemetry) spawn("telemetry of " + path, follow(path));
    for (bool reported = false;;) {
        bool fresh = known_.location() && is_fresh(known_.location()->measured_at);
        if (!fresh) {
            nmea_->send(nmea::no_position(clock()));
            if (!reported) signalk_->send(signalk::no_position(clock())); // there it holds until it is changed
        }
        reported = !fresh;
        co_await sleep(options_.period);
    }
}

ise::task<> nmea_bridge::follow(std::string path) {
    auto proxy = find_component(*this, path);
    for (auto pause = 500ms;; pause = std::min(2 * pause, 5000ms)) {
        try {
            auto packets = co_await proxy.subscribe(services::telemetry);
            pause = 250ms;
            for (;;) {
                auto packet = co_await packets.next();
                if (!packet) break;
                take(*packet);
            }
        } catch (const ise::error& problem) {
            // Also of a proxy that stops meanwhile (cancelled): our own end throws at the next suspension.
            log().debug("a proxy is waited for", {{"proxy", path}, {"cause", problem.what()}});
        }
        co_await sleep(pause);
    }
}

void nmea_bridge::take(const telemetry_packet& packet) {
    ++packets_;
    auto kind = known_.take(packet);
    if (!kind || !nmea_ || !signalk_) return;
    auto lines = nmea_now(kind);
    if (!lines.empty()) nmea_->send(lines);
    auto delta = signalk_now(kind);
    if (!delta.empty()) signalk_->send(delta);
}

bool nmea_bridge::is_fresh(utc_time measured_at) const { return clock() - measured_at <= options_.stale_after; }

/// What holds now of one kind, or of all; what has grown old is left out.
std::string nmea_bridge::nmea_now(std::optional<std::size_t> kind) const {
    std::string made;
    auto wanted = [&](std::size_t of, const auto& report) {
        return (!kind || *kind == of) && report && is_fresh(report->measured_at);
    };
    if (wanted(kind_of<location>(), known_.location())) made += nmea::position(*known_.location());
    else if (!kind) made += nmea::no_position(clock());
    if (wanted(kind_of<navigation>(), known_.navigation())) made += nmea::attitude(*known_.navigation());
    auto heading =
        known_.navigation() && is_fresh(known_.navigation()->measured_at) ? known_.navigation() : std::nullopt;
    if (wanted(kind_of<wind>(), known_.wind())) made += nmea::wind_of(*known_.wind(), heading);
    if (wanted(kind_of<power>(), known_.power())) made += nmea::battery(*known_.power());
    return made;
}

std::string nmea_bridge::signalk_now(std::optional<std::size_t> kind) const {
    std::string made;
    auto wanted = [&](std::size_t of, const auto& report) {
        return (!kind || *kind == of) && report && is_fresh(report->measured_at);
    };
    if (wanted(kind_of<location>(), known_.location())) made += signalk::position(*known_.location());
    else if (!kind) made += signalk::no_position(clock());
    if (wanted(kind_of<navigation>(), known_.navigation())) made += signalk::attitude(*known_.navigation());
    auto heading =
        known_.navigation() && is_fresh(known_.navigation()->measured_at) ? known_.navigation() : std::nullopt;
    if (wanted(kind_of<wind>(), known_.wind())) made += signalk::wind_of(*known_.wind(), heading);
    if (wanted(kind_of<power>(), known_.power())) made += signalk::battery(*known_.power());
    for (auto link : {link_id::xbee, link_id::gprs, link_id::iridium})
        if (wanted(kind_of<link_status>(), known_.link(link))) made += signalk::link_of(*known_.link(link));
    return made;
}

bridge_status nmea_bridge::status() const {
    bridge_status result;
    if (nmea_) result.nmea = nmea_->status();
    if (signalk_) result.signalk = signalk_->status();
    result.packets = packets_;
    result.malformed = known_.malformed();
    result.position_is_fresh = known_.location() && is_fresh(known_.location()->measured_at);
    return result;
}

} // namespace atirma
