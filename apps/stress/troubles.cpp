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
deed telling(director::job begin, director::job end = {}) {
    deed made;
    made.begin = std::move(begin);
    made.end = std::move(end);
    return made;
}

} // namespace

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
        case primary_killed: return killing("atirma/shore/node-1");
        case secondary_killed: return killing("atirma/shore/node-2");
        case names_restarted: return killing("names");
        case xbee_proxy_crashed: return killing("atirma/shore/xbee");
        case gprs_proxy_crashed: return killing("atirma/shore/gprs");
        case iridium_proxy_crashed: return killing("atirma/shore/iridium");
        case page_crashed: return killing("atirma/page");
        case boat_killed: return killing("atirma/boat");
        case operator_away: return killing("atirma/console/ana");
    }
    return {};
}

} // namespace atirma::stress
