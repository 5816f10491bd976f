// A channel over datagrams, decided without I/O: what gets there however rough the way, and what a peer cannot do.
#include <support/catch.hpp>
#include <support/channel_pair.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace udp_channel_test {

using namespace ise_test;
using namespace std::chrono_literals;
using ise::net::udp::channel;

namespace {

// Writes as the window allows.
bool carries(channel_pair& pair, const ise::bytes& content, ise::duration limit) {
    auto& written = pair.written;
    return pair.run_until(
        [&] {
            written += pair.a.channel.out().write(ise::bytes_view(content).subspan(written));
            return pair.b.stream.size() == content.size();
        },
        limit);
}

std::uint8_t last_fill(const channel_pair::side& at) {
    return at.messages.empty() ? std::uint8_t{0} : static_cast<std::uint8_t>(at.messages.back().back());
}

ise::bytes data_datagram(std::uint64_t number, ise::wire::chunk_type type, const ise::bytes& content) {
    ise::buffer out;
    ise::wire::data_writer writer(out, 1, number);
    writer.put(type, content);
    writer.finish();
    return out.to_bytes();
}
template <class... T>
ise::bytes packed(T... values) {
    ise::buffer out;
    (out.append(values), ...);
    return out.to_bytes();
}

} // namespace

TEST_CASE("a stream arrives whole and in order over any way, for every seed") {
    auto content = numbered_bytes(200'000);
    rough_way ways[] = {{0, 0, 0}, {0.02, 0, 0}, {0.2, 0.1, 0.2}, {0.5, 0.3, 0.5}, {0, 1, 1}};
    for (auto& way : ways) {
        for (std::uint64_t seed = 1; seed <= 20; ++seed) {
            INFO(fmt::format("loss {}, twice {}, late {}, seed {}", way.loss, way.twice, way.late, seed));
            channel_pair pair(seed, way);
            REQUIRE(carries(pair, content, 1h));
            REQUIRE(pair.b.stream == content);
            pair.a.channel.out().end();
            REQUIRE(pair.run_until([&] { return pair.b.channel.in().ended() && pair.a.channel.out().finished(); }, 1h));
        }
    }
}

TEST_CASE("both directions at once share their acks") {
    channel_pair pair(3, {0.1, 0.05, 0.1});
    auto content = numbered_bytes(100'000);
    std::size_t there = 0, back = 0;
    REQUIRE(pair.run_until([&] {
        there += pair.a.channel.out().write(ise::bytes_view(content).subspan(there));
        back += pair.b.channel.out().write(ise::bytes_view(content).subspan(back));
        return pair.a.stream.size() == content.size() && pair.b.stream.size() == content.size();
    }));
    CHECK(pair.a.stream == content);
    CHECK(pair.b.stream == content);
}

TEST_CASE("a way that is closed for a while is used again when it opens") {
    channel_pair pair(5);
    auto content = numbered_bytes(300'000);
    pair.way.loss = 1;
    CHECK_FALSE(carries(pair, content, 20s));
    auto quiet = pair.datagrams;
    CHECK(quiet < 100); // it backs off
    pair.way.loss = 0;
    CHECK(carries(pair, content, 10min));
    CHECK(pair.b.stream == content);
}

TEST_CASE("the latest message of each key gets there, older ones once at most, small or in fragments") {
    for (std::size_t size : {20u, 1000u, 5000u, 200'000u}) {
        for (std::uint64_t seed = 1; seed <= 10; ++seed) {
            INFO(fmt::format("{} bytes, seed {}", size, seed));
            channel_pair pair(seed, {0.3, 0.1, 0.1});
            std::uint8_t put = 0;
            REQUIRE(pair.run_until(
                [&] {
                    while (put < 10 && pair.a.channel.out().messages().wanted())
                        put_message(pair.a.channel, 7, size, ++put);
                    return last_fill(pair.b) == 10;
                },
                1h));
            REQUIRE(pair.run_until([&] { return pair.a.channel.out().messages().unconfirmed() == 0; }, 1h));
            CHECK(pair.b.messages.size() <= 10);
            for (auto& message : pair.b.messages) CHECK(message.size() == size + ise::wire::frame_header::size);
        }
    }
}

TEST_CASE("messages of a subscription that has ended do not leave, do not come again and hold up nobody") {
    channel_pair pair;
    auto& messages = pair.a.channel.out().messages();
    SECTION("big ones, one behind the other") {
        for (auto fill : {std::uint8_t{1}, std::uint8_t{2}}) put_message(pair.a.channel, 1, 1 << 20, fill);
        CHECK_FALSE(messages.wanted());
    }
    SECTION("small ones") {
        for (auto fill : {std::uint8_t{1}, std::uint8_t{2}}) put_message(pair.a.channel, 1, 1000, fill);
        CHECK_FALSE(messages.wanted());
    }
    SECTION("one that was lost") {
        pair.way.loss = 1;
        put_message(pair.a.channel, 1, 5000, 1);
        REQUIRE(pair.run_until([&] { return messages.empty(); }));
        pair.way.loss = 0;
    }
    messages.forget(1);
    CHECK(messages.wanted());
    CHECK(messages.empty());
    CHECK(messages.unconfirmed() == 0);
    put_message(pair.a.channel, 2, 100, 9);
    CHECK_FALSE(pair.run_until([&] { return pair.b.messages.size() > 1; }, 1min));
    CHECK(last_fill(pair.b) == 9);
}

TEST_CASE("messages of one subscription leave in order, and each once, where nothing is lost") {
    channel_pair pair;
    for (std::uint8_t fill = 1; fill <= 5; ++fill) put_message(pair.a.channel, 1, 3000, fill);
    put_message(pair.a.channel, 2, 100, 9);
    REQUIRE(pair.run_until([&] { return pair.b.messages.size() == 6; }));
    CHECK(last_fill(pair.b) == 5);
    std::string fills;
    for (const auto& message : pair.b.messages) fills += std::to_string(static_cast<int>(message.back()));
    CHECK(fills.find('9') < 3); // the other one does not wait for all of them
    std::erase(fills, '9');
    CHECK(fills == "12345");
}

TEST_CASE("the largest message passes a way that loses a twentieth") {
    channel_pair pair(2, {0.05, 0, 0.05});
    put_message(pair.a.channel, 1, ise::wire::max_datagram_message_bytes, 9);
    CHECK(pair.run_until([&] { return last_fill(pair.b) == 9; }));
    CHECK(pair.b.channel.messages().bytes_held() == 0);
}

TEST_CASE("small messages are not held up by a big one, nor all messages by the stream") {
    channel_pair pair(4);
    put_message(pair.a.channel, 1, 1 << 20, 1);
    put_message(pair.a.channel, 2, 100, 2);
    CHECK(pair.run_until([&] { return last_fill(pair.b) == 2; }));
    CHECK(pair.b.messages.size() == 1);

    auto content = numbered_bytes(1'000'000);
    std::size_t written = 0;
    int came = 0;
    pair.run_until([&] {
        written += pair.a.channel.out().write(ise::bytes_view(content).subspan(written));
        if (pair.a.channel.out().messages().wanted()) put_message(pair.a.channel, 3, 100, 3);
        came = static_cast<int>(pair.b.messages.size());
        return pair.b.stream.size() > 500'000;
    });
    CHECK(came > 20);
}

TEST_CASE("a slow way gets no more than it carries for long, and no flood") {
    // 20 kB a second in the mind of the sender only: what is under way is bounded by the window.
    channel_pair pair(6);
    auto content = numbered_bytes(400'000);
    std::size_t most = 0;
    std::size_t written = 0;
    pair.run_until([&] {
        written += pair.a.channel.out().write(ise::bytes_view(content).subspan(written));
        most = std::max(most, pair.a.channel.out().network().in_flight());
        return pair.b.stream.size() == content.size();
    });
    CHECK(most <= ise::net::udp::congestion::max_window);
}

TEST_CASE("to a peer that allows everything and never confirms one datagram a bounded part of the stream is sent") {
    using namespace ise::net::udp;
    channel sending(1);
    ise::time_point now{1s};
    sending.out().on_room(~std::uint64_t{0});
    const ise::bytes content(sender::max_unsent);
    std::size_t written = 0;
    auto send = [&](bool first_byte_arrives) {
        ise::buffer out;
        for (int round = 0; round < 2000; ++round, now += 1ms) {
            while (sending.out().writable()) written += sending.out().write(content);
            acknowledgement confirmed;
            for (out.clear(); sending.next(out, now); out.clear()) {
                auto made = ise::wire::read_datagram(out.view());
                REQUIRE(made);
                auto number = ise::detail::load_little<std::uint64_t>(made->body.data());
                bool first = false;
                ise::wire::chunk_reader chunks(made->body.subspan(8));
                while (auto one = chunks.next())
                    first = first || (one->type == ise::wire::chunk_type::content &&
                                      ise::detail::load_little<std::uint64_t>(one->content.data()) == 0);
                if (first_byte_arrives || !first)
                    confirmed.runs.insert(confirmed.runs.begin(), {number, number + 1}); // the highest first
            }
            if (!confirmed.runs.empty()) REQUIRE(sending.out().on_ack(confirmed, now));
            if (sending.due(now) <= now) sending.on_timer(now);
        }
    };
    send(false);
    CHECK(written == receiver::max_window + sender::max_unsent);
    send(true);
    CHECK(written > 1'000'000); // and then it goes on
}

TEST_CASE("a datagram that came counts once") {
    channel_pair pair;
    pair.a.channel.out().write(ise::as_bytes("hello"));
    ise::buffer out;
    REQUIRE(pair.a.channel.next(out, pair.now));
    auto raw = out.to_bytes();
    pair.take(pair.b, raw);
    pair.take(pair.b, raw);
    CHECK(ise::as_text(pair.b.stream) == "hello");
    CHECK(pair.b.channel.ignored() == 1);
}

TEST_CASE("after losses, acks are soon as few and as short as before") {
    ise::net::udp::receiver in;
    const ise::time_point now{100s};
    struct acks {
        int count = 0;
        std::size_t size = 0; // of the last one
    };
    const auto receive = [&](std::uint64_t first, std::uint64_t end) {
        acks sent;
        for (auto number = first; number < end; ++number) {
            in.note(number, true, now);
            if (!in.ack_due(now)) continue;
            ise::buffer out;
            ise::wire::data_writer writer(out, 1, number);
            in.put_ack(writer, true, now);
            writer.finish();
            ++sent.count;
            sent.size = out.size();
        }
        return sent;
    };
    const auto before = receive(0, 1000);
    CHECK(before.count == 500);
    std::uint64_t number = 1000;
    for (int loss = 0; loss < 20; ++loss, number += 21) {
        const auto sent = receive(number + 1, number + 21);
        CHECK(sent.count <= 11); // the gap at once
        CHECK(sent.size > before.size);
    }
    receive(number, number + 300);
    const auto after = receive(number + 300, number + 1300);
    CHECK(after.count == 500);
    CHECK(after.size == before.size);
}

TEST_CASE("what breaks a rule is as if it had not come") {
    using ise::wire::chunk_type;
    channel_pair pair;
    auto refused = [&](chunk_type type, const ise::bytes& content) {
        auto before = pair.a.channel.ignored();
        pair.take(pair.a, data_datagram(0, type, content));
        return pair.a.channel.ignored() == before + 1;
    };
    CHECK(refused(chunk_type::ack, packed(std::uint64_t{5}, std::uint32_t{0}, std::uint32_t{1}))); // nothing was sent
    CHECK(refused(chunk_type::ack, packed(std::uint64_t{5}, std::uint32_t{0}, std::uint32_t{0})));
    CHECK(refused(chunk_type::ack, packed(~std::uint64_t{0}, std::uint32_t{0}, std::uint32_t{1})));
    CHECK(refused(chunk_type::ack,
                  packed(std::uint64_t{5}, std::uint32_t{0}, std::uint32_t{2}, std::uint32_t{9}, std::uint32_t{1})));
    CHECK(refused(chunk_type::content, packed(~std::uint64_t{0}, std::uint8_t{1})));
    CHECK(refused(chunk_type::content, packed(std::uint64_t{1} << 20, std::uint8_t{1}))); // beyond the window
    CHECK(refused(chunk_type::content, packed(std::uint32_t{1})));
    CHECK(refused(chunk_type::fragment,
                  packed(std::uint64_t{0}, std::uint32_t{2 << 20}, std::uint32_t{0}, std::uint8_t{1})));
    CHECK(refused(chunk_type::fragment,
                  packed(std::uint64_t{0}, std::uint32_t{4000}, std::uint32_t{4}, std::uint8_t{1})));
    CHECK(refused(chunk_type::fragment,
                  packed(std::uint64_t{0}, std::uint32_t{4000}, std::uint32_t{0}, std::uint8_t{1})));
    CHECK(refused(chunk_type::fragment, packed(std::uint64_t{0}, std::uint32_t{3}, std::uint32_t{0}, std::uint8_t{1},
                                               std::uint8_t{1}, std::uint8_t{1})));
    CHECK_FALSE(refused(static_cast<chunk_type>(99), packed(std::uint64_t{1}))); // of a later version
}

TEST_CASE("no datagram leaves a channel that is due and has nothing to send") {
    using ise::wire::chunk_type;
    auto rests = [](channel_pair& pair) {
        ise::buffer out;
        for (int burst = 0; burst < 64 && pair.b.channel.next(out, pair.now); ++burst) out.clear();
        return pair.b.channel.due(pair.now) > pair.now;
    };
    channel_pair pair;
    pair.take(pair.b, data_datagram(~std::uint64_t{0}, chunk_type::probe, {})); // a number that no ack can name
    CHECK(pair.b.channel.ignored() == 1);
    CHECK(rests(pair));
    // So much content of datagrams that do not count that the peer should hear of more room.
    ise::bytes content(1000);
    for (std::uint64_t number = 0; number < 30; ++number) {
        ise::buffer out;
        ise::wire::data_writer writer(out, 1, number);
        writer.put(chunk_type::content, packed(number * content.size()), content);
        writer.put(chunk_type::content, packed(std::uint8_t{1}));
        writer.finish();
        pair.take(pair.b, out.to_bytes());
    }
    CHECK(pair.b.channel.ignored() == 31);
    CHECK(rests(pair));
}

TEST_CASE("a big message becomes whole, however many small ones that were superseded are missing meanwhile") {
    using namespace ise::net::udp;
    incoming_messages in;
    ise::time_point now{1s};
    auto fragment = [](std::uint64_t number, std::uint32_t size, std::uint32_t index) {
        auto made = packed(number, size, index);
        made.resize(16 + std::min<std::size_t>(fragment_bytes, size - index * fragment_bytes));
        return made;
    };
    const auto size = static_cast<std::uint32_t>(fragment_bytes + 100);
    std::optional<ise::bytes> done;
    REQUIRE(in.take(fragment(0, size, 0), now, done));
    REQUIRE_FALSE(done);
    for (std::uint64_t number = 2; number < 2000; number += 2) {
        REQUIRE(in.take(fragment(number, 100, 0), now, done));
        REQUIRE(done);
        done.reset();
    }
    REQUIRE(in.take(fragment(0, size, 1), now, done));
    REQUIRE(done);
    CHECK(done->size() == size);
    // And once only, as those that came meanwhile.
    for (std::uint64_t number : {0u, 2u, 1000u, 1998u}) {
        done.reset();
        REQUIRE(in.take(fragment(number, 100, 0), now, done));
        CHECK_FALSE(done);
    }
}

TEST_CASE("fragments of messages that never become whole hold bounded memory, and not for ever") {
    using namespace ise::net::udp;
    incoming_messages in;
    ise::time_point now{1s};
    std::optional<ise::bytes> done;
    ise::bytes part = packed(std::uint64_t{0}, std::uint32_t{1 << 20}, std::uint32_t{0});
    part.resize(16 + fragment_bytes);
    for (std::uint64_t number = 0; number < 200; ++number) {
        for (std::uint32_t index = 0; index < 1000; ++index) {
            ise::detail::store_little(part.data(), number);
            ise::detail::store_little(part.data() + 12, index);
            REQUIRE(in.take(part, now, done));
            REQUIRE_FALSE(done);
        }
        REQUIRE(in.bytes_held() <= incoming_messages::max_bytes);
        REQUIRE(in.unfinished() <= incoming_messages::max_unfinished);
    }
    in.drop_stale(now + incoming_messages::patience);
    CHECK(in.bytes_held() == 0);
    CHECK(in.due() == ise::time_point::max());
}

} // namespace udp_channel_test
