#include <ise/sim/world.hpp>
#include <ise/transport/udp/cookie.hpp>
#include <support/catch.hpp>

namespace udp_cookie_test {

using namespace std::chrono_literals;

TEST_CASE("the keyed hash is SipHash-2-4") {
    ise::net::udp::secret key{0x0706050403020100u, 0x0f0e0d0c0b0a0908u}; // the vector of its paper
    ise::bytes text;
    for (int i = 0; i < 15; ++i) text.push_back(static_cast<std::byte>(i));
    CHECK(ise::net::udp::keyed_hash(key, text) == 0xa129ca6149be45e5u);
}

TEST_CASE("a cookie is good for its address, its id and a while") {
    ise::sim::world world(1);
    auto& env = world.host("boat").start_process("boat");
    ise::net::udp::cookie_jar jar(env);
    auto here = ise::endpoint::parse("udp://10.0.0.2:4000").value();
    auto there = ise::endpoint::parse("udp://10.0.0.3:4000").value();
    auto beside = ise::endpoint::parse("udp://10.0.0.2:4001").value();
    ise::time_point now{1000s};
    auto given = jar.bake(here, 7, now);
    CHECK(jar.accepts(given, here, 7, now));
    CHECK(jar.accepts(given, here, 7, now + jar.lifetime));
    CHECK_FALSE(jar.accepts(given, here, 7, now + jar.lifetime + 1ns));
    CHECK_FALSE(jar.accepts(given, here, 8, now));
    CHECK_FALSE(jar.accepts(given, there, 7, now));
    CHECK_FALSE(jar.accepts(given, beside, 7, now));
    CHECK_FALSE(jar.accepts({}, here, 7, now));
    for (std::size_t bit = 0; bit < 128; ++bit) {
        auto forged = given;
        forged[bit / 8] ^= static_cast<std::uint8_t>(1 << (bit % 8));
        CHECK_FALSE(jar.accepts(forged, here, 7, now));
    }
    // The key changes now and then; what was given just before is still good.
    now += 119s;
    auto late = jar.bake(here, 7, now);
    CHECK(jar.accepts(late, here, 7, now + 5s));
    CHECK_FALSE(ise::net::udp::cookie_jar(env).accepts(late, here, 7, now)); // of another life
}

} // namespace udp_cookie_test
