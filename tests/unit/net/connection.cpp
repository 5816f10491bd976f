// Connections against a peer that the test scripts byte by byte, on a virtual clock.
#include <ise/core/inproc_stream.hpp>
#include <ise/core/sleep.hpp>
#include <ise/net/handshake.hpp>
#include <ise/packet/codec.hpp>
#include <ise/sim/world.hpp>
#include <ise/wire/body.hpp>
#include <ise/wire/pieces.hpp>

#include <asio/buffer.hpp>

#include <support/catch.hpp>
#include <support/party.hpp>

namespace connection_test {

using namespace std::chrono_literals;
using namespace ise_test;
using ise::errc;
using ise::wire::frame_type;
using ise_test::Contains;

namespace {

struct listener final : ise::net::connection::user {
    std::vector<frame_type> frames;
    ise::bytes last_body;
    std::optional<ise::failure> end;
    int ends = 0;
    std::optional<ise::failure> answer;
    ise::result<void> on_frame(const ise::net::carried_frame& received) override {
        frames.push_back(received.header.type);
        last_body.assign(received.body.begin(), received.body.end());
        if (answer) return *answer;
        return {};
    }
    void on_closed(const ise::failure& cause) override {
        end = cause;
        ++ends;
    }
};

void fails(const std::string& name, std::exception_ptr thrown) { FAIL(name << ": " << ise::describe(thrown)); }

// One side is a real connection, the other the raw end of its stream.
struct scripted {
    ise::sim::world world;
    ise::sim::process& env = world.host("shore").start_process("shore");
    std::unique_ptr<ise::loop_host> host = env.make_loop("main");
    ise::loop& on = host->loop();
    std::unique_ptr<ise::loop_host> peer_host =
        env.make_loop("peer"); // as a peer elsewhere, whose ears do not stall with us
    ise::task_scope scope{on, fails};
    ise::task_scope ears{peer_host->loop(), fails};
    std::unique_ptr<ise::stream> mine, theirs;
    std::shared_ptr<ise::net::connection> connection;
    std::shared_ptr<listener> user = std::make_shared<listener>();
    ise::bytes heard; ///< by the scripted peer

