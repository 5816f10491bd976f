// Posts that carry a token, and those that do not, at a proxy that wants one.
#include "ocean.hpp"

#include <support/catch.hpp>
#include <support/rsa_keys.hpp>

using namespace std::chrono_literals;

TEST_CASE("iridium: a proxy with a key takes the gateway's signed posts") {
    ise_test::rsa_keys keys;
    ocean it;
    it.world.host("shore").write_file("/key.pem", keys.open);
    it.world.host("gateway").write_file("/secret.pem", keys.secret);
    it.proxy_options.jwt_key_file = "/key.pem";
    it.gateway_options.sign_with = "/secret.pem";
    it.gateway_options.post_json = true;
    it.start();
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.telemetry.size() >= 4 && seen.account; }));
    CHECK(seen.account->refused == 0);
}

TEST_CASE("iridium: posts without a token, or with one of another key, are refused and publish nothing") {
    ise_test::rsa_keys keys, others;
    for (bool signs : {false, true}) {
        ocean it;
        it.world.host("shore").write_file("/key.pem", keys.open);
        it.world.host("gateway").write_file("/secret.pem", others.secret);
        it.proxy_options.jwt_key_file = "/key.pem";
        if (signs) it.gateway_options.sign_with = "/secret.pem";
        it.start();
        auto& seen = it.watch();
        REQUIRE(it.until([&] { return seen.account && seen.account->refused >= 3; })); // the gateway repeats them
        CHECK(seen.telemetry.empty());
        CHECK(seen.account->messages == 0);
        CHECK(seen.gateway->trouble.find("401") != std::string::npos);
    }
}
