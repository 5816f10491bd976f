#include "pair.hpp"

#include <algorithm>

namespace conformance {

const char* name_of(fault what) noexcept {
    switch (what) {
        case fault::cut: return "cut by the requester";
        case fault::reset: return "reset by the provider";
        case fault::forgotten: return "forgotten on the way";
        case fault::outage: return "a short outage";
        case fault::partition: return "a partition that heals";
        case fault::half_open: return "half open";
    }
    return "?";
}

std::vector<fault> faults_over(const column& transport) {
    if (transport.relay_at.empty()) return {fault::cut, fault::reset};
    return {fault::cut, fault::reset, fault::forgotten, fault::outage, fault::partition, fault::half_open};
}

namespace {

ise::service_options quick(const column& transport, const tuning& tune) {
    ise::service_options made;
    made.accepts.heartbeat_ns = transport.heartbeat_ns;
    made.accepts.max_message_bytes = 16 << 20;
    made.first_back_off = std::chrono::milliseconds(5);
    made.max_back_off = std::chrono::milliseconds(50);
    if (tune) tune(made);
    return made;
}

std::vector<std::shared_ptr<ise::session>> sessions_of(const std::vector<party*>& all) {
    std::vector<std::shared_ptr<ise::session>> found;
    for (auto* one : all)
        for (auto& [raw, session] : one->services->sessions()) found.push_back(session);
    return found;
}

void close_all(party& of, const char* why) {
    for (auto& session : sessions_of({&of})) session->wire().close(ise::failure(ise::errc::peer_lost, why));
}

} // namespace

pair::pair(world& with, const tuning& tune)
    : over(with), options_(quick(with.has, tune)), boat(make(with.boat(), "boat")), shore(make(with.shore(), "shore")) {
}

side pair::make(ise::environment& env, const char* path) const {
    return side(env, over.loop(env), path, options_, ise::security::load(env, over.credentials).value());
}

pair::~pair() {
    std::vector<party*> all{&boat, &shore};
    if (reborn) all.push_back(reborn.get());
    for (auto* one : all) {
        if (!one->services->stopping()) one->services->stop(std::chrono::milliseconds(100));
        one->scope.stop();
    }
    over.run_until([&] { return std::ranges::all_of(all, [](auto* one) { return one->scope.size() == 0; }); });
    if (between) between->stop();
    over.run_until([&] { return !between || between->ended(); });
    for (auto* one : all) CHECK(one->escaped.empty());
}

void pair::open() {
    where = boat.listen(has.at);
    there = shore.at(where);
}

void pair::open_through_relay() {
    REQUIRE_FALSE(has.relay_at.empty());
    where = boat.listen(has.at);
    auto at = ise::endpoint::parse(has.relay_at).value();
    auto to = where;
    to.kind = at.kind; // what it carries is the ends' affair
    between = relay::make(over.router(), over.loop(over.router()), at, to);
    at = between->where();
    at.kind = where.kind;
    advertised_ = {at}; // with a shared key a listener refuses who dialled something else
    boat.services->acceptor().advertise(advertised_);
    there = shore.at(at);
}

void pair::run_until(const std::function<bool()>& done) {
    const bool came_to_that = over.run_until(done);
    REQUIRE(came_to_that);
}

void pair::cut() { close_all(shore, "cut"); }

void pair::strike(fault what) {
    const std::vector<party*> both{&boat, &shore};
    run_until([&] { return std::ranges::none_of(both, [](auto* one) { return one->services->sessions().empty(); }); });
    auto there_now = sessions_of(both);
    switch (what) {
        case fault::cut: cut(); break;
        case fault::reset: close_all(boat, "reset"); break;
        case fault::forgotten: between->forget(); break;
        case fault::half_open: between->swallow(); break;
        case fault::outage:
        case fault::partition: part(true); break;
    }
    if (what == fault::outage) {
        run(ise::sleep_for(shore.on, std::chrono::nanoseconds(options_.accepts.heartbeat_ns)));
    } else if (what != fault::forgotten || !has.datagrams) {
        run_until([&] { return std::ranges::none_of(there_now, [](auto& one) { return one->open(); }); });
    }
    if (what == fault::outage || what == fault::partition) part(false);
}

side& pair::next_life() {
    close_all(boat, "gone");
    boat.services->stop(std::chrono::milliseconds(100));
    boat.scope.stop();
    run_until([&] { return boat.scope.size() == 0; });
    reborn = std::make_unique<side>(boat.env, over.loop(boat.env), "boat", options_,
                                    ise::security::load(boat.env, over.credentials).value());
    reborn->services->acceptor().advertise(advertised_);
    return *reborn;
}

// The socket of udp is there until the last datagram has been acknowledged.
void pair::listen_again() {
    for (bool listening = false; !listening;) {
        try {
            reborn->listen(where.text());
            listening = true;
        } catch (const ise::error&) {
            run(ise::sleep_for(shore.on, std::chrono::milliseconds(10)));
        }
    }
}

} // namespace conformance
