// Peers over udp that have a session, and break the rules of the datagrams that carry it.
#include "strait.hpp"

namespace channels_test {

using namespace hostile_test;
using ise::wire::datagram_type;

TEST_CASE("hostile: acks of what was never sent, and acks ahead of time, hasten and harm nobody") {
    strait at;
    ise::buffer lie;
    lie.append(std::uint64_t{1} << 40);
    lie.append(std::uint32_t{0});
    lie.append(std::uint32_t{1} << 30);
    auto terms = ise::encode(fleet::terms(position));
    at.peer.say(frame_type::subscribe, 1, terms);
    at.go_on(200ms);
    REQUIRE(at.fixes.subscribers() == 2);
    auto packets = [&] { return at.peer.wire.count(datagram_type::data); };
    auto before = packets();
    for (std::uint64_t i = 0; i < 3000; ++i) {
        if (i % 3 == 0) { // every number there may be, as if each had come at once
            ise::buffer ahead;
            ahead.append(i);
            ahead.append(std::uint32_t{0xffff'ffff});
            ahead.append(static_cast<std::uint32_t>(i + 1));
            at.peer.put(chunk_type::ack, ahead.view());
        } else if (i % 3 == 1) {
            at.peer.put(chunk_type::ack, lie.view());
        } else { // runs that overlap, or go below zero
            ise::buffer runs;
            runs.append(std::uint64_t{3});
            runs.append(std::uint32_t{0});
            for (std::uint32_t length : {1u, 1u, 1u, 9u, 0u, 0xffff'ffffu, 2u}) runs.append(length);
            runs.append(std::uint32_t{0});
            at.peer.put(chunk_type::ack, runs.view());
        }
        if (i % 50 == 0) at.go_on();
    }
    CHECK(packets() > before); // its own packets still come
    CHECK(packets() - before < 2000);
    at.nobody_noticed(true);
}

TEST_CASE("hostile: room that shrinks, or jumps beyond all bounds, changes what waits for nobody else") {
    ise::service_options options;
    options.session_bytes = 1 << 20;
    strait at(options);
    ise::wire::introduction result;
    result.service = "echo";
    result.fingerprints = echo.types().fingerprints;
    auto body = ise::encode(result);
    at.peer.say(frame_type::introduce, 0, body);
    blob little;
    little.content.resize(700);
    auto packet = ise::encode(little);
    std::size_t most = 0;
    const std::uint64_t rooms[] = {0, ~std::uint64_t{0}, 1, std::uint64_t{1} << 63, 32768, ~std::uint64_t{0} - 1};
    for (std::uint64_t call = 0; call < 4000 && at.of_raw(); ++call) {
        ise::buffer request;
        request.append(std::uint32_t{0});
        request.append(std::int64_t{3'600'000'000'000});
        request.append(ise::bytes_view(packet));
        at.peer.say(frame_type::request, call % 4096, request.view());
        at.peer.put(chunk_type::room, rooms[call % std::size(rooms)]);
        if (call % 20 == 0) at.go_on();
        if (auto* session = at.of_raw()) most = std::max(most, session->wire().out().pending_call_bytes());
    }
    CHECK(most > 500'000);           // nothing is acknowledged: it all waits
    CHECK(most < (2u << 20) + 2000); // refusals beyond the first of these two
    at.nobody_noticed(true);
}

TEST_CASE("hostile: of messages that never become whole 32 are kept, 2 MiB of them, and not for longer than 10 s") {
    strait at;
    const ise::bytes full(part);
    at.begin_telltale(0);
    bool kept = false;
    SECTION("few others") {
        for (std::uint64_t number = 1; number <= 31; ++number) at.peer.fragment(number, 1 << 20, 0, full);
        kept = true;
    }
    SECTION("many others") {
        for (std::uint64_t number = 1; number <= 5000; ++number) {
            at.peer.fragment(number, 1 << 20, 0, full);
            if (number % 100 == 0) at.go_on();
        }
    }
    SECTION("big ones") {
        for (std::uint64_t number = 1; number <= 3; ++number)
            for (std::uint32_t index = 0; index < 1000; ++index) {
                at.peer.fragment(number, 1 << 20, index, full);
                if (index % 50 == 0) at.go_on();
            }
    }
    SECTION("soon") {
        for (int s = 0; s < 9; ++s) at.alive(), at.go_on(1s);
        kept = true;
    }
    SECTION("late") {
        for (int s = 0; s < 11; ++s) at.alive(), at.go_on(1s);
    }
    at.go_on();
    CHECK(at.telltale_is_kept(0) == kept);
    at.nobody_noticed(!kept);
}

TEST_CASE(
    "hostile: packets of subscriptions that have ended are not sent again, though their arrival was never confirmed") {
    strait at;
    auto fragment_of = [](const raw_datagrams::came& one) {
        if (one.type != datagram_type::data) return false;
        ise::wire::chunk_reader chunks(ise::bytes_view(one.body).subspan(8));
        while (auto part_of_it = chunks.next())
            if (part_of_it->type == chunk_type::fragment) return true;
        return false;
    };
    std::size_t seen = 0;
    auto confirm_all_but_packets = [&] {
        at.peer.data([&](ise::wire::data_writer& to) {
            to.put(chunk_type::probe, {});
            for (; seen < at.peer.wire.got.size() && to.room() > 100; ++seen) {
                const auto& one = at.peer.wire.got[seen];
                if (one.type != datagram_type::data || fragment_of(one)) continue;
                ise::buffer ack;
                ack.append(ise::detail::load_little<std::uint64_t>(one.body.data()));
                ack.append(std::uint32_t{0});
                ack.append(std::uint32_t{1});
                to.put(chunk_type::ack, ack.view());
            }
        });
        at.go_on();
    };
    ise::wire::subscribe wanted;
    wanted.service.service = pictures.name();
    wanted.service.fingerprints = pictures.types().fingerprints;
    const auto terms = ise::encode(wanted);
    blob image;
    image.content.resize(3000);
    for (std::uint64_t id = 1; id <= 20; ++id) {
        at.peer.say(frame_type::subscribe, id, terms);
        confirm_all_but_packets();
        at.images(image);
        confirm_all_but_packets();
        at.peer.say(frame_type::unsubscribe, id, {});
        confirm_all_but_packets();
    }
    REQUIRE(at.images.subscribers() == 0);
    CHECK(std::ranges::count_if(at.peer.wire.got, fragment_of) >= 20); // they did come
    for (int count = 0; count < 50; ++count) confirm_all_but_packets();
    const auto before = std::ranges::count_if(at.peer.wire.got, fragment_of);
    for (int count = 0; count < 200; ++count) confirm_all_but_packets();
    CHECK(std::ranges::count_if(at.peer.wire.got, fragment_of) == before);
    at.nobody_noticed(true);
}

TEST_CASE("hostile: fragments that cannot be are as if they had not come") {
    strait at;
    const ise::bytes full(part);
    at.begin_telltale(1);
    struct {
        std::uint64_t number;
        std::uint32_t size, index;
        std::size_t bytes;
    } const wrong[] = {
        {5, 0xffff'ffff, 0, part},
        {5, (1 << 20) + 17, 0, part},
        {5, 1 << 20, 1024, part},
        {5, 1 << 20, 0xffff'ffff, part},
        {5, 1 << 20, 0x0040'0000, part},
        {5, 1 << 20, 0, part - 1},
        {5, 1 << 20, 0, 1},
        {5, 1 << 20, 0, 0},
        {5, 15, 0, 15},
        {5, 0, 0, 1},
        {1, 3000, 1, part},
        {1, 1 << 20, 1, part},
        {~std::uint64_t{0}, 0x8000'0000, 0, part},
    };
    const auto taken = at.peer.number;
    for (int round = 0; round < 100; ++round)
        for (const auto& one : wrong)
            at.peer.fragment(one.number, one.size, one.index, ise::bytes_view(full).first(one.bytes));
    for (std::size_t size : {0u, 8u, 15u}) at.peer.put(chunk_type::fragment, ise::bytes_view(full).first(size));
    at.go_on(1s);
    CHECK(at.of_raw());
    CHECK(at.peer.acked() < taken);
    CHECK(at.telltale_is_kept(1)); // and harmed nothing that was there
    at.nobody_noticed(false);
}

TEST_CASE("hostile: content beyond the room, far away or about what came before is not taken") {
    strait at;
    ise::buffer ping;
    ise::wire::put_frame(ping, frame_type::ping, 0, 4711, [](ise::buffer&) {});
    auto at_offset = [&](std::uint64_t offset, ise::bytes_view bytes) {
        std::array<std::byte, 8> head;
        ise::detail::store_little(head.data(), offset);
        at.peer.put(chunk_type::content, head, bytes);
    };
    const ise::bytes junk(1000, std::byte{0xff});
    const auto room = at.peer.offset + 32768, taken = at.peer.number;
    for (auto far :
         {room, room - 999, std::uint64_t{1} << 32, ~std::uint64_t{0}, ~std::uint64_t{0} - 999, std::uint64_t{1} << 63})
        for (int i = 0; i < 100; ++i) at_offset(far, junk);
    at.go_on();
    CHECK(at.peer.acked() < taken);
    for (std::uint64_t back = 0; back < at.peer.offset; back += 10) // what was taken stays as it was
        at_offset(back, ise::bytes_view(junk).first(std::min<std::uint64_t>(10, at.peer.offset - back)));
    // Single bytes with gaps between them, more than are remembered.
    for (std::uint64_t i = 0; i < 2000; ++i) {
        at_offset(at.peer.offset + 100 + 2 * i, ise::bytes_view(junk).first(1));
        if (i % 100 == 0) at.go_on();
    }
    at.go_on(1s);
    CHECK(at.of_raw());
    at.peer.content(ping.view()); // in order, and heard
    at.go_on(1s);
    CHECK(at.of_raw());
    CHECK(at.peer.acked() == at.peer.number - 1);
    at.nobody_noticed(true);
}

TEST_CASE("hostile: a stream that ends where it cannot, or in the middle of a frame, ends its own session at most") {
    strait at;
    bool stays = true;
    SECTION("before what came") { at.peer.put(chunk_type::end, 0); }
    SECTION("far away") {
        for (auto offset : {~std::uint64_t{0}, std::uint64_t{1} << 40}) at.peer.put(chunk_type::end, offset);
    }
    SECTION("in a frame") {
        ise::buffer half;
        ise::wire::put_frame(half, frame_type::ping, 0, 1, [](ise::buffer& to) { to.append(std::uint64_t{1}); });
        at.peer.content(half.view().first(20));
        at.peer.put(chunk_type::end, at.peer.offset);
        stays = false;
    }
    SECTION("and goes on behind its end") {
        at.peer.put(chunk_type::end, at.peer.offset + 5);
        at.peer.content(ise::bytes(100));
        at.peer.put(chunk_type::end, at.peer.offset);
    }
    at.go_on(200ms);
    CHECK((at.of_raw() != nullptr) == stays);
    at.nobody_noticed(stays);
}

TEST_CASE("hostile: a flood of challenges, and of probes with gaps between them, is answered one for one at most") {
    strait at;
    const auto said = at.peer.wire.said, heard = at.peer.wire.heard(), answers = at.peer.wire.got.size();
    const bool challenges = GENERATE(true, false);
    for (std::uint64_t i = 0; i < 3000; ++i) {
        if (challenges) {
            at.peer.data([&](ise::wire::data_writer& to) {
                for (std::uint64_t value = 0; value < 100; ++value) to.put(chunk_type::challenge, i + value);
            });
        } else {
            at.alive();
            at.peer.number += 2;
        }
        if (i % 50 == 0) at.go_on();
    }
    at.go_on();
    // The answer, and now and then an ack; to where it comes from, which has shown that it receives there.
    CHECK(at.peer.wire.got.size() - answers <= 2 * 3000 + 200);
    if (challenges) CHECK(at.peer.wire.heard() - heard < (at.peer.wire.said - said) / 4);
    at.nobody_noticed(true);
}

TEST_CASE("hostile: who knows the id of its own session only is no other's peer, wherever it speaks from") {
    strait at;
    raw_datagrams elsewhere(at.all, at.all.world.host("reef").start_process("reef"), at.channel);
    for (int i = 0; i < 1000; ++i) {
        elsewhere.data(at.peer.theirs, at.peer.number++,
                       [](ise::wire::data_writer& to) { to.put(chunk_type::probe, {}); });
        if (i % 50 == 0) at.go_on();
    }
    at.go_on(1s);
    // Asked whether it receives there, and nothing else: no ack, no packet.
    for (const auto& one : elsewhere.got) {
        REQUIRE(one.type == datagram_type::data);
        CHECK(one.size == ise::wire::data_head_bytes + ise::wire::chunk_head_bytes + 8);
    }
    CHECK(elsewhere.got.size() <= 1000);
    elsewhere.say(datagram_type::closed, at.peer.theirs); // it knows that id
    at.go_on();
    at.nobody_noticed(false);
}

} // namespace channels_test
