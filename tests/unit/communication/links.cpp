// Which links count as alive: a new subscription repeats the last packet, and the last answer to a telecommand.
#include "desk.hpp"

#include <components/boat/services.hpp>

namespace links_test {

using namespace node_test;
using namespace std::chrono_literals;

namespace {

telemetry_packet packet(link_id link, utc_time received_at) {
    telemetry_packet made;
    made.link = link;
    made.boot = 3;
    made.received_at = received_at;
    made.raw = {std::byte{1}, std::byte{1}};
    return made;
}

link_health health(const boat_links& links, link_id link) {
    communication_state made;
    links.report(made);
    return *std::ranges::find(made.links, link, &link_health::link);
}

} // namespace

TEST_CASE("node: a link was heard when its packet came to the shore, not when the node got it") {
    on_a_node([](ise::component& self) -> ise::task<> {
        desk it(self);
        auto& links = it.links;
        co_await self.sleep(1h);
        auto clock = it.here.clock();
        auto alive = [&](link_id link) { return links.table().alive(link, self.now()); };

        links.heard(packet(link_id::xbee, clock - 10min)); // the last one before the node was started
        CHECK_FALSE(alive(link_id::xbee));
        CHECK_FALSE(health(links, link_id::xbee).alive);
        CHECK(health(links, link_id::xbee).last_heard == clock - 10min);
        links.heard(packet(link_id::iridium, clock - 10min));
        CHECK(alive(link_id::iridium)); // for an hour
        links.heard(packet(link_id::xbee, clock - 20s));
        CHECK(alive(link_id::xbee));
        links.heard(packet(link_id::xbee, clock - 5min)); // a backlog ends nothing
        CHECK(alive(link_id::xbee));
        CHECK(health(links, link_id::xbee).last_heard == clock - 20s);
        CHECK(health(links, link_id::xbee).packets == 3);
        co_await self.sleep(11s);
        CHECK_FALSE(alive(link_id::xbee));

        links.heard(packet(link_id::gprs, utc_time())); // its proxy does not say when
        CHECK(alive(link_id::gprs));
        CHECK(health(links, link_id::gprs).last_heard == it.here.clock());
        links.heard(packet(link_id::xbee, utc_time::max())); // never later than now
        CHECK(health(links, link_id::xbee).last_heard == it.here.clock());
        links.heard(packet(link_id::xbee, utc_time::min()));
        CHECK(alive(link_id::xbee));
        co_await self.sleep(31s);
        CHECK_FALSE(alive(link_id::xbee));
    });
}

TEST_CASE("node: an answer of the boat that is repeated does not make its link count as alive") {
    on_a_node([](ise::component& self) -> ise::task<> {
        desk it(self);
        co_await self.sleep(1h);
        telecommand_status status;
        status.id = 7;
        status.state = telecommand_stage::acknowledged;
        status.at = it.here.clock() - 10min;
        it.telecommands.on_status(link_id::xbee, status);
        CHECK_FALSE(it.links.table().alive(link_id::xbee, self.now()));
        status.at = utc_time(); // as in the reply to a request that is repeated
        it.telecommands.on_status(link_id::xbee, status);
        CHECK_FALSE(it.links.table().alive(link_id::xbee, self.now()));
        status.at = it.here.clock();
        it.telecommands.on_status(link_id::xbee, status);
        CHECK(it.links.table().alive(link_id::xbee, self.now()));
    });
}

} // namespace links_test
