// The port of a listener, with a socket that only remembers what was sent.
#include <ise/sim/world.hpp>
#include <ise/transport/udp/port.hpp>

#include <asio/buffer.hpp>

#include <support/catch.hpp>

#include <cstring>

namespace udp_port_test {

namespace {

using namespace ise::net::udp;

struct remembering_socket final : ise::datagram_socket {
    ise::bytes last;
    void deliver_to(ise::datagram_reader&, std::size_t) override {}
    ise::task<std::pair<std::error_code, const ise::datagram*>> receive() override {
        std::pair<std::error_code, const ise::datagram*> none;
        co_return none;
    }
    std::error_code try_send(const ise::endpoint&, ise::bytes_view content) override {
        last.assign(content.begin(), content.end());
        return {};
    }
    void close() override {}
    ise::endpoint where() const override { return {}; }
};

} // namespace

TEST_CASE("channels that were left and whose peers hear nothing are few, and gone after a while") {
    ise::sim::world world;
    auto host = world.host("boat").start_process("boat").make_loop("main");
    auto& on = host->loop();
    auto socket = std::make_unique<remembering_socket>();
    auto& wire = *socket;
    auto at = std::make_shared<port>(on, std::move(socket), true);
    ise::datagram came;
    came.peer = ise::endpoint::parse("udp://10.0.0.9:4000").value();
    auto say_open = [&](std::uint64_t id, const ise::wire::cookie& shown) {
        ise::buffer out;
        ise::wire::put_opening(out, id, shown);
        came.content = out.to_bytes();
        ise::loop::turn in(on);
        at->on_datagram(came.peer, came.content);
    };
    for (std::uint64_t id = 1; id <= port::max_draining + 50; ++id) {
        say_open(id, {});
        auto answer = ise::wire::read_datagram(wire.last);
        REQUIRE(answer);
        ise::wire::cookie given;
        REQUIRE(answer->body.size() == given.size());
        std::memcpy(given.data(), answer->body.data(), given.size());
        say_open(id, given);
        ise::loop::turn in(on);
        auto opened = at->accepted();
        REQUIRE(opened);
        const auto words = ise::as_bytes("no");
        const asio::const_buffer no(words.data(), words.size());
        CHECK(opened->write({&no, 1}).bytes == words.size());
        opened->leave();
        CHECK(at->associations() == std::min<std::uint64_t>(id, port::max_draining));
    }
    world.run_for(association::max_drain + std::chrono::milliseconds(1));
    CHECK(at->associations() == 0);
    at->close();
}

TEST_CASE("a channel that its peer has closed does not forget the one that was opened in its place") {
    ise::sim::world world;
    auto host = world.host("boat").start_process("boat").make_loop("main");
    auto& on = host->loop();
    auto socket = std::make_unique<remembering_socket>();
    auto& wire = *socket;
    auto at = std::make_shared<port>(on, std::move(socket), true);
    ise::datagram came;
    came.peer = ise::endpoint::parse("udp://10.0.0.9:4000").value();
    auto say = [&](const ise::buffer& out) {
        came.content = out.to_bytes();
        ise::loop::turn in(on);
        at->on_datagram(came.peer, came.content);
        return ise::wire::read_datagram(wire.last).value();
    };
    auto say_open = [&](const ise::wire::cookie& shown) {
        ise::buffer out;
        ise::wire::put_opening(out, 5, shown);
        return say(out);
    };
    ise::wire::cookie given;
    std::memcpy(given.data(), say_open({}).body.data(), given.size());
    say_open(given);
    auto first = at->accepted();
    REQUIRE(first);
    ise::buffer closed;
    ise::wire::put_datagram(closed, ise::wire::datagram_type::closed, first->id());
    say(closed);
    REQUIRE(at->associations() == 0);
    say_open(given);
    auto second = at->accepted();
    REQUIRE(second);
    {
        ise::loop::turn in(on);
        first->leave();
    }
    // The answer was lost, and it is asked for again.
    CHECK(ise::detail::load_little<std::uint64_t>(say_open(given).body.data()) == second->id());
    CHECK(at->associations() == 1);
    at->close();
}

} // namespace udp_port_test
