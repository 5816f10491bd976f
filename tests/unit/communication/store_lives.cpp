// A store that went back in time, and what the other node and followers then know of it.
#include "stores.hpp"

namespace store_lives_test {

using namespace store_test;

TEST_CASE("node store: a restart is a new life, of which nothing is told twice") {
    folder there;
    auto b = opened("memory:restart-b", 200);
    {
        auto a = opened(there.file(), 100);
        a.add(packets(1, 5)).value();
        CHECK(pull(b, a) == 5);
        CHECK(pull(a, b) == 0);
    }
    auto a = opened(there.file(), 300);
    a.add(packets(6, 6)).value();
    auto shared = a.shared(b.known_of_peer());
    CHECK(shared.packets == 5);
    CHECK(pull(b, a) == 1);
    CHECK(b.peer().store == a.number());
    CHECK(b.packets(0, 100, 100).value().at(0).peer_position == 1); // what was known of the life before goes on
    CHECK(pull(a, b) == 0);
    CHECK(a.packets(0, 100, 100).value().at(4).peer_position == 5);
    // Whoever followed the life before goes on at either node, without anything twice.
    track_request request;
    request.seen[101] = 4;
    auto page = a.track(request, a.head()).value();
    CHECK(sequences(page.packets) == numbers{5, 6});
    CHECK(page.seen == track_cursor{{a.number(), 6}});
    page = b.track(request, b.head()).value();
    CHECK(sequences(page.packets) == numbers{5, 6});
    CHECK(page.seen == track_cursor{{a.number(), 4}, {b.number(), 6}});
}

TEST_CASE("node store: a store that went back gets everything again and sends everything that is new") {
    folder there;
    auto b = opened("memory:back-b", 200);
    {
        auto a = opened(there.file(), 100);
        a.add(packets(1, 3)).value();
        CHECK(pull(b, a) == 3);
        CHECK(pull(a, b) == 0);
        REQUIRE(ise::database::copy(there.file(), there.backup()));
        a.add(packets(4, 8)).value();
        auto one = record(4);
        REQUIRE(a.put(std::span(&one, 1)));
        CHECK(pull(b, a) == 5);
        CHECK(b.peer().packets == 8);
        CHECK(b.peer().commands == 1);
    }
    there.restore();
    auto a = opened(there.file(), 300);
    CHECK(a.head() == 3);
    SECTION("the other node asks at once") {}
    SECTION("first there is more of it than there was before") {
        a.add(packets(11, 20)).value();
        CHECK(a.head() > 8);
    }
    SECTION("it is restarted again before") {
        a.add(packets(11, 12)).value();
        a = opened("memory:elsewhere", 1);
        a = opened(there.file(), 400);
    }
    SECTION("it lived on twice before the backup was restored, and the other node knows these lives") {
        a.add(packets(11, 12)).value();
        a = opened("memory:elsewhere", 1);
        a = opened(there.file(), 400);
        CHECK(pull(b, a) == 2);
        a.add(packets(13, 14)).value();
        CHECK(pull(b, a) == 2);
        a = opened("memory:elsewhere", 1);
        there.restore();
        a = opened(there.file(), 500);
        CHECK(a.shared(b.known_of_peer()).packets == 3); // by the first life
    }
    a.add(packets(21, 22)).value();
    auto before = b.head();
    auto shared = a.shared(b.known_of_peer());
    CHECK(shared.packets == 3); // of the 8 that the other node believes to know
    CHECK(shared.commands == 0);
    CHECK(pull(b, a) > 0);
    CHECK(b.head() > before);
    CHECK(pull(a, b) > 0);
    CHECK(a.command(4).value());
    CHECK(pull(b, a) == 0);
    auto of_a = sequences(a.packets(0, 100, 100).value()), of_b = sequences(b.packets(0, 100, 100).value());
    std::ranges::sort(of_a);
    std::ranges::sort(of_b);
    CHECK(of_a == of_b);
    CHECK(std::ranges::count(of_a, 4u) == 1);
    CHECK(std::ranges::count(of_a, 22u) == 1);
    // Whoever followed the lost life to its end hears of what is new.
    track_request request;
    request.seen[101] = 8;
    auto result = sequences(a.track(request, a.head()).value().packets);
    CHECK(std::ranges::count(result, 3u) == 0);
    CHECK(std::ranges::count(result, 22u) == 1);
}

TEST_CASE("node store: a position beyond its head is not believed") {
    auto a = opened("memory:beyond-a", 100);
    a.add(packets(1, 3)).value();
    store_part known;
    known.store = a.number();
    known.packets = 3;
    CHECK(a.shared(known).packets == 3);
    known.packets = 4;
    CHECK(a.shared(known).packets == 0);
    known.store = 4711;
    known.packets = 2;
    CHECK(a.shared(known).packets == 0);
    CHECK(a.shared(std::vector<store_part>()).packets == 0);
    // Nor does a node believe a page that begins beyond what it knows.
    auto b = opened("memory:beyond-b", 200);
    auto page = a.page_after(b.number(), 2, 0, 100).value();
    auto refused = b.apply(page, {}, false);
    REQUIRE_FALSE(refused);
    CHECK(refused.error().code() == ise::errc::protocol_error);
    CHECK(b.head() == 0);
}

} // namespace store_lives_test
