// Who connects and does not greet as he should.
#include "harbour.hpp"

#include <deque>

namespace strangers_test {

using namespace hostile_test;

TEST_CASE("hostile: strangers who say nothing hold no place that others need") {
    harbour at(either());
    INFO(at.channel);
    std::vector<std::unique_ptr<raw_peer>> silent;
    for (int i = 0; i < 600; ++i) silent.push_back(std::make_unique<raw_peer>(at.all, at.sea, at.channel));
    at.all.world.run_for(10ms);
    at.others_do_not_notice(); // who comes only now has a place at once
    auto gone = std::ranges::count_if(silent, [](const auto& peer) { return peer->closed(); });
    CHECK(gone >= 600 - 256);
    at.all.world.run_for(6s); // the others' time is over
    CHECK(std::ranges::all_of(silent, [](const auto& peer) { return peer->closed(); }));
    CHECK(at.boat.services->counts().sessions_rejected >= 600);
    INFO(at.all_warnings());
    CHECK(at.warned("max_handshakes"));
    CHECK(at.warned("did not greet in time (connect_time)"));
    CHECK(at.boat.warnings.size() < 30); // not one for each
}

TEST_CASE("hostile: a byte a second is no greeting") {
    harbour at(either());
    INFO(at.channel);
    raw_peer slow(at.all, at.sea, at.channel);
    ise::wire::hello hello;
    ise::buffer whole;
    ise::wire::put_frame(whole, frame_type::hello, 0, 0, [&](ise::buffer& to) { ise::encode(hello, to); });
    std::size_t said = 0;
    while (!slow.closed() && said < whole.size()) {
        slow.say(whole.view().subspan(said++, 1));
        at.all.world.run_for(1s);
    }
    CHECK(slow.closed());
    CHECK(said <= 6); // connect_time
    CHECK(at.warned("did not greet in time (connect_time)"));
    at.others_do_not_notice();
}

TEST_CASE("hostile: within a session a byte a second costs no more than the frame it promises") {
    harbour at(either());
    INFO(at.channel);
    raw_peer slow(at.all, at.sea, at.channel);
    slow.greet();
    ise::buffer whole;
    ise::bytes body(1000);
    ise::wire::put_frame(whole, frame_type::ping, 0, 1, [&](ise::buffer& to) { to.append(ise::bytes_view(body)); });
    for (std::size_t said = 0; said < 30; ++said) {
        slow.say(whole.view().subspan(said, 1));
        at.all.world.run_for(1s);
    }
    CHECK_FALSE(slow.closed()); // slow is no crime: it is heard
    CHECK(at.of_raw());
    at.others_do_not_notice();
    at.all.world.net().partition("boat", "sea"); // silent now, its acks over udp too: lost by its heartbeat
    at.all.world.run_for(10s);
    CHECK_FALSE(at.of_raw());
}

TEST_CASE("hostile: endless handshakes leave nothing behind") {
    harbour at(either());
    INFO(at.channel);
    at.others_do_not_notice();
    for (int i = 0; i < 500; ++i) {
        raw_peer brief(at.all, at.sea, at.channel);
        if (i % 3 == 0) brief.greet();
        if (i % 3 == 1) brief.say(frame_type::hello, 0, ise::bytes(40));
    }
    at.all.world.run_for(1s);
    CHECK(at.boat.services->sessions().size() == 1); // the shore's
    at.others_do_not_notice();
    INFO(at.all_warnings());
    CHECK(at.boat.warnings.size() < 60);
}

TEST_CASE("hostile: while strangers crowd at the channel, one who comes from far away gets in") {
    harbour at(either());
    INFO(at.channel);
    at.all.world.net().between("boat", "shore").latency = 300ms;
    auto call = start(at.shore.on, at.try_helm(at.there, 30s));
    std::deque<std::unique_ptr<raw_peer>> crowd;
    auto end = at.all.world.now() + 20s;
    while (!call->done && at.all.world.now() < end) {
        crowd.push_back(std::make_unique<raw_peer>(at.all, at.sea, at.channel));
        while (!crowd.empty() && crowd.front()->closed()) crowd.pop_front();
        at.all.world.run_for(1ms);
    }
    REQUIRE(call->done);
    CHECK(call->get());
    CHECK(crowd.size() > 200); // they still are
    CHECK(at.warned("max_handshakes"));
}

TEST_CASE("hostile: beyond max_sessions a peer is told so and others keep theirs") {
    ise::service_options few;
    few.max_sessions = 3;
    harbour at(either(), few);
    INFO(at.channel);
    at.others_do_not_notice();
    std::vector<std::unique_ptr<raw_peer>> crowd;
    for (int i = 0; i < 10; ++i) {
        crowd.push_back(std::make_unique<raw_peer>(at.all, at.sea, at.channel));
        crowd.back()->greet();
    }
    CHECK(at.boat.services->sessions().size() == 3);
    CHECK(crowd.back()->count(frame_type::reject) == 1);
    CHECK_THAT(crowd.back()->why(frame_type::reject).message(), Contains("max_sessions"));
    at.others_do_not_notice();
}

TEST_CASE("hostile: a host that holds all sessions loses its oldest to another host, and none to itself") {
    ise::service_options few;
    few.max_sessions = 4;
    harbour at(either(), few);
    INFO(at.channel);
    std::deque<std::unique_ptr<raw_peer>> crowd;
    auto comes = [&] {
        // Who is silent loses its session anyway.
        for (auto& peer : crowd) peer->say(frame_type::ping, 1, ise::bytes_view());
        crowd.push_back(std::make_unique<raw_peer>(at.all, at.sea, at.channel));
        crowd.back()->greet();
        return crowd.back()->count(frame_type::reject) == 0;
    };
    auto lost = [&] {
        return std::ranges::count_if(crowd, [](const auto& peer) { return peer->count(frame_type::goodbye) > 0; });
    };
    for (int i = 0; i < 4; ++i) CHECK(comes());
    CHECK_FALSE(comes());
    CHECK(lost() == 0);
    at.others_do_not_notice();
    CHECK(lost() == 1);
    CHECK_THAT(crowd.front()->why(frame_type::goodbye).message(), Contains("max_sessions") && Contains("another host"));
    CHECK(at.warned("make way for other hosts"));
    auto& pier = at.all.add("pier");
    auto over_there = pier.at(at.channel);
    CHECK(at.all.run(pier, at.try_helm(over_there, 1s)));
    CHECK(lost() == 2);
    for (int i = 0; i < 10; ++i) CHECK_FALSE(comes());
    at.all.world.run_for(1s); // whoever did not close by itself
    CHECK(at.boat.services->sessions().size() == 4);
    CHECK(lost() == 2);
    crowd.clear();
    at.all.world.run_for(1s);
    CHECK(at.boat.services->sessions().size() == 2);
    for (int i = 0; i < 2; ++i) CHECK(comes()); // their places are free again
    at.others_do_not_notice();
}

} // namespace strangers_test