    explicit scripted(std::size_t capacity = 256 * 1024) {
        std::tie(mine, theirs) = ise::make_inproc_pair(on, peer_host->loop(), "pair", capacity);
    }
    ~scripted() {
        if (connection) connection->close(ise::failure(errc::cancelled, "the test is over"));
        if (theirs) theirs->close();
        scope.stop();
        ears.stop();
        CHECK(world.run_until([&] { return scope.size() == 0 && ears.size() == 0; }));
    }
    void begin(ise::wire::limits ours = {}, ise::wire::limits peers = {}) {
        ise::net::session_terms terms;
        terms.peer.path = "boat";
        terms.we_accept = ours;
        terms.peer_accepts = peers;
        connection = std::make_shared<ise::net::connection>(on, std::move(mine), terms, ise::wire::parser(1 << 20));
        connection->start(scope, user);
    }
    void listen() { ears.spawn("the peer's ears", hear(*theirs, heard)); }
    static ise::task<> hear(ise::stream& from, ise::bytes& into) {
        for (;;) {
            std::array<std::byte, 4096> room;
            auto got = co_await from.read_some(asio::buffer(room));
            if (got.problem) co_return;
            into.insert(into.end(), room.begin(), room.begin() + static_cast<std::ptrdiff_t>(got.bytes));
        }
    }
    void say(ise::bytes_view raw) {
        asio::const_buffer all(raw.data(), raw.size());
        REQUIRE(theirs->try_write(std::span(&all, 1)).bytes == raw.size());
    }
    void say(frame_type type, std::uint64_t id = 0, ise::bytes body = {}) {
        ise::buffer out;
        ise::wire::put_frame(out, type, 0, id, [&](ise::buffer& to) { to.append(ise::bytes_view(body)); });
        say(out.view());
    }
    std::vector<frame_type> heard_frames() const {
        std::vector<frame_type> found;
        for (std::size_t at = 0; at + 16 <= heard.size();) {
            auto header = ise::wire::read_header(heard.data() + at);
            found.push_back(header.type);
            at += 16 + header.length;
        }
        return found;
    }
};

} // namespace

TEST_CASE("a ping is answered, and frames reach the user, in pieces of any size") {
    scripted at;
    at.listen();
    at.begin();
    ise::buffer raw;
    ise::wire::put_frame(raw, frame_type::ping, 0, 42, [](ise::buffer&) {});
    ise::wire::put_frame(raw, frame_type::credit, 0, 1, [](ise::buffer& body) { body.append(std::uint64_t{1}); });
    ise::wire::put_frame(raw, static_cast<frame_type>(99), 0, 1, [](ise::buffer&) {});
    for (std::size_t i = 0; i < raw.size(); ++i) {
        at.say(raw.view().subspan(i, 1));
        at.world.run_for(1ms);
    }
    CHECK(at.user->frames == std::vector<frame_type>{frame_type::credit, static_cast<frame_type>(99)});
    auto heard = at.heard_frames();
    CHECK(std::count(heard.begin(), heard.end(), frame_type::pong) == 1);
}

TEST_CASE("a message in pieces is the same wherever its bytes are cut, and so is what follows") {
    ise::buffer raw;
    const auto content = [](std::size_t from, std::size_t count) {
        ise::bytes made;
        for (std::size_t i = from; i < from + count; ++i) made.push_back(static_cast<std::byte>(i * 7 >> 3));
        return made;
    };
    const auto put_piece = [&](std::uint8_t flags, std::size_t from, std::size_t count) {
        ise::wire::put_frame(raw, frame_type::piece, flags, 5, [&](ise::buffer& body) {
            ise::wire::piece_head head{frame_type::reply, 0, 77, 900};
            if (from == 0) head.put(body);
            body.append(ise::bytes_view(content(from, count)));
        });
    };
    put_piece(0, 0, 400);
    ise::wire::put_frame(raw, frame_type::credit, 0, 1, [](ise::buffer& body) { body.append(std::uint64_t{1}); });
    put_piece(0, 400, 300);
    const auto last_at = raw.size();
    put_piece(ise::wire::flag::last, 700, 200);
    const auto cut = GENERATE(range(std::size_t{1}, std::size_t{1000}, std::size_t{1}));
    if (cut >= raw.size()) return;
    INFO(cut);
    scripted at;
    at.begin();
    at.say(raw.view().first(cut));
    at.world.run_for(1ms);
    CHECK(at.user->frames.size() == (cut < 434 + 24 ? 0u : 1u));
    if (cut < last_at) { // the rest in two parts
        at.say(raw.view().subspan(cut, last_at - cut));
        at.world.run_for(1ms);
    }
    at.say(raw.view().subspan(std::max(cut, last_at)));
    at.world.run_for(1ms);
    CHECK(at.user->frames == std::vector<frame_type>{frame_type::credit, frame_type::reply});
    CHECK(at.user->last_body == content(0, 900));
    at.say(frame_type::cancel, 3);
    at.world.run_for(1ms);
    CHECK(at.user->frames.back() == frame_type::cancel);
}

TEST_CASE("heartbeats find a peer that has fallen silent, and keep one that only listens") {
    scripted at;
    at.listen();
    at.begin();
    SECTION("silent") {
        at.world.run_for(2900ms);
        CHECK_FALSE(at.user->end);
        at.world.run_for(200ms);
        REQUIRE(at.user->end);
        CHECK(at.user->end->code() == errc::peer_lost);
        CHECK_THAT(at.user->end->message(), Contains("boat") && Contains("not heard"));
    }
    SECTION("it pings now and then") {
        for (int i = 0; i < 20; ++i) {
            at.say(frame_type::ping, 1);
            at.world.run_for(2500ms);
        }
        CHECK_FALSE(at.user->end);
        auto heard = at.heard_frames();
        CHECK(std::count(heard.begin(), heard.end(), frame_type::ping) >= 20);
    }
    SECTION("it is this side that slept, and what the peer sent lies unread") {
        at.world.run_for(1s);
        at.env.pause();
        at.say(frame_type::ping, 1);
        at.world.run_for(60s);
        at.env.go_on();
        at.world.run_for(500ms);
        CHECK_FALSE(at.user->end);
        at.world.run_for(10s);
        CHECK(at.user->end); // it stayed silent afterwards
    }
}

TEST_CASE("a connection ends once, with its cause, whatever broke") {
    scripted at;
    at.begin();
    SECTION("the peer closed") {
        at.theirs->close();
        at.world.run_for(1s);
        CHECK_THAT(at.user->end->message(), Contains("closed the connection"));
        CHECK(at.user->end->code() == errc::peer_lost);
    }
    SECTION("garbage: the peer is told") {
        at.listen();
        at.say(ise::bytes(64, std::byte{0xff}));
        at.world.run_for(1s);
        CHECK(at.user->end->code() == errc::too_large);
        CHECK(at.heard_frames().back() == frame_type::goodbye);
    }
    SECTION("the user refuses a frame: the peer is told why") {
        at.listen();
        at.user->answer.emplace(errc::protocol_error, "that was wrong");
        at.say(frame_type::credit);
        at.say(frame_type::credit);
        at.world.run_for(1s);
        CHECK(at.user->end->code() == errc::protocol_error);
        CHECK(at.user->frames.size() == 1);
        CHECK_THAT(std::string(ise::as_text(at.heard)), Contains("that was wrong"));
    }
    SECTION("a goodbye") {
        ise::wire::farewell why{7, "too many of you"};
        at.say(frame_type::goodbye, 0, ise::encode(why));
        at.world.run_for(1s);
        CHECK(at.user->end->code() == errc::overloaded);
        CHECK_THAT(at.user->end->message(), Contains("too many of you"));
    }
    SECTION("this side closed it") {
        at.connection->close(ise::failure(errc::cancelled, "enough"));
        at.connection->close(ise::failure(errc::peer_lost, "later"));
        CHECK_FALSE(at.user->end); // never from within the call
        at.world.run_for(1s);
        CHECK(at.user->end->message() == "enough");
    }
    SECTION("a peer that asks and does not read") {
        for (int i = 0; i < 400'000 && at.connection->open(); ++i) {
            ise::buffer out;
            ise::wire::put_frame(out, frame_type::ping, 0, 1, [](ise::buffer&) {});
            asio::const_buffer raw(out.data(), out.size());
            if (at.theirs->try_write(std::span(&raw, 1)).problem) at.world.run_for(1ms);
        }
        at.world.run_for(1ms);
        REQUIRE(at.user->end);
        CHECK(at.user->end->code() == errc::overloaded);
    }
    CHECK(at.user->ends == 1);
    CHECK_FALSE(at.connection->open());
}

TEST_CASE("goodbye is said behind everything that waits, also what goes in pieces") {
    scripted at(4096);
    at.begin();
    ise::wire::put_frame(at.connection->out().calls(), frame_type::reply, 0, 5, [](ise::buffer& body) {
        for (int i = 0; i < 300'000; ++i) body.append(std::uint8_t{1});
    });
    at.connection->out().end_call(0);
    at.connection->written();
    at.connection->finish(ise::failure(errc::cancelled, "the component stops"), 2s);
    at.listen();
    at.world.run_for(1s);
    auto heard = at.heard_frames();
    REQUIRE(!heard.empty());
    CHECK(heard.back() == frame_type::goodbye);
    CHECK(std::count(heard.begin(), heard.end(), frame_type::piece) == 4);
    at.theirs->close();
    at.world.run_for(1s);
    CHECK(at.user->ends == 1);
}

TEST_CASE("a peer that does not take the rest is left when the grace is over") {
    scripted at(4096);
    at.begin();
    ise::wire::put_frame(at.connection->out().calls(), frame_type::reply, 0, 5, [](ise::buffer& body) {
        for (int i = 0; i < 300'000; ++i) body.append(std::uint8_t{1});
    });
    at.connection->out().end_call(0);
    at.connection->finish(ise::failure(errc::cancelled, "the component stops"), 500ms);
    at.world.run_for(600ms);
    REQUIRE(at.user->end);
    CHECK_THAT(at.user->end->message(), Contains("did not accept"));
}

TEST_CASE("while its loop does not turn, another thread shows that it lives, between frames only") {
    scripted at;
    at.listen();
    at.begin();
    at.world.run_for(100ms);
    auto stalled_pongs = [&] {
        std::size_t found = 0;
        for (std::size_t i = 0; i + 16 <= at.heard.size();) {
            auto header = ise::wire::read_header(at.heard.data() + i);
            if (header.type == frame_type::pong && (header.flags & ise::wire::flag::stalled)) ++found;
            i += 16 + header.length;
        }
        return found;
    };
    SECTION("as often as the peer wants to hear something, and not where it heard something") {
        auto signs = at.connection->signs();
        signs->show(at.on.now());
        at.world.run_for(1ms);
        CHECK(stalled_pongs() == 0);
        auto from = at.on.now();
        for (int i = 1; i <= 40; ++i) signs->show(from + i * 500ms); // the world stands still: nothing else is sent
        at.world.run_for(1ms);
        CHECK(stalled_pongs() == 13); // each 1.5 s: the heartbeat, a quarter of it in grace, and the next look
        CHECK(at.heard.size() % 16 == 0);
    }
    SECTION("not into a frame that is half written") {
        scripted narrow(4096);
        narrow.begin();
        ise::wire::put_frame(narrow.connection->out().calls(), frame_type::reply, 0, 5, [](ise::buffer& body) {
            for (int i = 0; i < 100'000; ++i) body.append(std::uint8_t{1});
        });
        narrow.connection->out().end_call(0);
        narrow.connection->written();
        narrow.world.run_for(1ms);
        narrow.connection->signs()->show(narrow.on.now() + 10s);
        narrow.listen();
        narrow.world.run_for(100ms);
        for (auto type : narrow.heard_frames()) CHECK(type != frame_type::pong);
        CHECK(narrow.heard.size() > 100'000);
    }
    SECTION("not once it has ended") {
        auto signs = at.connection->signs();
        at.connection->close(ise::failure(errc::cancelled, "enough"));
        signs->show(at.on.now() + 10s);
        at.world.run_for(1s);
        CHECK(stalled_pongs() == 0);
    }
}

TEST_CASE("a peer whose node answers for it is known to be busy until it is heard itself") {
    scripted at;
    at.begin();
    CHECK_FALSE(at.connection->peer_stalled());
    for (int i = 0; i < 10; ++i) { // for longer than it takes to be lost
        ise::buffer sign;
        ise::wire::put_frame(sign, frame_type::pong, ise::wire::flag::stalled, 0, [](ise::buffer&) {});
        at.say(sign.view());
        at.world.run_for(1s);
        CHECK(at.connection->peer_stalled());
    }
    CHECK(at.connection->open());
    CHECK(at.connection->round_trip() == 0s);
    at.say(frame_type::ping, 1);
    at.world.run_for(1ms);
    CHECK_FALSE(at.connection->peer_stalled());
}

} // namespace connection_test
