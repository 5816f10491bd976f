#include <ise/wire/parser.hpp>

#include <support/catch.hpp>

#include <cstring>
#include <random>
#include <string>

namespace parser_test {

using ise::wire::frame_header;
using ise::wire::frame_type;
using ise::wire::parser;

namespace {

ise::bytes frames_of(const std::vector<std::size_t>& sizes) {
    ise::buffer out;
    std::uint64_t id = 1;
    for (auto size : sizes) {
        ise::wire::put_frame(out, frame_type::packet, 0, id, [&](ise::buffer& body) {
            for (std::size_t i = 0; i < size; ++i) body.append(static_cast<std::uint8_t>(id + i));
        });
        ++id;
    }
    return out.to_bytes();
}

// Feeds as if reads brought at most `at_once` bytes; gives the sizes of the bodies, having checked their content.
std::vector<std::size_t> feed(parser& into, ise::bytes_view raw, std::size_t at_once) {
    std::vector<std::size_t> sizes;
    while (!raw.empty()) {
        auto room = into.prepare();
        REQUIRE(!room.empty());
        auto count = std::min({room.size(), raw.size(), at_once});
        std::memcpy(room.data(), raw.data(), count);
        into.commit(count);
        raw = raw.subspan(count);
        for (;;) {
            auto found = into.next();
            REQUIRE(found);
            if (!*found) break;
            const auto& frame = **found;
            CHECK(frame.header.id == sizes.size() + 1);
            bool right = true;
            for (std::size_t i = 0; i < frame.body.size(); ++i)
                right = right && frame.body[i] == static_cast<std::byte>(frame.header.id + i);
            CHECK(right);
            sizes.push_back(frame.body.size());
        }
    }
    return sizes;
}

} // namespace

TEST_CASE("frames come whole, whatever the pieces in which their bytes come") {
    const std::vector<std::size_t> sizes{0, 1, 15, 16, 17, 300, 0, 5000, 2, 70000, 3};
    const auto raw = frames_of(sizes);
    for (std::size_t at_once : {1u, 2u, 3u, 7u, 15u, 16u, 17u, 100u, 2048u, 100000u}) {
        parser in(1 << 20);
        CHECK(feed(in, raw, at_once) == sizes);
        CHECK(in.pending() == 0);
    }
}

TEST_CASE("every prefix of a stream gives the frames that are whole in it") {
    const std::vector<std::size_t> sizes{0, 5, 40};
    const auto raw = frames_of(sizes);
    for (std::size_t length = 0; length <= raw.size(); ++length) {
        parser in(1 << 20);
        auto got = feed(in, ise::bytes_view(raw).first(length), 1000);
        CHECK(got.size() == (length >= raw.size() ? 3u : length >= 16 + 21 ? 2u : length >= 16 ? 1u : 0u));
    }
}

TEST_CASE("frames of one type, one id and the same flags are taken together, as far as they are whole and sound") {
    ise::buffer raw;
    auto put = [&raw](std::uint64_t id, std::uint8_t flags, std::size_t size) {
        ise::wire::put_frame(raw, frame_type::packet, flags, id,
                             [&](ise::buffer& body) { std::memset(body.grow(size), static_cast<int>(id), size); });
    };
    put(1, 2, 5);
    put(1, 2, 0);
    put(1, 2, 40); // 93 bytes
    const std::size_t alike = raw.size();
    const std::uint64_t whole_others = 2;
    SECTION("then another id") { put(2, 2, 5); }
    SECTION("then other flags") { put(1, 3, 5); }
    SECTION("then another type") {
        ise::wire::put_frame(raw, frame_type::ended, 2, 1, [](ise::buffer&) {});
    }
    SECTION("then one that is too long") {
        put(1, 2, 5);
        raw.patch_u32(alike, 2000);
    }
    SECTION("then none") {}
    const std::size_t after = raw.size();
    for (std::size_t length = 21; length <= after; ++length) {
        parser in(1000);
        in.add(raw.view().first(length));
        ise::wire::frame first;
        REQUIRE(in.take(first));
        std::uint64_t others = 0;
        const auto run = in.take_alike(first, others);
        const std::uint64_t expected = length >= alike ? whole_others : length >= 37 ? 1 : 0;
        CHECK(others == expected);
        const std::size_t sizes[] = {21, 37, alike};
        CHECK(run.size() == sizes[expected]);
        CHECK(std::memcmp(run.data(), raw.data(), run.size()) == 0);
        CHECK(in.pending() == length - run.size());
    }
}

TEST_CASE("a buffer that little is read into shrinks, and one without a part of a frame is given back") {
    parser in(1 << 20);
    feed(in, frames_of({200'000}), 1000);
    REQUIRE(in.capacity() >= 200'000);
    const auto whole = frames_of({7});
    for (int i = 0; i < 100; ++i) feed(in, whole, 1000);
    CHECK(in.capacity() < 1000);
    feed(in, ise::bytes_view(whole).first(whole.size() - 1), 1000);
    in.release();
    CHECK(feed(in, ise::bytes_view(whole).last(1), 1) == std::vector<std::size_t>{7});
    in.release();
    CHECK(in.capacity() == 0);
}

TEST_CASE("a whole buffer is taken over, behind a part of a frame that lies there") {
    parser in(1 << 20);
    const auto raw = frames_of({300, 20});
    const auto frame = raw.size() - frame_header::size - 20;
    for (std::size_t first : {std::size_t{0}, std::size_t{1}, frame, frame + 5, raw.size()}) {
        if (first > 0) {
            auto room = in.prepare();
            while (in.pending() < first) {
                const auto count = std::min(room.size(), first - in.pending());
                std::memcpy(room.data(), raw.data() + in.pending(), count);
                in.commit(count);
                room = in.prepare();
            }
        }
        ise::buffer rest;
        rest.append(ise::bytes_view(raw).subspan(first));
        in.add(rest);
        CHECK(rest.empty());
        for (std::size_t size : {300u, 20u}) {
            auto found = in.next();
            REQUIRE(found);
            REQUIRE(*found);
            CHECK((*found)->body.size() == size);
            CHECK((*found)->body.back() == static_cast<std::byte>((*found)->header.id + size - 1));
        }
        CHECK(in.pending() == 0);
    }
}

TEST_CASE("a frame beyond the limit is refused before anything is allocated for it") {
    parser in(1000);
    auto good = frames_of({1000});
    CHECK(feed(in, good, 5000).size() == 1);
    auto bad = frames_of({1001});
    auto room = in.prepare();
    std::memcpy(room.data(), bad.data(), 16);
    in.commit(16);
    auto found = in.next();
    REQUIRE_FALSE(found);
    CHECK(found.error().code() == ise::errc::too_large);
    CHECK_THAT(found.error().message(),
               ise_test::Contains("packet") && ise_test::Contains("1001") && ise_test::Contains("(max_frame_bytes)"));

    parser other(1 << 20);
    frame_header huge;
    huge.length = 0xffffffff;
    huge.type = frame_type::request;
    ise::buffer raw;
    ise::wire::put_header(raw, huge);
    room = other.prepare();
    std::memcpy(room.data(), raw.data(), raw.size());
    other.commit(raw.size());
    (void)other.prepare(); // even where nobody looked
    CHECK(other.capacity() <= (1u << 20) + frame_header::size);
    CHECK_FALSE(other.next());
}

TEST_CASE("what is no frame of ISE is refused at its header") {
    std::string tls("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\x00\x01\x02\x03\x04", 16);
    for (std::string text : {std::string("GET / HTTP/1.1\r\nHost: x\r\n\r\n"), tls}) {
        parser in(0xffffffff);
        auto room = in.prepare();
        std::memcpy(room.data(), text.data(), text.size());
        in.commit(text.size());
        CHECK_FALSE(in.next());
    }
    for (int type : {0, 128, 255}) {
        ise::buffer raw;
        frame_header header;
        header.type = static_cast<frame_type>(type);
        ise::wire::put_header(raw, header);
        parser in(1000);
        std::memcpy(in.prepare().data(), raw.data(), raw.size());
        in.commit(raw.size());
        CHECK(in.next().error().code() == ise::errc::protocol_error);
    }
}

TEST_CASE("random bytes never do more than fail") {
    std::mt19937 random(7);
    for (int round = 0; round < 2000; ++round) {
        parser in(4096);
        bool broken = false;
        for (int reads = 0; reads < 20 && !broken; ++reads) {
            auto room = in.prepare();
            std::size_t count = std::min<std::size_t>(room.size(), random() % 64);
            for (std::size_t i = 0; i < count; ++i) room[i] = static_cast<std::byte>(random() % 3 ? 0 : random());
            in.commit(count);
            for (;;) {
                auto found = in.next();
                broken = !found;
                if (!found || !*found) break;
            }
        }
        CHECK(in.capacity() <= 8192);
    }
}

} // namespace parser_test
