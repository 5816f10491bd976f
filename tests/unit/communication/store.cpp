#include "stores.hpp"

#include <csignal>
#include <sys/resource.h>
#include <sys/wait.h>

namespace store_test {

using namespace store_test;
using ise_test::Contains;

TEST_CASE("node store: a packet is kept once, whichever links brought it, and is there after a restart") {
    folder there;
    std::uint64_t number = 0;
    {
        auto store = opened(there.file(), 42);
        number = store.number();
        CHECK(number == 43); // never 0
        auto first = store.add(packets(1, 3)).value();
        CHECK(first.fresh == 3);
        CHECK(first.last == 3);
        std::vector<telemetry_packet> again{packet(2, link_id::gprs), packet(4, link_id::gprs),
                                            packet(4, link_id::iridium)};
        auto second = store.add(again).value();
        CHECK(second.fresh == 1);
        CHECK(second.last == 4);
        CHECK(store.add(std::span(again).first(1)).value().last == 2); // where it lies
        auto other_life = packet(2);
        other_life.measured_at += 1h; // a boot number that came round again is another packet
        CHECK(store.add(std::span(&other_life, 1)).value().fresh == 1);
    }
    auto store = opened(there.file(), 77);
    CHECK(store.number() == 77); // another life
    CHECK(store.origin() == number);
    CHECK(store.head() == 5);
    auto all = store.packets(0, 100, 100).value();
    REQUIRE(all.size() == 5);
    CHECK(sequences(all) == numbers{1, 2, 3, 4, 2});
    CHECK(all[3].link == link_id::gprs);
    CHECK(all[3].store == 77);
    CHECK(all[3].position == 4);
    CHECK(all[3].raw == packet(4).raw);
    CHECK(all[3].received_at == packet(4).received_at);
    CHECK(store.packets(2, 4, 100).value().size() == 2);
    CHECK(store.packets(0, 100, 2).value().size() == 2);
}

TEST_CASE("node store: a second store on the same file is refused, and the first one goes on") {
    folder there;
    auto first = opened(there.file(), 100);
    first.add(packets(1, 3)).value();
    auto second = sqlite_store::open(there.file(), 200);
    REQUIRE_FALSE(second);
    CHECK(second.error().code() == ise::errc::io_failed); // it is not damaged, so it is not set aside
    CHECK_THAT(second.error().message(), Contains("cannot open " + there.file() + ": in use by pid " +
                                                  std::to_string(::getpid()) + "; stop that, or give each node"));
    CHECK(first.add(packets(4, 5)).value().last == 5);
    REQUIRE(first.begin_anew(300)); // on the same file, under the same lock
    CHECK(first.head() == 5);
    CHECK_FALSE(sqlite_store::open(there.file(), 400));
    first = opened("memory:elsewhere-alone", 1);
    CHECK(opened(there.file(), 500).head() == 5);
}

TEST_CASE("node store: the store of a process is free again when the process was killed") {
    folder there;
    int ready[2];
    REQUIRE(::pipe(ready) == 0);
    auto child = ::fork();
    REQUIRE(child >= 0);
    if (child == 0) {
        auto store = sqlite_store::open(there.file(), 100);
        char kept = store && store->add(packets(1, 3)) ? 'y' : 'n';
        (void)!::write(ready[1], &kept, 1);
        for (;;) ::pause();
    }
    char kept = 'n';
    CHECK(::read(ready[0], &kept, 1) == 1);
    CHECK(kept == 'y');
    auto refused = sqlite_store::open(there.file(), 200);
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    for (int end : ready) ::close(end);
    REQUIRE_FALSE(refused);
    CHECK_THAT(refused.error().message(), Contains("in use by pid " + std::to_string(child)));
    CHECK(opened(there.file(), 300).add(packets(4, 4)).value().last == 4);
}

TEST_CASE("node store: a packet of another content under the same numbers is kept beside the first, at both nodes") {
    auto a = opened("memory:content-a", 100), b = opened("memory:content-b", 200);
    auto forged = packet(2), own = packet(2, link_id::gprs);
    forged.raw.back() = std::byte{99};
    CHECK(a.add(std::span(&forged, 1)).value().fresh == 1);
    auto kept = a.add(std::span(&own, 1)).value();
    CHECK(kept.fresh == 1);
    CHECK(kept.last == 2);
    for (const auto& again : {own, forged}) CHECK(a.add(std::span(&again, 1)).value().fresh == 0);
    b.add(std::span(&own, 1)).value(); // has come there as well
    CHECK(pull(b, a) == 1);
    CHECK(pull(a, b) == 0);
    for (auto* store : {&a, &b}) {
        auto all = store->track(track_request(), store->head()).value().packets;
        REQUIRE(all.size() == 2);
        for (const auto& one : {forged, own})
            CHECK(std::ranges::count_if(all, [&](const auto& listed) { return listed.raw == one.raw; }) == 1);
    }
}

TEST_CASE("node store: a page leaves out what is known, by the numbers of either node") {
    auto a = opened("memory:page-a", 100), b = opened("memory:page-b", 200);
    a.add(packets(1, 3)).value();
    b.add(packets(3, 3)).value(); // over another link
    CHECK(pull(b, a) == 2);
    CHECK(pull(a, b) == 0);
    b.add(packets(4, 6)).value();
    track_request request;
    request.max_packets = 2;
    // Someone who followed a up to its second packet goes on at b.
    request.seen[a.number()] = 2;
    auto page = b.track(request, b.head()).value();
    CHECK(sequences(page.packets) == numbers{3, 4});
    CHECK(page.more);
    request.seen = page.seen;
    page = b.track(request, b.head()).value();
    CHECK(sequences(page.packets) == numbers{5, 6});
    CHECK_FALSE(page.more);
    request.seen = page.seen;
    CHECK(b.track(request, b.head()).value().packets.empty());
    // Back at a, which has caught up, there is nothing new either.
    CHECK(pull(a, b) == 3);
    CHECK(a.track(request, a.head()).value().packets.empty());
    a.add(packets(7, 7)).value();
    CHECK(sequences(a.track(request, a.head()).value().packets) == numbers{7});
    CHECK(a.track(request, a.head() - 1).value().packets.empty()); // what is not safe yet is not shown
    // A window of time.
    track_request window;
    window.from = packet(2).measured_at;
    window.until = packet(5).measured_at;
    CHECK(sequences(a.track(window, a.head()).value().packets) == numbers{2, 3, 4});
}

TEST_CASE("node store: two nodes come to have the same packets, in pages, and tell each other nothing twice") {
    auto a = opened("memory:same-a", 100), b = opened("memory:same-b", 200);
    a.add(packets(1, 50)).value();
    b.add(packets(40, 90)).value();
    std::uint32_t fresh = 0;
    for (int i = 0; i < 60; ++i) fresh += pull(a, b, 7) + pull(b, a, 7);
    CHECK(fresh == 40 + 39);
    CHECK(a.head() == 90);
    CHECK(b.head() == 90);
    CHECK(a.peer().packets == 90);
    CHECK(b.peer().packets == 90);
    auto page = a.page_after(b.number(), 0, 0, 1000).value();
    for (const auto& one : page.packets) CHECK((one.yours != 0) == !one.packet.has_value());
    CHECK_FALSE(page.more);
}

TEST_CASE("node store: a node that lost its disk gets everything again, and a gap in what is told is refused") {
    auto a = opened("memory:lost-a", 100);
    {
        auto b = opened("memory:lost-b", 200);
        a.add(packets(1, 5)).value();
        pull(b, a);
        b.add(packets(6, 6)).value();
        pull(a, b);
        CHECK(a.peer().store == b.number());
    }
    auto empty = opened("memory:lost-b", 300);
    CHECK(pull(empty, a) == 6); // packets that a knows to be at the lost disk, too
    empty.add(packets(7, 7)).value();
    CHECK(pull(a, empty) == 1);
    CHECK(a.peer().store == empty.number());
    CHECK(a.packets(0, 100, 100).value().at(0).peer_position == 1);
    auto page = empty.page_after(a.number(), 0, 0, 100).value();
    page.after = 7;
    auto twice = a.apply(page, {}, false);
    REQUIRE_FALSE(twice);
    CHECK(twice.error().code() == ise::errc::protocol_error);
    CHECK(a.peer().packets == 7);
}

TEST_CASE("node store: telecommands and authority are on record, changed ones are told again") {
    folder there;
    authority_state held;
    held.holder = "ana";
    held.epoch = 6;
    {
        auto store = opened(there.file(), 5);
        for (std::uint32_t id = 1; id <= 5; ++id) {
            auto one = record(id, telecommand_stage::queued, id % 2 ? "ana" : "bea");
            REQUIRE(store.put(std::span(&one, 1)));
        }
        auto done = record(2, telecommand_stage::acknowledged, "bea");
        done.status.result = ack_code::refused;
        done.status.text = "not now";
        REQUIRE(store.put(std::span(&done, 1)));
        CHECK(store.commands_head() == 6);
        REQUIRE(store.put(held, 1));
        held.epoch = 8;
        held.holder = "bea";
        REQUIRE(store.put(held, 0));
    }
    auto store = opened(there.file(), 5);
    CHECK(store.commands_head() == 6);
    auto two = store.command(2).value();
    REQUIRE(two);
    CHECK(two->status.result == ack_code::refused);
    CHECK(two->status.text == "not now");
    CHECK(two->status.command == record(2).status.command);
    CHECK(two->via == link_id::gprs);
    CHECK(two->node == "shore/one");
    CHECK_FALSE(store.command(99).value());
    auto known = store.remembered().value();
    CHECK(known.open_commands.size() == 4);
    CHECK(known.authority.first.holder == "bea");
    record_request request;
    request.max_entries = 2;
    std::vector<std::uint32_t> listed;
    for (;;) {
        auto page = store.list(request).value();
        if (request.before == 0) CHECK(page.authority.size() == 2);
        for (const auto& one : page.entries) listed.push_back(one.id);
        request.before = page.before;
        if (page.before == 0) break;
    }
    CHECK(listed == numbers{5, 4, 3, 2, 1});
    request.asked_by = "bea";
    CHECK(store.list(request).value().entries.size() == 2);
    auto news = store.page_after(1, 0, 4, 100).value();
    REQUIRE(news.commands.size() == 2);
    CHECK(news.commands[1].status.id == 2);
    CHECK(news.commands_up_to == 6);
}

TEST_CASE("node store: a disk that is full says so, keeps nothing of that call and all of the others") {
    folder there;
    auto store = opened(there.file(), 5);
    REQUIRE(store.add(packets(1, 10)));
    // No file of this process may grow beyond what the log has now.
    std::signal(SIGXFSZ, SIG_IGN);
    rlimit before{};
    REQUIRE(::getrlimit(RLIMIT_FSIZE, &before) == 0);
    rlimit tight = before;
    tight.rlim_cur = std::filesystem::file_size(there.file() + "-wal");
    REQUIRE(::setrlimit(RLIMIT_FSIZE, &tight) == 0);
    auto refused = store.add(packets(8, 200));
    auto command = record(1);
    auto unrecorded = store.put(std::span(&command, 1));
    ::setrlimit(RLIMIT_FSIZE, &before);
    REQUIRE_FALSE(refused);
    CHECK(refused.error().code() == ise::errc::io_failed);
    CHECK_THAT(refused.error().message(), Contains(there.file()));
    REQUIRE_FALSE(unrecorded);
    CHECK(store.head() == 10);
    auto again = store.add(packets(8, 200)).value();
    CHECK(again.fresh == 190);
    CHECK(store.packets(0, 1000, 1000).value().size() == 200);
    REQUIRE(store.put(std::span(&command, 1)));
    CHECK(store.commands_head() == 1);
}

TEST_CASE("node store: what is old goes, its numbers do not come again") {
    folder there;
    {
        auto store = opened(there.file(), 5);
        store.add(packets(1, 10)).value();
        for (std::uint32_t id = 1; id <= 3; ++id) {
            auto one = record(id, id == 1 ? telecommand_stage::queued : telecommand_stage::acknowledged);
            REQUIRE(store.put(std::span(&one, 1)));
        }
        CHECK(store.prune(10, 3).value() == 0);
        CHECK(store.prune(1, 0).value() == 9 + 2); // what is open stays
        CHECK(store.command(1).value());
        CHECK(store.prune(0, 0).value() == 1);
        CHECK(store.prune(100, 100).value() == 0);
    }
    auto store = opened(there.file(), 5);
    CHECK(store.head() == 10);
    CHECK(store.add(packets(11, 11)).value().last == 11);
    auto known = store.remembered().value();
    CHECK(known.newest.size() == 1);
    CHECK(known.last_location->sequence == 11);
}

} // namespace store_test
