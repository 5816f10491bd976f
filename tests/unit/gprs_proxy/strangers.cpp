// Who calls and is not the boat.
#include "quay.hpp"

#include <components/communication_node/communication_node.hpp>
#include <components/gprs_link/gprs_link_emulator.hpp>

#include <asio/buffer.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <functional>
#include <set>

namespace strangers_test {

using namespace std::chrono_literals;
using namespace atirma;
using gprs_test::quay;

namespace {

/// One who connects and says what he likes, on the virtual network.
class stranger {
public:
    stranger(quay& at, std::string words, ise::duration between = 0s, const std::string& host = "shore")
        : words_(std::move(words)), between_(between), to_("tcp://" + host + ":7420") {
        at.world.host("pirate").start_process("pirate", [this](ise::sim::process& here) -> std::shared_ptr<void> {
            auto node = std::make_shared<ise::node>(here, quay::quiet());
            node->start(
                "", [this](ise::component& self) { return talk(self); }, quay::asks_only());
            return node;
        });
    }
    bool cut = false;
    std::size_t heard = 0; ///< bytes

private:
    ise::task<> talk(ise::component& self) {
        auto shore = ise::endpoint::parse(to_).value();
        auto made = co_await self.env().connect(self.on(), shore);
        line_ = std::move(made.value());
        self.spawn("words", say(self));
        std::array<char, 256> buffer;
        for (;;) {
            auto got = co_await line_->read_some(asio::buffer(buffer));
            heard += got.bytes;
            if (got.problem) break;
        }
        cut = true;
    }
    ise::task<> say(ise::component& self) {
        for (std::size_t at = 0; at < words_.size() && !cut;) {
            auto size = between_ > 0s ? std::size_t{1} : words_.size() - at;
            asio::const_buffer piece(words_.data() + at, size);
            auto moved = line_->try_write(std::span(&piece, 1));
            if (moved.problem && moved.problem != asio::error::would_block) co_return;
            at += moved.bytes;
            co_await self.sleep(std::max<ise::duration>(between_, 1ms));
        }
    }

    std::string words_;
    ise::duration between_;
    std::string to_;
    std::unique_ptr<ise::stream> line_;
};

/// Logs in by datagram with the boat's name, and sends packets under its numbers.
void logs_in_as_the_boat(quay& it, std::uint32_t first, std::uint32_t last,
                         std::function<ise::bytes(packet_header)> forge) {
    it.world.host("pirate").start_process("pirate", [=](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quay::quiet());
        node->start(
            "",
            [=](ise::component& self) -> ise::task<> {
                ise::endpoint any{ise::protocol::udp, "0.0.0.0", 0, {}};
                auto socket = std::move(self.env().open_datagram(self.on(), any).value());
                auto shore = ise::endpoint::parse("udp://shore:7420").value();
                auto login = gprs::encode(gprs::login{"atirma", 5, first, last, 1});
                socket->try_send(shore, ise::as_bytes(login));
                auto [problem, got] = co_await socket->receive();
                if (problem) co_return;
                auto asked = gprs::parse(ise::as_text(got->content).substr(0, got->content.size() - 2)).value();
                auto key = gprs::encode(gprs::shown_key{std::get<gprs::challenge>(asked).key});
                socket->try_send(shore, ise::as_bytes(key + login));
                for (std::uint32_t n = first; n <= last; ++n) {
                    gprs::record forged;
                    forged.boot = 5;
                    forged.number = n;
                    packet_header header;
                    header.boot = 5;
                    header.sequence = n;
                    forged.raw = forge(header);
                    socket->try_send(shore, ise::as_bytes(key + gprs::encode(forged)));
                    co_await self.sleep(10ms);
                }
            },
            quay::asks_only());
        return node;
    });
}

} // namespace

TEST_CASE("gprs proxy: a stranger who talks nonsense, too much, or nothing, is cut off and logged, and the boat does "
          "not notice") {
    quay it("tcp", 20);
    it.start();
    stranger browser(it, "GET / HTTP/1.1\r\nHost: shore\r\n\r\n");
    stranger flood(it, std::string(1'000'000, 'x'));
    stranger other(it, atirma::gprs::encode(atirma::gprs::login{"pirate", 1, 1, 0}));
    stranger slow(it, "$PATL,atirma,5,1,0,", 1s);
    stranger silent(it, "");
    it.world.run_for(5s);
    CHECK(browser.cut);
    CHECK(flood.cut);
    CHECK(other.cut);
    CHECK_FALSE(silent.cut);
    it.world.run_for(6s);
    CHECK(silent.cut);
    CHECK(slow.cut); // a byte a second is no login
    CHECK(browser.heard + flood.heard + other.heard + slow.heard + silent.heard == 0);
    REQUIRE(it.until([&] { return it.complete(); }));
    CHECK(it.boat.resent == 0);
    CHECK(it.seen.state->strangers_cut_off == 5);
    CHECK(it.seen.state->strangers == 0);
    CHECK(it.warned("no line of the uplink"));
    CHECK(it.warned("'pirate'"));
    CHECK(it.warned("did not log in in time"));
}

