// A peer that says it is another one: what is listed of that one is no secret.
#include "harbour.hpp"

#include <ise/sim/world.hpp>

namespace impostors_test {

using namespace hostile_test;

namespace {

// The shore as everybody can list it.
ise::wire::hello as_listed(harbour& at) {
    ise::wire::hello hello;
    hello.self = at.shore.services->self();
    return hello;
}

// The first number that the first link of a component gives a call over datagrams.
constexpr std::uint64_t first_number = (std::uint64_t{1} << 40) + 1;

} // namespace

TEST_CASE("impostors: whoever says it is another client uses up none of its call numbers, and its calls run") {
    harbour at("udp");
    at.others_do_not_notice();
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet(as_listed(at));
    peer.introduce(0, "echo", echo.types().fingerprints);
    blob nothing_much;
    const std::uint32_t calls = 288;
    for (std::uint32_t call = 0; call < calls; ++call)
        peer.numbered_request(call, 0, first_number + call, nothing_much);
    peer.finish();
    // The first one too: it got no answer of another's.
    REQUIRE(at.all.run_until([&] { return peer.count(frame_type::reply) == calls; }));
    for (int call = 0; call < 5; ++call) at.others_do_not_notice(); // each is answered by the helm, and not by the echo
}

TEST_CASE("impostors: an answer goes to nobody else, whatever key is guessed") {
    harbour at("udp");
    at.others_do_not_notice(); // answered under the first number
    raw_peer peer(at.all, at.sea, at.channel);
    auto hello = as_listed(at);
    hello.reply_key = GENERATE(0u, 1u, 12345u);
    peer.greet(hello);
    peer.introduce(0, "helm", helm.types().fingerprints);
    set_mode other{"something else"};
    peer.numbered_request(0, 0, first_number, other);
    peer.finish();
    REQUIRE(at.all.run_until([&] { return peer.count(frame_type::reply) == 1; }));
    CHECK(ise::decode<mode_set>(peer.last(frame_type::reply)->body).reason == other.mode);
}

TEST_CASE("impostors: a client tells each life of a provider a key of its own, and the same one in each session") {
    sim_parties all;
    auto& shore = all.add("shore");
    ise::location boat, buoy, reborn;
    boat.path = reborn.path = "boat";
    boat.incarnation = 5;
    reborn.incarnation = 6;
    buoy.path = "buoy";
    buoy.incarnation = 5;
    auto udp = ise::endpoint::parse("udp://boat:7400").value();
    auto elsewhere = ise::endpoint::parse("udp://boat:7500").value();
    auto key = [&](const ise::location& whom, const ise::endpoint& where) {
        return shore.services->peers().greeting_to(whom, where, where.text()).reply_key;
    };
    CHECK(key(boat, udp) != 0);
    CHECK(key(boat, udp) == key(boat, elsewhere));
    CHECK(key(boat, udp) != key(reborn, udp));
    CHECK(key(boat, udp) != key(buoy, udp));
    CHECK(key(ise::location(), udp) == key(ise::location(), udp));
    CHECK(key(ise::location(), udp) != key(ise::location(), elsewhere));
    CHECK(key(boat, ise::endpoint::parse("tcp://boat:7400").value()) == 0); // no call is numbered there
}

} // namespace impostors_test
