#include "talk.hpp"

#include <support/catch.hpp>

namespace datagrams_test {

using namespace talk;

namespace {

task<> gather(ise::datagram_socket& from, std::vector<std::string>& into, std::string& peer) {
    for (;;) {
        auto [problem, got] = co_await from.receive();
        if (problem) co_return;
        into.emplace_back(ise::as_text(got->content));
        peer = got->peer.text();
    }
}

struct two_ports {
    ise::sim::world world{5};
    ise::sim::process& shore = world.host("shore").start_process("shore");
    ise::sim::process& boat = world.host("boat").start_process("boat");
    std::unique_ptr<ise::loop_host> shore_loop = shore.make_loop("main"), boat_loop = boat.make_loop("main");
    std::unique_ptr<ise::datagram_socket> to =
        std::move(shore.open_datagram(shore_loop->loop(), at("udp://0.0.0.0:900")).value());
    std::unique_ptr<ise::datagram_socket> from =
        std::move(boat.open_datagram(boat_loop->loop(), at("udp://boat:0")).value());
    std::vector<std::string> got;
    std::string peer;

    two_ports() { spawn(shore_loop->loop(), gather(*to, got, peer)); }
    std::error_code send(std::string text) { return from->try_send(at("udp://shore:900"), ise::as_bytes(text)); }
    ise::sim::link& link() { return world.net().between("boat", "shore"); }
    void send_many(int count) {
        for (int i = 0; i < count; ++i) world.after(i * 10ms, [this, i] { send(std::to_string(i)); });
        world.run_for(1min);
    }
};

} // namespace

TEST_CASE("sim: a datagram arrives whole with its sender") {
    two_ports two;
    CHECK_FALSE(two.send("hello"));
    CHECK_FALSE(two.send(""));
    two.world.run_for(1s);
    CHECK(two.got == std::vector<std::string>{"hello", ""});
    CHECK(two.peer == two.from->where().text());
}

TEST_CASE("sim: datagrams are lost, doubled, reordered as the link says") {
    two_ports two;
    SECTION("lost") {
        two.link().loss = 0.25;
        two.send_many(1000);
        CHECK(two.got.size() > 650);
        CHECK(two.got.size() < 850);
    }
    SECTION("doubled") {
        two.link().duplicate = 0.5;
        two.send_many(1000);
        CHECK(two.got.size() > 1400);
        CHECK(two.got.size() < 1600);
    }
    SECTION("reordered") {
        two.link().reorder = 0.5;
        two.send_many(1000);
        CHECK(two.got.size() == 1000);
        auto number = [](const std::string& text) { return std::stoi(text); };
        int swaps = 0;
        for (std::size_t i = 1; i < two.got.size(); ++i) swaps += number(two.got[i]) < number(two.got[i - 1]);
        CHECK(swaps > 50);
    }
    SECTION("stopped by a partition") {
        two.world.net().partition("boat", "shore");
        two.send_many(10);
        CHECK(two.got.empty());
        two.world.net().heal("boat", "shore");
        two.send_many(10);
        CHECK(two.got.size() == 10);
    }
    SECTION("beyond the bandwidth") {
        two.link().bandwidth_bytes_per_second = 100;
        two.send_many(1000); // a little more than twice what goes
        CHECK(two.got.size() > 350);
        CHECK(two.got.size() < 550);
    }
}

TEST_CASE("sim: a datagram beyond the limit or to nowhere is an error or lost") {
    two_ports two;
    two.link().datagram_limit_bytes = 100;
    CHECK(two.send(std::string(101, 'x')) == asio::error::message_size);
    CHECK_FALSE(two.send(std::string(100, 'x')));
    CHECK(two.from->try_send(at("udp://nowhere:900"), {}) == asio::error::host_not_found);
    CHECK_FALSE(two.from->try_send(at("udp://shore:901"), {}));
    two.world.run_for(1s);
    CHECK(two.got.size() == 1);
    CHECK(two.shore.open_datagram(two.shore_loop->loop(), at("udp://127.0.0.1:900")).error().code() ==
          ise::errc::address_in_use);
    two.to->close();
    two.world.run_for(1s);
    CHECK_FALSE(two.send("late"));
    two.world.run_for(1s);
    CHECK(two.got.size() == 1);
}

} // namespace datagrams_test
