#include <ise/wire/pieces.hpp>

#include <support/catch.hpp>

#include <random>

namespace pieces_test {

using namespace ise::wire;
using ise_test::Contains;

namespace {

struct piece_of {
    ise::buffer body;
    frame made;
    piece_of(std::uint64_t id, std::uint8_t flags, std::optional<piece_head> head, std::size_t content,
             std::uint8_t fill = 0) {
        if (head) head->put(body);
        for (std::size_t i = 0; i < content; ++i) body.append(fill);
        made.header.type = frame_type::piece;
        made.header.flags = flags;
        made.header.id = id;
        made.body = body.view();
    }
};

piece_head head_of(std::uint64_t length, frame_type type = frame_type::request) {
    piece_head head;
    head.type = type;
    head.flags = 1;
    head.id = 77;
    head.length = length;
    return head;
}

} // namespace

TEST_CASE("a message in pieces is whole again at its last piece") {
    reassembly in(1000);
    CHECK_FALSE(in.take(piece_of(1, 0, head_of(10), 4, 1).made).value());
    CHECK_FALSE(in.take(piece_of(2, 0, head_of(3, frame_type::packet), 0).made).value()); // another between
    CHECK(in.unfinished() == 2);
    CHECK_FALSE(in.take(piece_of(1, 0, {}, 4, 2).made).value());
    CHECK(in.bytes_held() == 8);
    auto second = in.take(piece_of(2, flag::last, {}, 3, 9).made).value();
    REQUIRE(second);
    CHECK((second->header.type == frame_type::packet && second->body.to_bytes() == ise::bytes(3, std::byte{9})));
    auto first = in.take(piece_of(1, flag::last, {}, 2, 3).made).value();
    REQUIRE(first);
    CHECK(
        (first->header.id == 77 && first->header.flags == 1 && first->header.length == 10 && first->body.size() == 10));
    CHECK((in.unfinished() == 0 && in.bytes_held() == 0));
}

TEST_CASE("of a piece that has come in part the rest is read to its place in the message") {
    const auto begun = [](const piece_of& piece, std::size_t come) {
        frame part = piece.made;
        part.header.length = static_cast<std::uint32_t>(piece.made.body.size());
        part.body = part.body.first(come);
        return part;
    };
    const piece_of first(1, 0, head_of(500), 200, 1), last(1, flag::last, {}, 300, 2);
    for (std::size_t cut : {18u, 19u, 100u, 217u}) {
        for (std::size_t at_once : {1u, 7u, 300u}) {
            reassembly in(1000);
            std::optional<assembled> whole;
            for (const auto* piece : {&first, &last}) {
                auto come = cut;
                REQUIRE(in.begin(begun(*piece, come)).value());
                while (in.missing() > 0) {
                    const auto room = in.room();
                    REQUIRE(room.size() == in.missing() + frame_header::size);
                    const auto count = std::min(at_once, in.missing());
                    std::copy_n(piece->made.body.begin() + static_cast<std::ptrdiff_t>(come), count, room.begin());
                    std::fill(room.begin() + static_cast<std::ptrdiff_t>(count), room.end(), std::byte{99});
                    come += count;
                    CHECK_FALSE(whole);
                    whole = in.fill(count).value();
                }
                CHECK(come == piece->made.body.size());
            }
            REQUIRE(whole);
            ise::bytes expected(200, std::byte{1});
            expected.resize(500, std::byte{2});
            CHECK((whole->header.id == 77 && whole->body.to_bytes() == expected));
            CHECK((in.unfinished() == 0 && in.bytes_held() == 0));
        }
    }
    reassembly in(1000);
    CHECK_FALSE(in.begin(begun(first, 17)).value()); // the head is not whole
    CHECK_FALSE(in.begin(begun(piece_of(1, flag::abandoned, {}, 30), 20)).value());
    CHECK(in.unfinished() == 0);
    CHECK(in.begin(begun(piece_of(1, 0, head_of(1001), 20), 20)).error().code() == ise::errc::too_large);
    CHECK(in.begin(begun(piece_of(1, 0, head_of(199), 200), 20)).error().code() == ise::errc::protocol_error);
    for (std::uint64_t id = 2; id <= 3; ++id) CHECK(in.take(piece_of(id, 0, head_of(1000), 999).made).has_value());
    CHECK(in.begin(begun(piece_of(4, 0, head_of(1000), 3), 19)).error().code() == ise::errc::too_large);
}

TEST_CASE("an abandoned message is forgotten, and its number may be used again") {
    reassembly in(1000);
    in.take(piece_of(1, 0, head_of(10), 4).made).value();
    CHECK_FALSE(in.take(piece_of(1, flag::abandoned, {}, 0).made).value());
    CHECK((in.unfinished() == 0 && in.bytes_held() == 0));
    CHECK_FALSE(in.take(piece_of(5, flag::abandoned, {}, 0).made).value()); // of nothing
    CHECK(in.take(piece_of(1, flag::last, head_of(2), 2).made).value());
}

TEST_CASE("hostile pieces end the connection, and what they claim costs nothing") {
    reassembly in(1 << 20);
    auto code = [&](const piece_of& piece) { return in.take(piece.made).error().code(); };
    SECTION("half a head") { CHECK(code(piece_of(1, 0, {}, 17)) == ise::errc::protocol_error); }
    SECTION("too long") {
        auto refused = in.take(piece_of(1, 0, head_of(~0ull), 10).made).error();
        CHECK(refused.code() == ise::errc::too_large);
        CHECK_THAT(refused.message(), Contains("(max_message_bytes)"));
    }
    SECTION("more than announced") { CHECK(code(piece_of(1, 0, head_of(9), 10)) == ise::errc::protocol_error); }
    SECTION("less than announced") {
        CHECK(code(piece_of(1, flag::last, head_of(11), 10)) == ise::errc::protocol_error);
    }
    SECTION("many messages at once") {
        std::optional<ise::failure> refused;
        for (std::uint64_t id = 0; id < 1000 && !refused; ++id) {
            auto taken = in.take(piece_of(id, 0, head_of(1 << 20), 1).made);
            if (!taken) refused = taken.error();
        }
        REQUIRE(refused);
        CHECK(refused->code() == ise::errc::too_large);
        CHECK_THAT(refused->message(), Contains("(unfinished_messages)"));
        CHECK(in.bytes_held() == in.unfinished());
    }
    SECTION("many bytes at once") {
        std::optional<ise::failure> refused;
        for (std::uint64_t id = 0; id < 10 && !refused; ++id) {
            auto taken = in.take(piece_of(id, 0, head_of(1 << 20), (1 << 20) - 1).made);
            if (!taken) refused = taken.error();
        }
        REQUIRE(refused);
        CHECK(refused->code() == ise::errc::too_large);
        CHECK_THAT(refused->message(), Contains("(unfinished_messages)"));
        CHECK(in.bytes_held() <= 2u << 20);
    }
}

TEST_CASE("random pieces never hold more than the limit") {
    std::mt19937 random(3);
    for (int round = 0; round < 300; ++round) {
        reassembly in(5000);
        for (int i = 0; i < 100; ++i) {
            std::optional<piece_head> head;
            if (random() % 2) head = head_of(random() % 6000);
            auto taken =
                in.take(piece_of(random() % 4, static_cast<std::uint8_t>(random() % 4), head, random() % 1500).made);
            CHECK(in.bytes_held() <= 10000);
            if (!taken) break;
        }
    }
}

} // namespace pieces_test