TEST_CASE("gprs proxy: a crowd of strangers holds no place that the boat needs, and does not fill the log") {
    quay it("tcp", 20);
    it.start_proxy();
    it.watch();
    it.world.run_for(1s);
    std::vector<std::unique_ptr<stranger>> crowd;
    for (int i = 0; i < 300; ++i) crowd.push_back(std::make_unique<stranger>(it, ""));
    it.start_boat();
    REQUIRE(it.until([&] { return it.complete(); }));
    CHECK(it.seen.state->strangers_cut_off == 300);
    CHECK(std::all_of(crowd.begin(), crowd.end(), [](const auto& one) { return one->cut; }));
    CHECK(it.warnings.size() < 20);
}

TEST_CASE("gprs link: a crowd on the carrier breaks its own oldest connections, not the boat's, also while the proxy "
          "is dialled") {
    const bool reached = GENERATE(true, false);
    INFO("the proxy is reached: " << reached);
    quay it("tcp", 20);
    it.options.shore.max_strangers = 1000; // the carrier is what is asked
    it.boat.shore = "tcp://carrier:7420";
    it.world.host("carrier").start_process("carrier", [](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quay::quiet());
        gprs_link_options between;
        between.listen = {"tcp://0.0.0.0:7420"};
        between.proxy_tcp = "tcp://shore:7420";
        between.delay_s = between.jitter_s = 0;
        node->start<gprs_link_emulator>("", quay::asks_only(), between);
        return node;
    });
    it.start();
    REQUIRE(it.until([&] { return it.boat.measured >= 5 && it.boat.waiting == 0; }));
    auto since = it.seen.state->connected_since;
    REQUIRE(since);
    if (!reached) it.world.net().partition("carrier", "shore");
    std::vector<std::unique_ptr<stranger>> crowd;
    for (int i = 0; i < 200; ++i) {
        crowd.push_back(std::make_unique<stranger>(it, "", 0s, "carrier"));
        it.world.run_for(1ms);
    }
    it.world.run_for(200ms);
    CHECK(std::count_if(crowd.begin(), crowd.end(), [](const auto& one) { return one->cut; }) == 200 - 63);
    CHECK_FALSE(crowd.back()->cut);
    it.world.net().heal("carrier", "shore");
    REQUIRE(it.until([&] { return it.complete(); }));
    CHECK(it.seen.state->connected_since == since); // over the same connection
}

TEST_CASE("gprs proxy: datagrams of strangers get no answer, cost nothing, and are told now and then") {
    quay it("udp", 20);
    it.start();
    std::size_t answers = 0;
    it.world.host("pirate").start_process("pirate", [&](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quay::quiet());
        node->start(
            "",
            [&](ise::component& self) -> ise::task<> {
                ise::endpoint any{ise::protocol::udp, "0.0.0.0", 0, {}};
                auto socket = std::move(self.env().open_datagram(self.on(), any).value());
                auto shore = ise::endpoint::parse("udp://shore:7420").value();
                atirma::gprs::record forged;
                forged.boot = 5;
                forged.number = 1;
                forged.raw = gprs_test::fix(77);
                std::vector<std::string> words{"hello", "", atirma::gprs::encode(forged),
                                               atirma::gprs::encode(atirma::gprs::login{"pirate", 5, 1, 0}),
                                               std::string(60'000, 'x')};
                for (int i = 0; i < 200; ++i) {
                    for (const auto& text : words) socket->try_send(shore, ise::as_bytes(text));
                    co_await self.sleep(10ms);
                }
                for (;;) {
                    auto [problem, got] = co_await socket->receive();
                    if (problem) break;
                    ++answers;
                }
            },
            quay::asks_only());
        return node;
    });
    REQUIRE(it.until([&] { return it.complete(); }));
    CHECK(answers == 0);
    CHECK(it.seen.telemetry.size() == 20);
    CHECK(it.seen.state->stranger_datagrams == 1000);
    CHECK(it.warnings.size() < 30);
    CHECK(it.warned("brings no login"));
}

TEST_CASE("gprs proxy: who logs in by datagram beside the boat's connection gets no telecommand and answers none") {
    quay it("tcp", 20);
    it.boat.mute = true;
    it.start();
    REQUIRE(it.until([&] { return it.seen.telemetry.size() >= 3; }));
    std::size_t answers = 0;
    it.world.host("pirate").start_process("pirate", [&](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quay::quiet());
        node->start(
            "",
            [&](ise::component& self) -> ise::task<> {
                ise::endpoint any{ise::protocol::udp, "0.0.0.0", 0, {}};
                auto socket = std::move(self.env().open_datagram(self.on(), any).value());
                auto shore = ise::endpoint::parse("udp://shore:7420").value();
                acknowledgement done;
                done.id = 7;
                auto login = gprs::encode(gprs::login{"atirma", 5, 1000, 999, 1});
                auto lie = gprs::encode(gprs::outcome{7, 0, encode_acknowledgement(done)});
                for (int i = 0; i < 400; ++i) {
                    socket->try_send(shore, ise::as_bytes(login));
                    socket->try_send(shore, ise::as_bytes(login + lie));
                    co_await self.sleep(50ms);
                }
                for (;;) {
                    auto [problem, got] = co_await socket->receive();
                    if (problem) break;
                    ++answers;
                }
            },
            quay::asks_only());
        return node;
    });
    quay::asked answer;
    it.command(7, answer, 20, 30s);
    REQUIRE(it.until([&] { return answer.has_value(); }));
    CHECK((*answer)->state == telecommand_stage::expired); // nobody but the boat is believed
    CHECK(it.boat.heard.size() >= 1);
    REQUIRE(it.until([&] { return it.complete(); }));
    CHECK(answers == 0);
    CHECK(it.boat.half_open == 0);
    CHECK(it.seen.state->moves == 0);
    CHECK(it.seen.state->from.starts_with("tcp://"));
    CHECK(it.warned("the boat is there over a connection"));
}

