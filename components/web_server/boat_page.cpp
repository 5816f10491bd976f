#include <components/web_server/boat_page.hpp>

#include <components/boat/find_component.hpp>
#include <components/iridium_proxy/services.hpp>
#include <components/web_server/downloads.hpp>

#include <ise/component/discover.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t max_restored = 20'000;
constexpr auto restored_whole = 24h; // what is older is restored with that many fixes at most

/// "xbee", as reports name their link.
std::string short_name(const std::string& path) { return path.substr(path.rfind('/') + 1); }

track_options named(track_options options, const boat_source& source) {
    options.boat = source.name;
    options.id = source.id;
    return options;
}

template <class T>
T value_or_throw(ise::result<T> result) {
    if (!result) throw ise::error(result.error());
    return std::move(*result);
}

} // namespace

boat_page::boat_page(ise::component& self, boat_source source, track_options options, track_archive* archive)
    : self_(self), source_(std::move(source)), archive_(archive), state_(named(std::move(options), source_)),
      feed_(state_) {}

utc_ms boat_page::clock() const { return std::chrono::floor<std::chrono::milliseconds>(self_.wall()); }

void boat_page::restore() {
    if (!archive_) return;
    const auto& id = source_.id;
    if (auto entered = archive_->enter(id, source_.name); !entered) throw ise::error(entered.error());
    auto recent = clock() - restored_whole;
    for (const auto& fix : value_or_throw(archive_->fixes(id, utc_ms{}, recent, max_restored)))
        state_.restore(fix.point, fix.link);
    for (const auto& fix : value_or_throw(archive_->fixes(id, recent, utc_ms::max(), 100 * max_restored)))
        state_.restore(fix.point, fix.link);
    state_.restore_sailed(value_or_throw(archive_->sailed_m(id)));
    for (const auto& packet : value_or_throw(archive_->newest(id))) feed_.restore(packet, clock());
    for (const auto& [link, at] : value_or_throw(archive_->heard(id))) state_.restore_heard(link, at, clock());
    state_.on_point = [this](const track_point& point, const std::string& link) {
        archive_->keep(source_.id, point, link);
    };
    feed_.on_new = [this](const telemetry_packet& packet, std::string_view kind) {
        archive_->keep(source_.id, packet, kind);
    };
}

void boat_page::follow() {
    for (const auto& path : source_.telemetry) {
        self_.spawn("telemetry of " + path, follow_telemetry(path));
        self_.spawn("links of " + path, follow_health(path));
        look_for_estimates(path);
    }
}

void boat_page::offer(ise::http_server& server, bool first, const page_extras& extras,
                      std::vector<std::pair<std::string, ise::sse_channel*>>& streams) {
    auto under = [&](const std::string& prefix) {
        auto path = prefix + "/events";
        streams_.push_back(
            &server.events(path, [this](std::string_view last) { return state_.snapshot(clock(), last); }));
        streams.emplace_back(path, streams_.back());
        offer_page_data(
            server, prefix, state_, [this] { return clock(); }, extras);
        offer_downloads(server, prefix, state_, archive_, [this] { return clock(); });
    };
    offer_page(server, source_.id);
    if (first) offer_page(server, "");
    under("/" + source_.id);
    if (first) under("");
}

void boat_page::publish(const ise::sse_event& event) {
    ++events_;
    for (auto* stream : streams_) stream->publish(event);
}

ise::task<> boat_page::follow_telemetry(std::string path) {
    auto provider = find_component(self_, path);
    auto pause = 500ms;
    show_connection(path, false, "waits for it");
    // Of a communication node also what it kept before the page started.
    telemetry_follower follower(self_, provider, [this, &pause](const telemetry_packet& packet) {
        pause = 500ms;
        watch();
        for (const auto& event : feed_.take(packet, clock())) publish(event);
    });
    follower.from = clock() - state_.options().max_age;
    if (archive_) follower.seen = value_or_throw(archive_->cursor(source_.id, path));
    struct registered {
        boat_page& self;
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
        show_connection(path, false, why);
        co_await self_.sleep(pause);
        pause = std::min(2 * pause, std::chrono::milliseconds(5000));
    }
}

/// Whether a provider has a service; as long as it does not tell, it is asked again.
ise::task<bool> boat_page::offers(ise::remote provider, std::string service) {
    for (;;) {
        auto result = co_await ise::provides(provider, service);
        if (result) co_return *result;
        co_await self_.sleep(2s);
    }
}

