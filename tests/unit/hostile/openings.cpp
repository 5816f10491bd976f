// Datagrams of those who have no session: from many addresses, with cookies of all kinds, for ids that nobody has.
#include "fleet.hpp"

#include <support/raw_datagrams.hpp>

#include <random>

namespace openings_test {

using namespace hostile_test;
using ise::wire::datagram_type;

namespace {

// A boat with a subscriber in good order, which must miss nothing, and many places where strangers come from.
struct roadstead : fleet {
    roadstead() : fleet("udp") {
        all.run_until([&] { return fixes.subscribers() == 1; });
        at_rest = boat.scope.size();
    }
    raw_datagrams& stranger() {
        auto name = "skiff" + std::to_string(strangers.size() % 10);
        if (strangers.size() < 10) processes.push_back(&all.world.host(name).start_process(name));
        strangers.push_back(std::make_unique<raw_datagrams>(all, *processes[strangers.size() % 10], channel));
        return *strangers.back();
    }
    /// A packet for who listens, and time to pass.
    void go_on(ise::duration time = 20ms) {
        publish(1);
        ++published;
        all.world.run_for(time);
    }
    void nobody_noticed() {
        all.world.run_for(100ms);
        CHECK(counting.seen.size() == published);
        CHECK(boat.services->counts().packets_dropped == 0);
        CHECK(boat.services->counts().sessions_accepted == 1); // the shore's, all the time
        others_do_not_notice();
    }