TEST_CASE(
    "gprs proxy: what somebody sent in the boat's name during an outage takes no place of the boat's own packets") {
    quay it("tcp", 20);
    it.start();
    REQUIRE(it.until([&] { return it.seen.telemetry.size() >= 3; }));
    it.world.net().partition("boat", "shore");
    it.world.run_for(4min); // until the shore has given the boat up
    logs_in_as_the_boat(it, 8, 20, [](packet_header header) {
        header.measured_at = utc_time(std::chrono::seconds(4'000'000'000 + header.sequence)); // far in the future
        return encode_telemetry(header, location());
    });
    REQUIRE(it.until([&] { return it.seen.state && it.seen.state->from.starts_with("udp://"); }));
    it.world.run_for(5s);
    it.world.net().heal("boat", "shore");
    REQUIRE(it.until([&] { return it.boat.measured == 20 && it.boat.waiting == 0; }));
    std::set<std::uint32_t> own;
    for (const auto& packet : it.seen.telemetry)
        if (packet.raw == gprs_test::fix(packet.sequence)) own.insert(packet.sequence);
    CHECK(own.size() == 20);
    auto last =
        std::ranges::find_if(it.seen.telemetry, [](const auto& packet) { return packet.raw == gprs_test::fix(20); });
    REQUIRE(last != it.seen.telemetry.end());
    CHECK_FALSE(last->history); // where the boat is now
}

TEST_CASE(
    "gprs proxy: a node keeps the boat's packets also where forged ones of the same numbers and times came first") {
    quay it("tcp", 20);
    it.options.store_at = "tcp://node:7430";
    it.world.host("node").start_process("node", [](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quay::quiet());
        ise::component_options where;
        where.listen = {ise::endpoint::parse("tcp://0.0.0.0:7430").value()};
        communication_node_options options;
        options.file = "memory:gprs-node";
        options.role.clear();
        node->start<communication_node>("atirma/shore/node-1", where, options);
        return node;
    });
    it.start();
    REQUIRE(it.until([&] { return it.seen.telemetry.size() >= 3; }));
    it.world.net().partition("boat", "shore");
    it.world.run_for(4min); // until the shore has given the boat up
    auto forge = [](packet_header header) {
        header.measured_at = parse_telemetry(gprs_test::fix(header.sequence))->header.measured_at;
        return encode_telemetry(header, location());
    };
    logs_in_as_the_boat(it, 8, 20, forge);
    REQUIRE(it.until([&] { return it.seen.state && it.seen.state->from.starts_with("udp://"); }));
    it.world.run_for(5s);
    it.world.net().heal("boat", "shore");
    REQUIRE(it.until([&] { return it.boat.measured == 20 && it.boat.waiting == 0; }));
    std::optional<track_page> listed;
    it.user([&](ise::component& self) -> ise::task<> {
        auto node = self.at(ise::endpoint::parse("tcp://node:7430").value());
        track_request everything;
        listed = co_await node.call(services::track, everything, 10s);
    });
    REQUIRE(it.until([&] { return listed.has_value(); }));
    std::set<std::uint32_t> own;
    std::size_t forged = 0;
    for (const auto& packet : listed->packets)
        if (packet.raw == gprs_test::fix(packet.sequence)) own.insert(packet.sequence);
        else ++forged;
    CHECK(own.size() == 20);
    CHECK(forged > 0);
}

TEST_CASE("gprs proxy: a packet that is none is dropped and not asked for again") {
    quay it("tcp", 0);
    it.start_proxy();
    it.watch();
    it.world.run_for(1s);
    atirma::gprs::record odd;
    odd.boot = 5;
    odd.number = 1;
    odd.raw = ise::bytes(30, std::byte{9});
    stranger boat(it, atirma::gprs::encode(atirma::gprs::login{"atirma", 5, 1, 1}) + atirma::gprs::encode(odd));
    REQUIRE(it.until([&] { return it.seen.state && it.seen.state->acknowledged == 1; }));
    CHECK(it.seen.state->malformed == 1);
    CHECK(it.seen.telemetry.empty());
    CHECK_FALSE(boat.cut);
}

} // namespace strangers_test
