#include <ise/net/outbox.hpp>

#include <ise/wire/pieces.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <deque>

namespace outbox_test {

using ise::net::batch;
using ise::net::outbox;
using ise::wire::frame_type;

namespace {

struct written {
    frame_type type;
    std::uint8_t flags;
    std::uint64_t id;
    ise::bytes body;
};

std::vector<written> frames_of(ise::bytes_view all) {
    std::vector<written> found;
    for (std::size_t at = 0; at < all.size();) {
        auto header = ise::wire::read_header(all.data() + at);
        at += 16;
        REQUIRE(at + header.length <= all.size());
        auto* body = all.data() + at;
        found.push_back({header.type, header.flags, header.id, ise::bytes(body, body + header.length)});
        at += header.length;
    }
    return found;
}
std::vector<written> frames_of(batch& from) {
    ise::bytes all;
    for (const auto& part : from.remaining()) {
        auto* data = static_cast<const std::byte*>(part.data());
        all.insert(all.end(), data, data + part.size());
    }
    return frames_of(ise::bytes_view(all));
}
std::vector<written> write(outbox& from) {
    batch out;
    if (!from.fill(out)) return {};
    return frames_of(out);
}
std::vector<std::uint64_t> ids_of(const std::vector<written>& frames) {
    std::vector<std::uint64_t> ids;
    for (const auto& frame : frames) ids.push_back(frame.id);
    return ids;
}

void request(outbox& to, std::uint64_t id, std::size_t size = 4) {
    const auto start = to.calls().size();
    ise::wire::put_frame(to.calls(), frame_type::request, 0, id, [&](ise::buffer& body) {
        ise::wire::request_head().put(body);
        for (std::size_t i = 0; i < size; ++i) body.append(static_cast<std::uint8_t>(id));
    });
    to.end_call(start);
}
void ping(outbox& to, std::uint64_t id) {
    ise::wire::put_frame(to.control(), frame_type::ping, 0, id, [](ise::buffer&) {});
}

constexpr auto number = ise::object_type::of<int>([](const void*, ise::buffer&) {});
void request_beside(outbox& to, std::uint64_t id) {
    const auto start = to.calls().size();
    ise::wire::put_frame(to.calls(), frame_type::request, ise::wire::flag::attached, id,
                         [](ise::buffer& body) { ise::wire::request_head().put(body); });
    to.end_call(start, ise::passed_object(number, static_cast<int>(id), 100));
}

struct source final : ise::net::publication_source {
    std::uint64_t id;
    std::deque<ise::shared_bytes> waiting;
    int asked = 0;
    explicit source(std::uint64_t own_id) : id(own_id) {}
    void put(std::size_t size) {
        ise::buffer content;
        std::fill_n(content.grow(size), size, static_cast<std::byte>(id));
        waiting.emplace_back(std::move(content));
    }
    bool take(outbox& out, std::size_t quantum) override {
        ++asked;
        std::size_t taken = 0;
        while (!waiting.empty() && taken < quantum) {
            ise::wire::frame_header header;
            header.type = frame_type::packet;
            header.id = id;
            auto packet = waiting.front();
            waiting.pop_front();
            std::byte head[8]{};
            out.put_packet(*this, header, head, packet);
            taken += packet.size();
            if (packet.size() > outbox::whole_bytes) break;
        }
        return !waiting.empty();
    }
};

} // namespace

TEST_CASE("control goes first, then calls, then publications") {
    outbox out;
    source news(30);
    news.put(10);
    out.add(news);
    request(out, 20);
    ping(out, 10);
    CHECK(ids_of(write(out)) == std::vector<std::uint64_t>{10, 20, 30});
    CHECK(out.empty());
    CHECK(write(out).empty());
}

TEST_CASE("calls that wait alone are written from where they lie, and go with what is beside them") {
    outbox out;
    request(out, 1);
    request_beside(out, 2);
    REQUIRE(out.calls_alone());
    SECTION("at once") {
        CHECK(ids_of(frames_of(out.calls().view())) == std::vector<std::uint64_t>{1, 2});
        REQUIRE(out.beside_calls().size() == 1);
        CHECK(*static_cast<int*>(out.beside_calls().pop_front().at()) == 2);
        out.calls_went();
    }
    SECTION("where they cannot go: by a batch") {
        batch later;
        out.move_calls(later);
        CHECK(ids_of(frames_of(later)) == std::vector<std::uint64_t>{1, 2});
        CHECK(later.attachments().size() == 1);
        CHECK(later.weight() == later.bytes() + 100);
    }
    CHECK(out.empty());
    CHECK(out.pending_bytes() == 0);
    CHECK(out.pending_call_bytes() == 0);
    CHECK_FALSE(out.calls_alone());
}

TEST_CASE("calls that do not wait alone are written with what waits beside them") {
    outbox out;
    source news(30);
    request(out, 1);
    bool withdrawn = false;
    SECTION("control") { ping(out, 10); }
    SECTION("a publication") { out.add(news); }
    SECTION("a message in pieces") { request(out, 2, 200'000); }
    SECTION("more than one write takes") { out.limit_batch(10); }
    SECTION("one that was withdrawn") {
        request(out, 2);
        CHECK(out.withdraw(2));
        withdrawn = true;
    }
    CHECK_FALSE(out.calls_alone());
    auto frames = write(out);
    CHECK(std::ranges::any_of(frames, [](const auto& one) { return one.id == 1 && one.type == frame_type::request; }));
    if (withdrawn) CHECK(ids_of(frames) == std::vector<std::uint64_t>{1});
    out.remove(news);
}

TEST_CASE("many requests that were withdrawn do not hide one that is good") {
    outbox out;
    for (std::uint64_t id = 0; id < 20'000; ++id) request(out, id);
    request(out, 77'777);
    for (std::uint64_t id = 20'000; id > 0; --id) REQUIRE(out.withdraw(id - 1));
    CHECK(ids_of(write(out)) == std::vector<std::uint64_t>{77'777});
    CHECK(out.pending_bytes() == 0);
}

TEST_CASE("requests that were withdrawn do not pile up where nothing is written") {
    constexpr std::uint64_t all = 20'000, at_once = 100;
    outbox out;
    std::size_t most = 0;
    for (std::uint64_t id = 0; id < all; ++id) {
        request(out, id, 40);
        if (id >= at_once) REQUIRE(out.withdraw(id - at_once));
        most = std::max(most, out.pending_bytes());
    }
    CHECK(most < 3 * 64 * 1024);
    std::vector<std::uint64_t> left;
    for (auto id = all - at_once; id < all; ++id) left.push_back(id);
    CHECK(ids_of(write(out)) == left);
    CHECK(out.empty());
    CHECK(out.pending_bytes() == 0);
    request(out, 1);
    CHECK(out.calls_alone());
}

TEST_CASE("a request that was withdrawn takes along what is beside it, and each other one keeps its own") {
    outbox out;
    for (std::uint64_t id = 1; id <= 4; ++id) request_beside(out, id);
    request(out, 5);
    CHECK(out.withdraw(2));
    CHECK(out.withdraw(4));
    CHECK_FALSE(out.withdraw(2)); // once
    batch one;
    REQUIRE(out.fill(one));
    CHECK(ids_of(frames_of(one)) == std::vector<std::uint64_t>{1, 3, 5});
    REQUIRE(one.attachments().size() == 2);
    CHECK(*static_cast<int*>(one.attachments().pop_front().at()) == 1);
    CHECK(*static_cast<int*>(one.attachments().pop_front().at()) == 3);
    CHECK(out.empty());
    CHECK(out.pending_bytes() == 0);
    request(out, 6); // none of them is left to be passed over
    CHECK(out.calls_alone());
}

TEST_CASE("calls leave in the order in which they came, in batches of bounded size, and nothing piles up") {
    outbox out;
    std::vector<std::uint64_t> seen;
    std::uint64_t next = 0;
    for (int round = 0; round < 50; ++round) {
        for (int i = 0; i < 100; ++i) request(out, next++, 4000);
        batch one;
        REQUIRE(out.fill(one));
        CHECK(one.bytes() <= outbox::batch_bytes + outbox::block_bytes + 5000);
        for (const auto& frame : frames_of(one)) seen.push_back(frame.id);
    }
    while (!out.empty())
        for (const auto& frame : write(out)) seen.push_back(frame.id);
    REQUIRE(seen.size() == next);
    CHECK(std::is_sorted(seen.begin(), seen.end()));
}

TEST_CASE("large calls are written from where they were encoded, in order with the small ones") {
    constexpr std::size_t large = outbox::block_bytes;
    outbox out;
    std::vector<const void*> encoded;
    for (std::uint64_t id = 1; id <= 3; ++id) {
        const auto start = out.calls().size();
        ise::wire::put_frame(out.calls(), frame_type::reply, 0, id, [&](ise::buffer& body) { body.grow(large); });
        encoded.push_back(out.calls().data());
        out.end_call(start);
    }
    request(out, 4);
    request(out, 5, large);
    request(out, 6);
    ping(out, 7);
    const auto waiting = out.pending_call_bytes();
    CHECK(waiting > 4 * large);
    SECTION("all of it") {
        batch first;
        REQUIRE(out.fill(first));
        std::vector<const void*> places;
        for (const auto& part : first.remaining()) places.push_back(part.data());
        for (const auto* place : encoded) CHECK(std::count(places.begin(), places.end(), place) == 1);
        auto ids = ids_of(frames_of(first));
        while (!out.empty())
            for (const auto& frame : write(out)) ids.push_back(frame.id);
        CHECK(ids == std::vector<std::uint64_t>{7, 1, 2, 3, 4, 5, 6});
    }
    SECTION("without one that was given up") {
        CHECK(out.withdraw(5));
        std::vector<std::uint64_t> ids;
        while (!out.empty())
            for (const auto& frame : write(out)) ids.push_back(frame.id);
        CHECK(ids == std::vector<std::uint64_t>{7, 1, 2, 3, 4, 6});
    }
    SECTION("handed back") {
        std::vector<std::uint64_t> ids;
        out.take_unwritten([&](const ise::net::carried_frame& one) { ids.push_back(one.header.id); });
        CHECK(ids == std::vector<std::uint64_t>{4, 5, 6});
        CHECK(write(out).size() == 1); // the ping
    }
    CHECK(out.pending_bytes() == 0);
    CHECK(out.empty());
}

TEST_CASE("a big message goes in pieces between which small ones pass") {
    outbox out;
    ise::wire::reassembly whole(100 << 20);
    request(out, 1, 1'000'000);
    std::optional<ise::wire::assembled> got;
    std::uint64_t small = 100;
    std::size_t small_seen = 0;
    while (!out.empty()) {
        request(out, small++);
        for (const auto& frame : write(out)) {
            if (frame.type == frame_type::request) {
                ++small_seen;
                continue;
            }
            ise::wire::frame piece;
            piece.header.type = frame.type;
            piece.header.flags = frame.flags;
            piece.header.id = frame.id;
            piece.body = frame.body;
            CHECK(frame.body.size() < 2 * outbox::piece_bytes + 100);
            auto taken = whole.take(piece);
            REQUIRE(taken);
            if (*taken) got = std::move(**taken);
        }
        if (got && small_seen == small - 100) break;
    }
    REQUIRE(got);
    CHECK((got->header.id == 1 && got->header.type == frame_type::request && got->body.size() == 1'000'012));
    CHECK(small_seen == small - 100);
    CHECK(out.pending_bytes() == 0);
}

TEST_CASE("a write takes as many pieces of a big message as it has room for, and of each one in turn") {
    outbox out;
    request(out, 1, 1'000'000);
    auto alone = write(out);
    REQUIRE(alone.size() == outbox::batch_bytes / outbox::piece_bytes);
    request(out, 2, 1'000'000);
    auto both = write(out);
    REQUIRE(both.size() == 4);
    CHECK((both[0].id != both[1].id && both[0].id == both[2].id && both[1].id == both[3].id));
    CHECK(alone[0].id == both[0].id);
}

TEST_CASE("no more messages are begun at once than a receiver takes") {
    std::vector<std::uint64_t> whole;
    auto take = [&whole](const std::vector<written>& frames, ise::wire::reassembly& at) {
        for (const auto& frame : frames) {
            if (frame.type != frame_type::piece) continue;
            ise::wire::frame piece;
            piece.header.type = frame.type;
            piece.header.flags = frame.flags;
            piece.header.id = frame.id;
            piece.body = frame.body;
            auto got = at.take(piece);
            INFO((got ? std::string() : got.error().message()));
            REQUIRE(got);
            if (*got) whole.push_back((*got)->header.id);
        }
        return !frames.empty();
    };
    outbox box;
    SECTION("by number") {
        for (std::uint64_t id = 1; id <= 200; ++id) request(box, id, 300'000);
        ise::wire::reassembly receiver(256 << 20);
        while (take(write(box), receiver)) {}
        CHECK(whole.size() == 200);
    }
    SECTION("by bytes, also where some are given up half way") {
        box.limit_messages(1 << 20);
        for (std::uint64_t id = 1; id <= 20; ++id) request(box, id, 500'000);
        ise::wire::reassembly receiver(1 << 20);
        REQUIRE(take(write(box), receiver));
        CHECK(box.withdraw(1));
        CHECK(box.withdraw(7));
        while (take(write(box), receiver)) {}
        CHECK(whole.size() == 18);
    }
}

TEST_CASE("a request that is given up: unwritten it is not sent, half sent it is abandoned") {
    outbox out;
    out.limit_batch(1); // a piece a write
    request(out, 1);
    request(out, 2, 1'000'000);
    request(out, 3, 1'000'000);
    CHECK(out.withdraw(1));
    CHECK(out.withdraw(3));
    auto first = write(out);
    REQUIRE(first.size() == 1);
    auto pieces = first[0].id;
    CHECK(first[0].type == frame_type::piece);
    CHECK(out.withdraw(2));
    auto rest = write(out);
    REQUIRE(rest.size() == 1);
    CHECK((rest[0].type == frame_type::piece && rest[0].flags == ise::wire::flag::abandoned && rest[0].id == pieces &&
           rest[0].body.empty()));
    CHECK(out.empty());
    CHECK(out.pending_bytes() == 0);
    CHECK_FALSE(out.withdraw(2));
    CHECK_FALSE(out.withdraw(99));
}

TEST_CASE("unwritten requests are handed back, begun ones are not") {
    outbox out;
    request(out, 1, 1'000'000);
    write(out);
    request(out, 2, 1'000'000);
    request(out, 3);
    std::vector<std::uint64_t> back;
    out.take_unwritten([&](const ise::net::carried_frame& one) { back.push_back(one.header.id); });
    CHECK(back == std::vector<std::uint64_t>{3, 2});
    CHECK(out.empty());
    CHECK(out.pending_bytes() == 0);
}

TEST_CASE("a batch tells which frames were never begun") {
    outbox out;
    for (std::uint64_t id = 1; id <= 4; ++id) request(out, id, 20); // 48 bytes each
    ping(out, 9);                                                   // 16 bytes, in front
    batch one;
    REQUIRE(out.fill(one));
    auto unwritten = [&] {
        std::vector<std::uint64_t> ids;
        one.visit_unwritten([&](const ise::net::carried_frame& frame) {
            CHECK(frame.body.size() == frame.header.length);
            ids.push_back(frame.header.id);
        });
        return ids;
    };
    CHECK(unwritten() == std::vector<std::uint64_t>{9, 1, 2, 3, 4});
    one.advance(1);
    CHECK(unwritten() == std::vector<std::uint64_t>{1, 2, 3, 4});
    one.advance(16 + 48);
    CHECK(unwritten() == std::vector<std::uint64_t>{3, 4});
    one.advance(one.left());
    CHECK(unwritten().empty());
}

TEST_CASE("publications share the connection by bytes, and are asked only when there is room") {
    outbox out;
    source loud(1), soft(2);
    for (int i = 0; i < 1000; ++i) loud.put(10'000);
    for (int i = 0; i < 10; ++i) soft.put(10'000);
    out.add(loud);
    out.add(soft);
    CHECK(loud.asked == 0);
    auto first = write(out);
    auto of_soft = std::count_if(first.begin(), first.end(), [](const auto& frame) { return frame.id == 2; });
    CHECK(of_soft == 10);
    CHECK(first.size() < 50);
    CHECK(loud.waiting.size() > 900); // what is newest is decided later
}

TEST_CASE("a subscription's packets stay behind its message in pieces, others do not wait") {
    outbox out;
    out.limit_batch(1); // a piece a write
    source pictures(1), fixes(2);
    pictures.put(500'000);
    pictures.put(10);
    fixes.put(10);
    out.add(pictures);
    out.add(fixes);
    std::vector<std::string> order;
    for (int i = 0; !out.empty(); ++i) {
        if (i == 2) { // more comes while the pieces are under way
            pictures.put(11);
            out.add(pictures);
        }
        for (const auto& frame : write(out))
            order.push_back(frame.type == frame_type::piece ? (frame.flags & ise::wire::flag::last ? "last" : "piece")
                                                            : std::to_string(frame.id));
    }
    CHECK(order.front() == "2");
    auto last = std::find(order.begin(), order.end(), "last");
    REQUIRE(last != order.end());
    CHECK(std::vector<std::string>(last + 1, order.end()) == std::vector<std::string>{"1", "1"});
    CHECK(std::find(order.begin(), last, "1") == last);
}

TEST_CASE("what waits is counted by class: packets that go in pieces are no replies") {
    constexpr std::size_t size = 400'000;
    outbox out;
    source packets(1);
    packets.put(size);
    packets.put(size);
    out.add(packets);
    request(out, 2, size);
    const auto of_request = out.pending_call_bytes();
    CHECK(of_request > size);

    write(out); // a piece of the request, and the first of the packets is taken
    CHECK(out.pending_call_bytes() < of_request);
    CHECK(out.pending_bytes() > out.pending_call_bytes() + size / 2);

    REQUIRE(out.withdraw(2));
    CHECK(out.pending_call_bytes() == 0);
    CHECK(out.pending_bytes() > size / 2);

    out.remove(packets);
    while (!write(out).empty()) {}
    CHECK(out.pending_bytes() == 0);
    CHECK(out.empty());
}

TEST_CASE("a source that goes takes its packets along, and half sent ones are abandoned") {
    outbox out;
    out.limit_batch(1); // a piece a write
    {
        source pictures(1);
        pictures.put(500'000);
        out.add(pictures);
        write(out);
        write(out);
        out.remove(pictures);
    }
    auto rest = write(out);
    REQUIRE(rest.size() == 1);
    CHECK(rest[0].flags == ise::wire::flag::abandoned);
    CHECK(out.empty());
    CHECK(out.pending_bytes() == 0);
}

TEST_CASE("frames that are whole already leave as they are, with the number of who gets them") {
    struct frames final : ise::net::publication_source {
        std::size_t size = 0;
        bool addressed = false;
        ise::shared_bytes made;
        bool take(outbox& out, std::size_t) override {
            ise::buffer content;
            for (std::uint8_t fill = 1; fill <= 3; ++fill)
                ise::wire::put_frame(content, frame_type::packet, 0, 30, [&](ise::buffer& body) {
                    std::fill_n(body.grow(size), size, static_cast<std::byte>(fill));
                });
            made = ise::shared_bytes(std::move(content));
            out.put_frames(made, addressed ? 30 : 31, addressed);
            return false;
        }
    } news;
    news.size = GENERATE(std::size_t{1}, std::size_t{20'000}); // copied; referred to
    news.addressed = GENERATE(true, false);
    outbox out;
    out.add(news);
    ping(out, 10);
    auto sent = write(out);
    std::uint64_t id = news.addressed ? 30 : 31;
    REQUIRE(ids_of(sent) == std::vector<std::uint64_t>{10, id, id, id});
    for (std::size_t i = 1; i <= 3; ++i) CHECK(sent[i].body == ise::bytes(news.size, static_cast<std::byte>(i)));
    CHECK(ise::wire::read_header(news.made.view().data()).id == 30); // others hold them too
}

} // namespace outbox_test
