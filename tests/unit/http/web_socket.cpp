// WebSocket frames, whatever a peer sends, and WebSockets over the HTTP server on the virtual world.
#include <ise/http/http_server.hpp>
#include <ise/http/web_socket_frames.hpp>

#include <ise/component/node.hpp>
#include <ise/sim/world.hpp>

#include <support/catch.hpp>
#include <unit/http/web_socket_client.hpp>

#include <functional>
#include <string>
#include <vector>

namespace web_socket_test {
namespace {

using namespace ise;
using namespace std::chrono_literals;
using opcode = web_socket_opcode;

struct outcome {
    std::vector<ise::web_socket_message> all;
    std::optional<ise::web_socket_code> refused;
};

// Feeds in pieces of a size.
outcome read(std::string_view bytes, std::size_t piece, ise::web_socket_limits limits = {},
             ise::web_socket_reader::from whose = ise::web_socket_reader::from::clients) {
    ise::web_socket_reader reader(whose, limits);
    outcome made;
    while (!bytes.empty()) {
        auto part = bytes.substr(0, piece);
        auto used = reader.feed(ise::as_bytes(part));
        if (!used) {
            made.refused = reader.refusal();
            REQUIRE_FALSE(reader.feed(ise::as_bytes(bytes))); // it is of no more use
            break;
        }
        bytes.remove_prefix(*used);
        if (reader.complete()) made.all.push_back(reader.take());
        else REQUIRE(*used == part.size());
    }
    return made;
}

std::string masked(opcode kind, std::string_view payload, bool last = true) {
    std::string made;
    ise::append_masked_frame(made, kind, payload, 0x1badf00d, last);
    return made;
}

std::string close_payload(std::uint16_t code, std::string_view reason = "") {
    return std::string{static_cast<char>(code >> 8), static_cast<char>(code & 0xff)} + std::string(reason);
}

} // namespace

TEST_CASE("the handshake's answer is that of RFC 6455") {
    CHECK(ise::web_socket_accept("dGhlIHNhbXBsZSBub25jZQ==") == "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=");
    CHECK(ise::is_web_socket_key("dGhlIHNhbXBsZSBub25jZQ=="));
    CHECK_FALSE(ise::is_web_socket_key("dGhlIHNhbXBsZSBub25jZQ"));
    CHECK_FALSE(ise::is_web_socket_key("dGhlIHNhbXBsZSBub25jZ\r\n="));
    CHECK(ise::lists_token("keep-alive, UPGRADE", "upgrade"));
    CHECK_FALSE(ise::lists_token("upgraded", "upgrade"));
    CHECK_FALSE(ise::lists_token("", "upgrade"));
}

TEST_CASE("frames of all lengths are read, in whatever pieces they come") {
    std::string sent;
    std::vector<std::string> payloads;
    for (std::size_t size : {0u, 1u, 125u, 126u, 127u, 65535u, 65536u, 70000u}) {
        payloads.push_back(std::string(size, 'a'));
        sent += masked(opcode::binary, payloads.back());
    }
    for (std::size_t piece : {std::size_t{1}, std::size_t{7}, std::size_t{4096}, sent.size()}) {
        auto got = read(sent, piece);
        REQUIRE_FALSE(got.refused);
        REQUIRE(got.all.size() == payloads.size());
        for (std::size_t i = 0; i < payloads.size(); ++i) CHECK(got.all[i].payload == payloads[i]);
    }
    // What a server sends is read by a client's reader.
    std::string answer;
    ise::append_frame(answer, opcode::text, "hello");
    auto got = read(answer, 1, {}, ise::web_socket_reader::from::servers);
    REQUIRE(got.all.size() == 1);
    CHECK(got.all[0].payload == "hello");
}

TEST_CASE("fragments make one message, with control frames between them") {
    auto sent = masked(opcode::text, "one ", false) + masked(opcode::ping, "?") +
                masked(opcode::continuation, "two ", false) + masked(opcode::continuation, "three");
    auto got = read(sent, 3);
    REQUIRE_FALSE(got.refused);
    REQUIRE(got.all.size() == 2);
    CHECK(got.all[0].kind == opcode::ping);
    CHECK(got.all[1].kind == opcode::text);
    CHECK(got.all[1].payload == "one two three");
}

TEST_CASE("what violates the protocol is refused with its code") {
    auto code_of = [](const std::string& sent, ise::web_socket_limits limits = {}) {
        return read(sent, 5, limits).refused;
    };
    std::string unmasked;
    ise::append_frame(unmasked, opcode::text, "hello");
    CHECK(code_of(unmasked) == ise::web_socket_code::protocol_error);
    auto reserved = masked(opcode::text, "x");
    reserved[0] = static_cast<char>(reserved[0] | 0x40);
    CHECK(code_of(reserved) == ise::web_socket_code::protocol_error);
    for (int unknown : {3, 7, 11, 15})
        CHECK(code_of(masked(static_cast<opcode>(unknown), "")) == ise::web_socket_code::protocol_error);
    CHECK(code_of(masked(opcode::ping, "x", false)) == ise::web_socket_code::protocol_error);
    CHECK(code_of(masked(opcode::ping, std::string(126, 'x'))) == ise::web_socket_code::protocol_error);
    CHECK(code_of(masked(opcode::continuation, "x")) == ise::web_socket_code::protocol_error);
    CHECK(code_of(masked(opcode::text, "x", false) + masked(opcode::text, "y")) ==
          ise::web_socket_code::protocol_error);
    CHECK(code_of(masked(opcode::text, "\xc3\x28")) == ise::web_socket_code::not_utf8);
    CHECK(code_of(masked(opcode::text, "\xed\xa0\x80")) == ise::web_socket_code::not_utf8); // a surrogate
    CHECK_FALSE(code_of(masked(opcode::text, "\xc3", false) + masked(opcode::continuation, "\xa4")));
    // Lengths that are not in their shortest form, or beyond everything.
    CHECK(code_of(std::string("\x82\xfe\x00\x7d\0\0\0\0", 8)) == ise::web_socket_code::protocol_error);
    CHECK(code_of(std::string("\x82\xff\0\0\0\0\0\0\xff\xff\0\0\0\0", 14)) == ise::web_socket_code::protocol_error);
    CHECK(code_of(std::string("\x82\xff\xff\xff\xff\xff\xff\xff\xff\xff\0\0\0\0", 14)) ==
          ise::web_socket_code::too_large);
    ise::web_socket_limits small;
    small.max_message_bytes = 10;
    small.max_fragments = 3;
    CHECK_FALSE(code_of(masked(opcode::binary, std::string(10, 'x')), small));
    CHECK(code_of(masked(opcode::binary, std::string(11, 'x')), small) == ise::web_socket_code::too_large);
    CHECK(code_of(masked(opcode::binary, "123456", false) + masked(opcode::continuation, "78901"), small) ==
          ise::web_socket_code::too_large);
    std::string fragments = masked(opcode::binary, "", false);
    for (int i = 0; i < 3; ++i) fragments += masked(opcode::continuation, "", false);
    CHECK(code_of(fragments, small) == ise::web_socket_code::too_large);
    // Close frames.
    CHECK(code_of(masked(opcode::close, "x")) == ise::web_socket_code::protocol_error);
    for (int code : {0, 999, 1004, 1005, 1006, 1015, 2999, 5000})
        CHECK(code_of(masked(opcode::close, close_payload(static_cast<std::uint16_t>(code)))) ==
              ise::web_socket_code::protocol_error);
    CHECK(code_of(masked(opcode::close, close_payload(1000, "\xff"))) == ise::web_socket_code::not_utf8);
    auto left = read(masked(opcode::close, close_payload(3001, "bye")), 1);
    REQUIRE(left.all.size() == 1);
    CHECK(left.all[0].code == static_cast<ise::web_socket_code>(3001));
    CHECK(left.all[0].payload == "bye");
}

TEST_CASE("frames with any byte changed or cut are read or refused") {
    const auto sent = masked(opcode::text, "one ", false) + masked(opcode::ping, "?") +
                      masked(opcode::continuation, std::string(200, 'x')) +
                      masked(opcode::close, close_payload(1000, "bye"));
    for (std::size_t cut = 0; cut <= sent.size(); ++cut) {
        auto got = read(std::string_view(sent).substr(0, cut), 16);
        CHECK_FALSE(got.refused);
    }
    for (std::size_t at = 0; at < sent.size(); ++at)
        for (int bit = 0; bit < 8; ++bit) {
            auto flipped = sent;
            flipped[at] = static_cast<char>(flipped[at] ^ (1 << bit));
            auto got = read(flipped, 16);
            for (const auto& one : got.all) CHECK(one.payload.size() <= sent.size());
        }
}

TEST_CASE("a close frame's reason is cut between characters") {
    std::string reason;
    for (int i = 0; i < 50; ++i) reason += "\xe2\x82\xac"; // 150 bytes
    std::string made;
    ise::append_close(made, ise::web_socket_code::policy, reason);
    auto got = read(made, 64, {}, ise::web_socket_reader::from::servers);
    REQUIRE(got.all.size() == 1);
    CHECK(got.all[0].code == ise::web_socket_code::policy);
    CHECK(got.all[0].payload.size() == 123);
}

namespace {

/// A server that answers each message with it, and sends numbers where it is asked to.
class echo final : public ise::component {
public:
    explicit echo(ise::http_limits limits) : limits_(limits) {}
    std::unique_ptr<ise::http_server> server;
    std::shared_ptr<ise::web_socket> last;
    int sources = 0, conversations = 0;
    bool due = false; ///< something to send

private:
    ise::task<> run() override {
        server = std::make_unique<ise::http_server>(on(), log(), limits_, [this](std::string name, ise::task<> body) {
            spawn(std::move(name), std::move(body));
        });
        server->get("/", [this](const ise::http_request& asked) {
            return ise::accept_web_socket(asked, {"echo.v2", "echo.v1"}, [this](std::shared_ptr<ise::web_socket> over) {
                return talk(std::move(over));
            });
        });
        server->listen(ise::endpoint{ise::protocol::tcp, "0.0.0.0", 8080, {}}).value();
        co_return;
    }
    ise::task<> talk(std::shared_ptr<ise::web_socket> over) {
        ++conversations;
        last = over;
        auto waiting = std::make_shared<std::string>();
        over->on_room([this, waiting](std::string& to) {
            if (!waiting->empty()) ise::append_frame(to, opcode::text, std::exchange(*waiting, {}));
            if (std::exchange(due, false))
                ise::append_frame(to, opcode::binary, std::string(100, static_cast<char>(++sources)));
        });
        for (;;) {
            auto got = co_await over->next();
            if (!got) break;
            if (got->payload == "close") over->close(ise::web_socket_code::going_away, "as you wish");
            *waiting += got->payload;
            over->wake();
        }
        --conversations;
    }
    ise::http_limits limits_;
};

struct quay {
    explicit quay(ise::http_limits limits = {}) {
        world.host("shore").start_process("echo", [this, limits](ise::sim::process& here) -> std::shared_ptr<void> {
            ise::node_options options;
            options.log = [](const ise::log_record&) {};
            options.use_names = false;
            auto node = std::make_shared<ise::node>(here, options);
            ise::component_options silent;
            silent.listens = false;
            server = &node->start<echo>("", silent, limits);
            return node;
        });
        world.run_for(10ms);
    }
    client& connect(std::string protocols = "echo.v1") {
        clients.push_back(std::make_unique<client>(world, "viewer" + std::to_string(clients.size()), "shore", 8080,
                                                   std::move(protocols)));
        return *clients.back();
    }
    bool until(const std::function<bool()>& done, ise::duration within = 1min) { return world.run_until(done, within); }

