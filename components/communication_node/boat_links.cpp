#include <components/communication_node/boat_links.hpp>

#include <components/boat/find_component.hpp>
#include <components/boat/recall.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma {
namespace {

using namespace std::chrono_literals;

constexpr ise::duration subscribe_again = 500ms;

} // namespace

boat_links::boat_links(node_context& here, actions then)
    : here_(here), then_(std::move(then)), table_(here.options.links), proxies_(here.options.proxies.size()) {
    for (std::size_t i = 0; i < proxies_.size(); ++i) {
        const auto& named = here.options.proxies[i];
        proxies_[i].health.link = named.link;
        proxies_[i].health.proxy = named.path;
    }
    if (proxies_.empty()) return;
    here.self.require(services::telemetry);
    here.self.require(services::telecommand);
    here.self.require(services::telecommand_state);
    here.self.require(services::telecommand_recall);
}

void boat_links::start() {
    for (auto& one : proxies_) {
        one.remote = find_component(here_.self, one.health.proxy);
        auto name = name_of(one.health.link);
        here_.self.spawn(fmt::format("telemetry over {}", name), follow_telemetry(one));
        here_.self.spawn(fmt::format("telecommands over {}", name), follow_telecommands(one));
    }
}

void boat_links::look() {
    for (const auto& one : proxies_) table_.reached(one.health.link, one.stream && one.stream->connected());
}

void boat_links::heard(link_id link, utc_time at) {
    auto clock = here_.clock();
    auto age = clock - std::min(std::max(at, utc_time()), clock);
    table_.heard(link, here_.now() - std::chrono::duration_cast<ise::duration>(age));
}

void boat_links::heard(const telemetry_packet& packet) {
    // A new subscription repeats the last packet, and a proxy may deliver a backlog: the reception counts.
    auto clock = here_.clock();
    auto at = packet.received_at == utc_time() ? clock : std::min(clock, packet.received_at);
    if (packet.boot != beacon_boot) heard(packet.link, at); // telecommands do not reach the second controller
    if (auto* over = find(packet.link)) {
        ++over->health.packets;
        over->health.last_heard = std::max(over->health.last_heard, at);
    }
}

boat_links::proxy_state* boat_links::find(link_id link) {
    auto at = std::ranges::find_if(proxies_, [&](const auto& one) { return one.health.link == link; });
    return at == proxies_.end() ? nullptr : &*at;
}

ise::remote* boat_links::proxy(link_id link) {
    auto* found = find(link);
    return found ? &found->remote : nullptr;
}

std::string boat_links::names() const {
    std::string all;
    for (const auto& one : proxies_) all += fmt::format("{}{}", all.empty() ? "" : ", ", name_of(one.health.link));
    return all.empty() ? "none" : all;
}

void boat_links::report(communication_state& into) const {
    for (const auto& one : proxies_) {
        auto& made = into.links.emplace_back(one.health);
        made.reached = table_.is_reached(made.link);
        made.alive = table_.alive(made.link, here_.now());
    }
}

ise::task<> boat_links::follow_telemetry(proxy_state& of) {
    constexpr std::size_t batch = 256;
    for (;;) {
        try {
            auto packets = co_await of.remote.subscribe(services::telemetry, ise::subscribe_options::keep_last(4096));
            struct registered {
                proxy_state& of;
                ~registered() { of.stream = nullptr; }
            } guard{of};
            of.stream = &packets;
            if (!of.health.trouble.empty())
                here_.self.log().info("a proxy is reached again", {{"proxy", of.health.proxy}});
            of.health.trouble.clear();
            table_.reached(of.health.link, true);
            then_.reached();
            for (;;) {
                auto packet = co_await packets.next();
                if (!packet) break;
                std::vector<telemetry_packet> together;
                while (packet) {
                    if (auto lost = packet.lost_before()) of.health.lost += *lost;
                    else ++of.health.gaps;
                    together.push_back(*packet);
                    if (together.size() >= batch) break;
                    packet = packets.try_next();
                }
                then_.received(std::move(together));
            }
        } catch (const ise::error& problem) {
            // Also of a proxy that stops meanwhile (cancelled): our own end throws at the next suspension.
            unreached(of.health, problem);
        }
        table_.reached(of.health.link, false);
        co_await here_.self.sleep(subscribe_again);
    }
}

/// Logged once for each cause: a proxy that was named and is never found is a mistake that somebody has to see.
void boat_links::unreached(link_health& health, const ise::error& problem) {
    std::string why = problem.what();
    if (problem.code() == ise::errc::no_such_name)
        why = fmt::format("there is no {}: is its proxy running, and is that its path (--proxy {}=PATH)?", health.proxy,
                          name_of(health.link));
    if (why == health.trouble) return;
    health.trouble = why;
    here_.self.log().warning("a proxy is not reached", {{"proxy", health.proxy}, {"cause", why}});
}

ise::task<> boat_links::follow_telecommands(proxy_state& of) {
    for (;;) {
        try {
            follow_telecommand all;
            auto states =
                co_await of.remote.subscribe(services::telecommand_state, all, ise::subscribe_options::keep_last(1024));
            for (const auto& status : states.response().now) then_.status(of.health.link, status);
            for (;;) {
                auto status = co_await states.next();
                if (!status) break;
                then_.status(of.health.link, *status);
            }
        } catch (const ise::error& problem) { // our own end throws at the next suspension
            here_.self.log().debug("a proxy is not subscribed to",
                                   {{"proxy", of.health.proxy}, {"cause", problem.what()}});
        }
        co_await here_.self.sleep(subscribe_again);
    }
}

} // namespace atirma
