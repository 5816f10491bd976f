#include "troubles.hpp"

#include <components/gprs_link/services.hpp>
#include <components/iridium_gateway/services.hpp>
#include <components/iridium_modem/services.hpp>
#include <components/xbee_link/services.hpp>

namespace atirma::stress {
namespace {

director::job carrier(void (*how)(carrier_request&)) {
    carrier_request made;
    how(made);
    return director::tell("atirma/carrier", services::carrier_control, made);
}
director::job sky(void (*how)(iridium_sky_request&)) {
    iridium_sky_request made;
    how(made);
    return director::tell("atirma/iridium/modem", services::iridium_sky_control, made);
}
director::job gateway(bool up) {
    iridium_gateway_request made;
    made.up = up;
    return director::tell("atirma/iridium/gateway", services::iridium_gateway_control, made);
}
director::job noise(double loss) {
    xbee_air_request made;
    made.extra_loss = loss;
    return director::tell("atirma/air", services::air_control, made);
}
director::job air(bool up) {
    xbee_air_request made;
    made.up = up;
    return director::tell("atirma/air", services::air_control, made);
}

deed killing(std::string path) {
    deed made;
    made.process = std::move(path);
    return made;
}
deed stopping(std::string path) {
    auto made = killing(std::move(path));
    made.stops = true;
    return made;
}
deed telling(director::job begin, director::job end = {}) {
    deed made;
    made.begin = std::move(begin);
    made.end = std::move(end);
    return made;
}

} // namespace

std::string_view describe(trouble what) noexcept {
    switch (what) {
        case trouble::carrier_down: return "the carrier is down";
        case trouble::carrier_drops: return "the carrier drops its connections";
        case trouble::carrier_half_open: return "the carrier leaves its connections half open";
        case trouble::carrier_moves: return "the boat gets another address";
        case trouble::carrier_slow: return "the carrier delays by seconds";
        case trouble::air_noise: return "noise on the XBee's band";
        case trouble::air_off: return "the XBee is switched off";
        case trouble::sky_closed: return "no satellite in sight";
        case trouble::sky_fails: return "most Iridium sessions break off";
        case trouble::gateway_down: return "Iridium's gateway is down";
        case trouble::nodes_parted: return "the communication nodes cannot reach each other";
        case trouble::primary_killed: return "the primary communication node is killed";
        case trouble::secondary_killed: return "the secondary communication node is killed";
        case trouble::primary_set_back:
            return "the primary communication node is killed, and returns with a backup of its disk";
        case trouble::secondary_set_back:
            return "the secondary communication node is killed, and returns with a backup of its disk";
        case trouble::names_restarted: return "the name server is killed";
        case trouble::xbee_proxy_crashed: return "the XBee proxy crashes";
        case trouble::gprs_proxy_crashed: return "the GPRS proxy crashes";
        case trouble::iridium_proxy_crashed: return "the Iridium proxy crashes";
        case trouble::page_crashed: return "the page's server crashes";
        case trouble::database_crashed: return "the nodes' database server crashes";
        case trouble::database_stopped: return "the nodes' database server is stopped";
        case trouble::boat_killed: return "the boat's computer loses its power";
        case trouble::operator_away: return "an operator leaves";
    }
    return "unknown";
}

std::optional<link_id> felt_over(trouble what) noexcept {
    using enum trouble;
    switch (what) {
        case carrier_down:
        case carrier_drops:
        case carrier_half_open:
        case carrier_moves:
        case carrier_slow:
        case gprs_proxy_crashed: return link_id::gprs;
        case air_noise:
        case air_off:
        case xbee_proxy_crashed: return link_id::xbee;
        case sky_closed:
        case sky_fails:
        case gateway_down:
        case iridium_proxy_crashed: return link_id::iridium;
        default: return std::nullopt;
    }
}

deed deed_of(trouble what) {
    using enum trouble;
    switch (what) {
        case carrier_down:
            return telling(carrier([](auto& to) { to.up = false; }), carrier([](auto& to) { to.up = true; }));
        case carrier_drops: return telling(carrier([](auto& to) { to.drop = true; }));
        case carrier_half_open: return telling(carrier([](auto& to) { to.half_open = true; }));
        case carrier_moves: return telling(carrier([](auto& to) { to.change_address = true; }));
        case carrier_slow:
            return telling(carrier([](auto& to) {
                               to.delay_s = 4;
                               to.jitter_s = 5;
                           }),
                           carrier([](auto& to) {
                               to.delay_s = 0.3;
                               to.jitter_s = 0.2;
                           }));
        case air_noise: return telling(noise(0.5), noise(0));
        case air_off: return telling(air(false), air(true));
        case sky_closed: return telling(sky([](auto& to) { to.free = false; }), sky([](auto& to) { to.free = true; }));
        case sky_fails:
            return telling(sky([](auto& to) { to.failures = 0.7; }), sky([](auto& to) { to.failures = 0.1; }));
        case gateway_down: return telling(gateway(false), gateway(true));
        case nodes_parted: return {}; // between two hosts: the world's own affair
        case primary_killed:
        case primary_set_back: return killing("atirma/shore/node-1");
        case secondary_killed:
        case secondary_set_back: return killing("atirma/shore/node-2");
        case names_restarted: return killing("names");
        case xbee_proxy_crashed: return killing("atirma/shore/xbee");
        case gprs_proxy_crashed: return killing("atirma/shore/gprs");
        case iridium_proxy_crashed: return killing("atirma/shore/iridium");
        case page_crashed: return killing("atirma/page");
        case boat_killed: return killing("atirma/boat");
        case operator_away: return killing("atirma/console/ana");
        case database_crashed: return killing("database");
        case database_stopped: return stopping("database");
    }
    return {};
}

} // namespace atirma::stress