    ise::sim::world world{3};
    echo* server = nullptr;
    std::vector<std::unique_ptr<client>> clients;
};

} // namespace

TEST_CASE("a WebSocket is opened with the protocol that both know, and echoes") {
    quay here;
    auto& one = here.connect("other, echo.v1");
    REQUIRE(here.until([&] { return one.open; }));
    CHECK(one.head.find("Sec-WebSocket-Protocol: echo.v1\r\n") != std::string::npos);
    one.send(opcode::text, "hello");
    REQUIRE(here.until([&] { return one.texts.size() == 1; }));
    CHECK(one.texts[0] == "hello");
    one.send(opcode::ping, "are you there");
    REQUIRE(here.until([&] { return one.pongs.size() == 1; }));
    CHECK(one.pongs[0] == "are you there");
    one.send(opcode::close, close_payload(1001));
    REQUIRE(here.until([&] { return one.closed; }));
    CHECK(one.code == ise::web_socket_code::going_away);
    REQUIRE(here.until([&] { return here.server->server->statistics().open_connections == 0; }));
    CHECK(here.server->conversations == 0);
}

TEST_CASE("a wrong handshake is answered by HTTP") {
    quay here;
    auto& other = here.connect("chat");
    REQUIRE(here.until([&] { return other.closed; }));
    CHECK(other.head.starts_with("HTTP/1.1 400 "));
    CHECK(other.rest.find("echo.v2, echo.v1") != std::string::npos);
    auto refused = [&](std::string_view head) {
        auto& one = here.connect("");
        one.raw_head = std::string(head);
        REQUIRE(here.until([&] { return one.closed; }));
        return one.head.substr(9, 3);
    };
    CHECK(refused("GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n") == "426");
    CHECK(refused("GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade, close\r\n"
                  "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 8\r\n\r\n") == "426");
    CHECK(refused("GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade, close\r\n"
                  "Sec-WebSocket-Key: short\r\nSec-WebSocket-Version: 13\r\n\r\n") == "400");
    CHECK(here.server->server->statistics().web_sockets == 0);
}

TEST_CASE("a client that violates the protocol gets the code, and is let go") {
    quay here;
    auto& one = here.connect();
    REQUIRE(here.until([&] { return one.open; }));
    std::string unmasked;
    ise::append_frame(unmasked, opcode::text, "hello");
    one.send_raw(unmasked);
    REQUIRE(here.until([&] { return one.closed; }));
    CHECK(one.code == ise::web_socket_code::protocol_error);
    CHECK(one.reason == "a frame of a client is not masked");
    REQUIRE(here.until([&] { return here.server->conversations == 0; }));

    auto& two = here.connect();
    REQUIRE(here.until([&] { return two.open; }));
    two.send(opcode::text, "close");
    REQUIRE(here.until([&] { return two.closed; }));
    CHECK(two.code == ise::web_socket_code::going_away);
    CHECK(two.reason == "as you wish");
}

TEST_CASE("a client that answers no close frame is let go in time") {
    quay here;
    auto& one = here.connect();
    REQUIRE(here.until([&] { return one.open; }));
    one.answers = false;
    one.send(opcode::text, "close");
    REQUIRE(here.until([&] { return here.server->conversations == 0; }, 10s));
    REQUIRE(here.until([&] { return here.server->server->statistics().open_connections == 0; }, 10s));
}

TEST_CASE("a client that answers no ping gets a second's data, and is disconnected in the end") {
    quay here;
    auto& one = here.connect();
    REQUIRE(here.until([&] { return one.open; }));
    one.answers = false;
    auto began = here.world.now();
    std::function<void()> wake = [&] {
        here.server->due = true;
        if (auto& to = here.server->last; to && !to->over()) to->wake();
        here.world.after(100ms, wake);
    };
    here.world.after(100ms, wake);
    here.world.run_for(10s);
    CHECK(here.server->last->counts().held);
    CHECK(here.server->sources >= 10); // the first second until the ping, and one until it is missed
    CHECK(here.server->sources <= 25);
    REQUIRE(here.until([&] { return here.server->conversations == 0; }, 1min));
    CHECK(here.world.now() - began < 40s);
    CHECK(here.server->last->cause().find("ping") != std::string::npos);
}

} // namespace web_socket_test
