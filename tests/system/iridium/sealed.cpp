#include "ocean.hpp"

#include <components/seal/key_file.hpp>

#include <support/catch.hpp>

using namespace std::chrono_literals;
using namespace atirma;

namespace {

std::string satellite_key(int salt) {
    seal::radio_key key;
    key.boat = "atirma";
    key.secret.fill(static_cast<std::byte>(salt));
    return seal::format_key(key);
}

} // namespace

TEST_CASE("iridium: the first telecommand of a proxy that does not know the boat's session is obeyed, once") {
    ocean it;
    it.world.host("boat").write_file("radio.key", satellite_key(1));
    it.world.host("shore").write_file("radio.key", satellite_key(1));
    it.boat_options.radio_key_file = it.proxy_options.radio_key_file = "radio.key";
    it.start();
    iridium_sky_request sky;
    sky.free = false;
    it.set_sky(sky);
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.account && seen.gateway; }));
    REQUIRE_FALSE(seen.account->last_session_at); // no notice has come
    telecommand_request request;
    request.id = 7;
    request.command = commands::waypoint_add{{28.16, -15.45}};
    request.valid_s = 3600;
    auto before = it.boat().pilot().list().size();
    ocean::asked answer;
    it.command(request, 59min, answer);
    REQUIRE(it.until([&] {
        const auto& queue = seen.account->queue;
        return !queue.empty() && queue[0].stage == link_stage::at_gateway;
    }));
    sky.free = true;
    it.set_sky(sky);
    REQUIRE(it.until([&] { return answer.has_value(); }, 1h));
    REQUIRE(*answer);
    CHECK((*answer)->state == telecommand_stage::acknowledged);
    CHECK(it.boat().pilot().list().size() == before + 1);
}

TEST_CASE("iridium: over a sealed link telemetry arrives and the boat obeys, unsealed it does not") {
    for (const auto& ashore : {satellite_key(1), std::string(), satellite_key(2)}) {
        bool same = ashore == satellite_key(1);
        ocean it;
        it.world.host("boat").write_file("radio.key", satellite_key(1));
        it.world.host("shore").write_file("radio.key", ashore);
        it.boat_options.radio_key_file = "radio.key";
        if (!ashore.empty()) it.proxy_options.radio_key_file = "radio.key";
        it.start();
        auto& seen = it.watch();
        if (same) {
            REQUIRE(it.until([&] { return seen.telemetry.size() >= 2; }));
        } else {
            it.world.run_for(10min);
        }
        telecommand_request request;
        request.id = 7;
        request.command = commands::set_mode{sailing_mode::hold};
        request.valid_s = 600;
        ocean::asked answer;
        it.command(request, 9min, answer);
        REQUIRE(it.until([&] { return answer.has_value(); }));
        bool obeyed = *answer && (*answer)->state == telecommand_stage::acknowledged;
        CHECK(obeyed == same);
        CHECK((it.boat().pilot().mode() == sailing_mode::hold) == same);
        CHECK(seen.telemetry.empty() == !same);
    }
}