    listener counting{*this, ise::subscribe_options::keep_last(64)};
    std::size_t published = 0;
    std::size_t at_rest = 0; ///< coroutines of the boat
    std::vector<ise::sim::process*> processes;
    std::vector<std::unique_ptr<raw_datagrams>> strangers;
};

} // namespace

TEST_CASE("hostile: openings from many addresses cost no memory, and are answered 32 bytes for 1200") {
    roadstead at;
    std::mt19937_64 random(3);
    auto& thief = at.stranger();
    auto of_another = thief.cookie_for(1);
    std::size_t asked = 0;
    for (int from = 0; from < 40; ++from) {
        auto& one = at.stranger();
        auto own = one.cookie_for(1);
        for (int i = 0; i < 100; ++i) {
            ise::wire::cookie shown{};
            if (i % 4 == 1)
                for (auto& byte : shown) byte = static_cast<std::uint8_t>(random());
            if (i % 4 == 2) shown = of_another; // of this id, at another address
            if (i % 4 == 3) shown = own;        // of this address, for another id
            one.open(i % 4 == 2 ? 1 : random() | 2, shown);
            ++asked;
        }
        at.go_on();
        CHECK(one.count(datagram_type::cookie) == 101);
        CHECK(one.longest() == 32);
        CHECK(one.said == 102 * 1200 - 1200);
    }
    CHECK(asked == 4000);
    CHECK(at.boat.scope.size() == at.at_rest);
    CHECK(at.boat.services->counts().sessions_rejected == 0);
    // One that is older than its time opens nothing either.
    auto old = thief.cookie_for(9);
    for (int s = 0; s < 11; ++s) at.go_on(1s);
    thief.open(9, old);
    at.go_on();
    CHECK(thief.count(datagram_type::opened) == 0);
    CHECK(at.boat.scope.size() == at.at_rest);
    at.nobody_noticed();
}

TEST_CASE("hostile: openings that are too short, too long or no openings get no answer") {
    roadstead at;
    auto& one = at.stranger();
    ise::buffer out;
    ise::wire::put_opening(out, 5, {});
    for (std::size_t size : {0u, 1u, 15u, 16u, 35u, 36u, 1199u}) {
        auto cut = out.to_bytes();
        cut.resize(size);
        if (size >= 16) ise::detail::store_little(cut.data(), static_cast<std::uint32_t>(size - 16));
        one.say(cut);
    }
    auto lying = out.to_bytes(); // of a length that is not the datagram's
    ise::detail::store_little(lying.data(), 0xffff'ffffu);
    one.say(lying);
    auto strange = out.to_bytes(); // another mark
    strange[16] ^= std::byte{1};
    one.say(strange);
    for (auto type : {datagram_type::cookie, datagram_type::opened, datagram_type::closed, datagram_type::unknown,
                      datagram_type::sign})
        one.say(type, 5, ise::bytes(24));
    for (int type : {0, 1, 2, 3, 11, 255}) one.say(static_cast<datagram_type>(type), 5, ise::bytes(100));
    at.go_on(1s);
    CHECK(one.got.empty());
    CHECK(at.boat.scope.size() == at.at_rest);
    at.nobody_noticed();
}

TEST_CASE("hostile: who proves its address and then says nothing holds no place that others need") {
    roadstead at;
    for (int from = 0; from < 5; ++from) {
        auto& one = at.stranger();
        for (std::uint64_t id = 1; id <= 120; ++id) one.open_channel(id);
        at.go_on();
    }
    at.others_do_not_notice();
    ise::service_options options;
    CHECK(at.boat.scope.size() - at.at_rest <= 2 * options.max_handshakes);
    auto& far = at.all.add("late");
    auto got = at.all.run(far, harbour::try_helm(far.at(at.channel), 1s)); // who comes only now has a place at once
    CHECK(got);
    for (int s = 0; s < 6; ++s) at.go_on(1s);
    INFO(at.all_warnings());
    CHECK(at.warned("max_handshakes"));
    CHECK(at.warned("did not greet in time (connect_time)"));
    CHECK(at.boat.warnings.size() < 30);
    CHECK(at.boat.services->counts().sessions_rejected == 600);
    for (const auto& one : at.strangers) CHECK(one->count(datagram_type::closed) == 120);
    at.all.world.run_for(4s);
    CHECK(at.boat.scope.size() <= at.at_rest + 1); // the late one's session
    CHECK(at.boat.services->counts().sessions_accepted == 2);
    CHECK(at.counting.seen.size() == at.published);
}

TEST_CASE("hostile: openings, endings and openings again leave nothing behind") {
    roadstead at;
    auto& one = at.stranger();
    for (std::uint64_t round = 1; round <= 300; ++round) {
        auto theirs = one.open_channel(round);
        if (round % 3 == 0)
            one.data(theirs, 0, [](ise::wire::data_writer& to) { to.put(ise::wire::chunk_type::end, 0); });
        if (round % 3 != 1) one.say(datagram_type::closed, theirs);
        if (round % 10 == 0) at.go_on();
    }
    for (int s = 0; s < 10; ++s) at.go_on(1s);
    CHECK(at.boat.scope.size() == at.at_rest);
    CHECK(at.boat.warnings.size() < 30);
    at.nobody_noticed();
}

TEST_CASE("hostile: data for ids that nobody has is answered shortly, and forged endings end nothing") {
    roadstead at;
    std::mt19937_64 random(5);
    auto& one = at.stranger();
    // Where the shore hears the boat: whoever is on the way knows that much.
    auto shown = at.boat.services->sessions().begin()->second->peer_name();
    auto begin = shown.find("udp://");
    auto shore_at = ise::endpoint::parse(shown.substr(begin, shown.find(')') - begin)).value();
    std::size_t answerable = 0;
    for (int i = 0; i < 5000; ++i) {
        ise::bytes body(random() % 60);
        for (auto& byte : body) byte = static_cast<std::byte>(random());
        answerable += body.size() >= 8;
        one.say(datagram_type::data, random(), body);
        for (auto type : {datagram_type::closed, datagram_type::unknown, datagram_type::sign}) {
            one.say(type, random());
            ise::buffer out;
            ise::wire::put_datagram(out, type, random());
            one.say_to(shore_at, out.view());
        }
        if (i % 100 == 0) at.go_on();
    }
    at.go_on(1s);
    CHECK(one.count(datagram_type::unknown) == answerable);
    CHECK(one.got.size() == answerable);
    CHECK(one.longest() == 16); // at least 24 were asked
    CHECK(one.heard() < one.said / 4);
    at.nobody_noticed();
}

} // namespace openings_test