/// What communication nodes know of each link. A proxy does not offer it: then this ends.
ise::task<> boat_page::follow_health(std::string path) {
    auto provider = find_component(self_, path);
    std::string service(services::communication.name());
    bool offered = co_await offers(provider, service);
    while (offered) {
        try {
            auto states = co_await provider.subscribe(services::communication, ise::subscribe_options::keep_latest());
            for (;;) {
                auto state = co_await states.next();
                if (!state) break;
                nodes_.insert(path);
                show_health(*state);
            }
        } catch (const ise::error& problem) {
            offered = problem.code() != ise::errc::no_such_service;
        }
        if (offered) co_await self_.sleep(2s);
    }
}

void boat_page::show_health(const communication_state& node) {
    for (const auto& link : node.links) {
        feed_update result;
        result.source = name_of(link.link);
        result.connected = link.reached;
        result.detail = link.reached ? "" : "its receiver is not reached";
        if (link.last_heard != utc_time()) result.last_heard = link.last_heard;
        if (archive_ && result.last_heard) archive_->keep_heard(source_.id, result.source, *result.last_heard);
        show_feed(std::move(result));
        if (link.link == link_id::iridium && !link.proxy.empty()) look_for_estimates(link.proxy);
    }
    feed_update result;
    result.source = "communication";
    result.link = false;
    result.connected = true;
    result.detail = fmt::format("{}{}", short_name(node.node),
                                node.peer.empty() ? ""
                                : node.peer_lives ? ", backed by " + short_name(node.peer)
                                                  : ", without the other one");
    show_feed(std::move(result));
}

void boat_page::look_for_estimates(const std::string& path) {
    if (estimates_.insert(path).second) self_.spawn("rough fixes of " + path, follow_estimates(path));
}

/// Where the Iridium gateway believed the boat to be: rough, and all there is when the boat is out of other reach.
ise::task<> boat_page::follow_estimates(std::string path) {
    auto provider = find_component(self_, path);
    std::optional<utc_time> last;
    std::string service(services::iridium_account.name());
    bool offered = co_await offers(provider, service);
    while (offered) {
        try {
            auto accounts =
                co_await provider.subscribe(services::iridium_account, ise::subscribe_options::keep_latest());
            for (;;) {
                auto account = co_await accounts.next();
                if (!account) break;
                if (!account->estimate || !account->estimate_at || account->estimate_at == last) continue;
                last = account->estimate_at;
                if (clock() - *last > state_.options().max_age) continue;
                position_update fix;
                // A session is the boat heard over Iridium, when it was and no sooner: the account may be an old one.
                fix.from = {*last, std::min<utc_ms>(*last, clock()), std::string(name_of(link_id::iridium)), false};
                fix.latitude_deg = account->estimate->latitude_deg;
                fix.longitude_deg = account->estimate->longitude_deg;
                fix.circular_error_m = 1000 * account->estimate_cep_km.value_or(10);
                if (auto event = state_.apply(fix, clock())) publish(*event);
            }
        } catch (const ise::error& problem) {
            offered = problem.code() != ise::errc::no_such_service;
        }
        if (offered) co_await self_.sleep(2s);
    }
}

void boat_page::watch() {
    for (const auto& [path, follower] : followers_)
        if (follower->connected() || links_[path])
            show_connection(path, follower->connected(), follower->connected() ? "" : "it is not reached");
}

void boat_page::show_connection(const std::string& path, bool connected, std::string detail) {
    auto known = links_.find(path);
    if (known != links_.end() && known->second == connected) return;
    links_[path] = connected;
    feed_update result;
    result.source = short_name(path);
    result.connected = connected;
    result.detail = std::move(detail);
    // A role's nodes stand between the links and here: what they say of the links is old when they are lost.
    bool nodes = nodes_.contains(path) || path == communication_role || result.source == "communication";
    result.link = !nodes;
    if (nodes) {
        result.source = "communication";
        if (connected) return; // follow_health tells which node it is
    }
    show_feed(std::move(result));
}

void boat_page::show_feed(feed_update result) {
    result.since = clock();
    if (auto event = state_.apply(result, clock())) publish(*event);
}

void boat_page::fill_archive() {
    for (const auto& point : state_.track()) archive_->keep(source_.id, point, state_.sources()[point.source]);
    feed_.begin_anew();
    for (const auto& [path, follower] : followers_) follower->begin_anew();
}

void boat_page::keep_progress() {
    if (!archive_) return;
    for (const auto& [path, follower] : followers_)
        if (!follower->seen.empty()) archive_->keep_cursor(source_.id, path, follower->seen);
    archive_->keep_trip(source_.id, state_.sailed_m());
}

} // namespace atirma
