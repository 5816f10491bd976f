// Sessions in good order whose subscriptions are not.
#include "fleet.hpp"

namespace subscribers_test {

using namespace hostile_test;

namespace {

struct half_a_fix {
    double latitude_deg = 0;
};

} // namespace

TEST_CASE("hostile: a million subscriptions are refused beyond max_subscriptions_per_session") {
    fleet at(either());
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    auto terms = fleet::terms();
    auto body = ise::encode(terms);
    for (std::uint64_t id = 1; id <= 20'000; ++id) peer.say(frame_type::subscribe, id, ise::bytes_view(body));
    peer.finish();
    CHECK(
        at.all.run_until([&] { return peer.count(frame_type::subscribed) + peer.count(frame_type::ended) == 20'000; }));
    CHECK(at.fixes.subscribers() == 1024);
    auto why = peer.why(frame_type::ended);
    CHECK(why.code() == errc::overloaded);
    CHECK_THAT(why.message(), Contains("max_subscriptions_per_session"));
    CHECK(at.warned("max_subscriptions_per_session"));
    CHECK(at.boat.warnings.size() < 30); // not one for each
    at.others_do_not_notice();
}

TEST_CASE("hostile: who subscribes and vanishes again and again leaves max_lingering behind") {
    ise::service_options options;
    options.max_lingering = 50;
    fleet at(either(), options);
    INFO(at.channel);
    listener counting(at, ise::subscribe_options::keep_last(64));
    at.all.world.run_for(1s);
    auto body = ise::encode(fleet::terms());
    for (int life = 0; life < 20; ++life) {
        raw_peer peer(at.all, at.sea, at.channel);
        peer.greet();
        for (std::uint64_t id = 1; id <= 20; ++id) peer.say(frame_type::subscribe, id, ise::bytes_view(body));
        peer.finish();
        at.all.world.run_for(100ms);
    }
    at.all.world.run_for(100ms);
    CHECK(at.fixes.subscribers() == 51);
    at.publish(3);
    at.all.world.run_for(1s);
    CHECK(counting.seen.size() == 3);
    at.all.world.run_for(31s);
    CHECK(at.fixes.subscribers() == 1); // the linger is over for the last of them too
}

TEST_CASE("hostile: credits beyond all bounds are no more than many") {
    fleet at("tcp");
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    auto terms = fleet::terms();
    terms.policy = ise::overflow::lossless;
    terms.depth = 1000;
    terms.credit = ~std::uint64_t{0} - 1;
    peer.say(frame_type::subscribe, 1, terms);
    auto credit = [&](std::uint64_t total) {
        ise::buffer body;
        body.append(total);
        peer.say(frame_type::credit, 1, body.view());
    };
    for (auto total : {~std::uint64_t{0}, std::uint64_t{0}, std::uint64_t{1} << 63, ~std::uint64_t{0}}) credit(total);
    at.all.world.run_for(1s);
    at.publish(300);
    CHECK(at.all.run_until([&] { return peer.count(frame_type::packet) == 300; }));
    at.others_do_not_notice();
    peer.say(frame_type::credit, 1, ise::bytes(7));
    CHECK(at.all.run_until([&] { return peer.closed(); }));
    CHECK(at.warned("credit"));
    at.others_do_not_notice();
}

TEST_CASE("hostile: a lossless subscriber that reads and grants nothing is held no more than session_bytes") {
    ise::service_options options;
    options.session_bytes = 256 << 10;
    fleet at("tcp", options);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    auto terms = fleet::terms();
    terms.service.service = "pictures";
    terms.service.fingerprints = pictures.types().fingerprints;
    terms.policy = ise::overflow::lossless;
    SECTION("more credit than its depth: all that was sent counts as arrived") {
        terms.depth = 1000;
        terms.credit = ~std::uint64_t{0} - 1;
    }
    SECTION("as much credit as the greatest depth") { terms.credit = terms.depth = 1 << 20; }
    peer.say(frame_type::subscribe, 1, terms);
    at.all.world.run_for(1s);
    REQUIRE(at.images.subscribers() == 1);
    blob image;
    image.content.resize(10'000);
    std::size_t most = 0;
    for (int i = 0; i < 500; ++i) {
        at.images(image);
        at.all.world.run_for(5ms);
        if (i % 50 == 0) peer.say(frame_type::ping, 1, ise::bytes_view()); // it is heard
        most = std::max(most, at.of_raw()->held_bytes());
    }
    CHECK(at.all.run_until([&] { return peer.count(frame_type::packet) == 500; }));
    CHECK(most <= (1 << 20) + 20'000);
    CHECK(peer.count(frame_type::ended) == 0);
    at.others_do_not_notice();
}

TEST_CASE("hostile: an answer about schemas decides over no later subscription with the same number") {
    fleet at(either());
    INFO(at.channel);
    ise::wire::schema_answer answer;
    SECTION("it knows no such schema") { answer.fingerprint = 77; }
    SECTION("a schema that fits") {
        const auto& other = ise::schema_of<half_a_fix>();
        answer.fingerprint = other.fingerprint();
        answer.text = other.text();
    }
    {
        raw_peer peer(at.all, at.sea, at.channel);
        peer.greet();
        auto unknown = fleet::terms();
        unknown.service.fingerprints[ise::role::published] = answer.fingerprint;
        peer.say(frame_type::subscribe, 1, unknown);
        peer.say(frame_type::unsubscribe, 1, ise::bytes_view());
        peer.say(frame_type::subscribe, 1, fleet::terms());
        at.all.world.run_for(1s);
        REQUIRE(peer.count(frame_type::schema_request) == 1);
        REQUIRE(peer.count(frame_type::subscribed) == 1);
        peer.say(frame_type::schema, 0, answer);
        at.all.world.run_for(1s);
        CHECK(peer.count(frame_type::ended) == 0);
        CHECK(peer.count(frame_type::subscribed) == 1);
        at.publish(1);
        at.all.world.run_for(1s);
        CHECK(peer.count(frame_type::packet) == 1);
        CHECK(at.fixes.subscribers() == 1);
    }
    at.all.world.run_for(2min); // longer than the linger
    CHECK(at.fixes.subscribers() == 0);
    at.publish(1);
    at.others_do_not_notice();
}

TEST_CASE("hostile: subscribe requests whose schemas are asked for are held no more than a quarter of session_bytes") {
    ise::service_options options;
    options.session_bytes = 1 << 20;
    fleet at(either(), options);
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    auto terms = fleet::terms();
    terms.request.assign(50'000, 7);
    auto subscribe = [&](std::uint64_t first, std::uint64_t last) {
        for (auto id = first; id <= last; ++id) {
            terms.service.fingerprints[ise::role::published] = 1000 + id; // the boat asks for it
            peer.say(frame_type::subscribe, id, terms);
            peer.say(frame_type::ping, 1, ise::bytes_view()); // it is heard
            peer.finish();
            at.all.world.run_for(200ms);
        }
    };
    auto does_not_know = [&](std::uint64_t id) {
        ise::wire::schema_answer answer;
        answer.fingerprint = 1000 + id;
        peer.say(frame_type::schema, 0, answer);
        peer.finish();
        at.all.world.run_for(200ms);
    };
    subscribe(1, 20);
    CHECK(peer.count(frame_type::ended) == 15);
    auto why = peer.why(frame_type::ended);
    CHECK(why.code() == errc::overloaded);
    CHECK_THAT(why.message(), Contains("session_bytes"));
    CHECK(at.warned("session_bytes"));
    // There is room again for as many as leave, or are refused.
    for (std::uint64_t id = 1; id <= 4; ++id) peer.say(frame_type::unsubscribe, id, ise::bytes_view());
    does_not_know(5);
    CHECK(peer.count(frame_type::ended) == 16);
    subscribe(101, 105);
    CHECK(peer.count(frame_type::ended) == 16);
    subscribe(106, 106);
    CHECK(peer.count(frame_type::ended) == 17);
    CHECK_FALSE(peer.closed());
    at.others_do_not_notice();
}

TEST_CASE("hostile: over udp nobody subscribes without loss, and credits for other subscriptions mean nothing") {
    fleet at("udp");
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    auto terms = fleet::terms();
    terms.policy = ise::overflow::lossless;
    terms.credit = ~std::uint64_t{0};
    peer.say(frame_type::subscribe, 1, terms);
    CHECK(at.all.run_until([&] { return peer.count(frame_type::ended) == 1; }));
    auto why = peer.why(frame_type::ended);
    CHECK(why.code() == errc::invalid_argument);
    CHECK_THAT(why.message(), Contains("without loss over udp"));
    terms.policy = ise::overflow::keep_last;
    terms.depth = 8;
    terms.credit = 0;
    peer.say(frame_type::subscribe, 2, terms);
    CHECK(at.all.run_until([&] { return peer.count(frame_type::subscribed) == 1; }));
    for (auto total : {~std::uint64_t{0}, std::uint64_t{0}, std::uint64_t{1} << 63}) {
        ise::buffer body;
        body.append(total);
        for (std::uint64_t subscription : {0u, 1u, 2u, 3u}) peer.say(frame_type::credit, subscription, body.view());
    }
    at.all.world.run_for(1s);
    at.publish(5);
    CHECK(at.all.run_until([&] { return peer.count(frame_type::packet) == 5; }));
    CHECK(at.fixes.subscribers() == 1);
    at.others_do_not_notice();
}

TEST_CASE("hostile: a subscriber that never reads is held no more than session_bytes") {
    ise::service_options options;
    options.session_bytes = 256 << 10;
    fleet at(either(), options);
    INFO(at.channel);
    listener counting(at, ise::subscribe_options::keep_last(64));
    raw_peer peer(at.all, at.sea, at.channel, false);
    peer.greet();
    auto terms = fleet::terms();
    terms.service.service = "pictures";
    terms.service.fingerprints = pictures.types().fingerprints;
    terms.depth = ~0u;
    for (std::uint64_t id = 1; id <= 10; ++id) peer.say(frame_type::subscribe, id, terms);
    peer.finish();
    at.all.world.run_for(1s);
    REQUIRE(at.images.subscribers() == 10);
    blob image;
    image.content.resize(10'000);
    std::size_t most = 0;
    for (int i = 0; i < 500; ++i) {
        at.images(image);
        at.publish(1);
        at.all.world.run_for(2ms);
        peer.say(frame_type::ping, 1, ise::bytes_view()); // it is heard
        if (auto* session = at.of_raw()) most = std::max(most, session->held_bytes());
    }
    CHECK(most > 900'000);
    CHECK(most <= (1 << 20) + 20'000);
    CHECK(at.boat.services->counts().packets_dropped > 1000);
    CHECK(counting.seen.size() == 500); // another's packets are all there
    at.others_do_not_notice();
}

namespace {

ise::task<> send_all(ise::publication<ise::subscription<fix>> out, int packets, int& sent) {
    for (; sent < packets; ++sent) {
        fix here{1.0 * sent, 0, 0};
        co_await out.send(here);
    }
}

} // namespace

TEST_CASE("hostile: a lossless subscriber that grants nothing holds its publisher up no longer than max_stall") {
    fleet at("tcp");
    listener counting(at, ise::subscribe_options::lossless(8));
    at.all.world.run_for(1s);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    auto terms = fleet::terms();
    terms.policy = ise::overflow::lossless;
    terms.depth = 4;
    terms.credit = 0;
    peer.say(frame_type::subscribe, 1, terms);
    at.all.world.run_for(1s);
    int sent = 0;
    auto sending = start(at.boat.on, send_all(at.fixes, 100, sent));
    auto ping_for_20_s = [&] {
        for (int i = 0; i < 80; ++i) {
            at.all.world.run_for(250ms);
            peer.say(frame_type::ping, 1, ise::bytes_view());
        }
    };
    ping_for_20_s();
    CHECK(sent == 4); // what a publication offers that waits
    ping_for_20_s();
    CHECK(sending->done);
    CHECK(counting.seen.size() == 100);
    CHECK(peer.count(frame_type::ended) == 1);
    CHECK(at.warned("max_stall"));
    at.others_do_not_notice();
}

TEST_CASE("hostile: who accepts no packet is told of a few times, and not of each packet") {
    fleet at(either());
    INFO(at.channel);
    listener counting(at, ise::subscribe_options::keep_last(1000));
    raw_peer peer(at.all, at.sea, at.channel);
    ise::wire::limits little;
    little.max_message_bytes = 500;
    peer.greet("raw", little);
    auto terms = fleet::terms();
    terms.service.service = "pictures";
    terms.service.fingerprints = pictures.types().fingerprints;
    for (std::uint64_t id = 1; id <= 10; ++id) peer.say(frame_type::subscribe, id, terms);
    CHECK(at.all.run_until([&] { return at.images.subscribers() == 10; }));
    blob image;
    image.content.resize(1'000);
    for (int i = 0; i < 500; ++i) at.images(image);
    at.publish(500);
    at.all.world.run_for(1s);
    CHECK(counting.seen.size() == 500);
    CHECK(peer.count(frame_type::packet) == 0);
    INFO(at.all_warnings());
    CHECK(at.warned("(max_message_bytes)"));
    CHECK(at.boat.warnings.size() < 20);
    at.others_do_not_notice();
}

} // namespace subscribers_test
