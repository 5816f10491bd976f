#include "quay.hpp"

#include <asio/buffer.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <array>
#include <set>

namespace stories_test {

using namespace std::chrono_literals;
using namespace atirma;
using gprs_test::quay;

TEST_CASE("gprs proxy: telemetry arrives once, says which link it came by, and is acknowledged") {
    for (const auto* protocol : {"tcp", "udp"}) {
        quay it(protocol);
        it.start();
        INFO(protocol);
        REQUIRE(it.until([&] { return it.complete(); }));
        CHECK(it.seen.telemetry.size() == 5);
        CHECK(it.seen.again == 0);
        CHECK(it.never_back());
        for (const auto& packet : it.seen.telemetry) {
            CHECK(packet.link == link_id::gprs);
            CHECK_FALSE(packet.history);
            auto message = parse_telemetry(packet.raw);
            REQUIRE(message);
            CHECK(packet.measured_at == message->header.measured_at);
        }
        REQUIRE(it.until([&] { return it.seen.state && it.seen.state->acknowledged == 5; }));
        CHECK(it.seen.state->connected);
        CHECK(it.seen.state->from.find(protocol) == 0);
        CHECK(it.seen.state->trouble.empty());
        CHECK(it.seen.state->boot == 5);
        CHECK(it.seen.state->announced == 5);
        CHECK(it.seen.state->connected_since);
        CHECK(it.seen.state->telemetry_published == 5);
        CHECK(it.seen.state->listening.size() == 2);
        REQUIRE(it.warnings.size() == 1); // it has no radio key
        CHECK(it.warnings.front().find("not sealed") != std::string::npos);
    }
}

TEST_CASE("gprs proxy: whichever byte is the last of the first connection, nothing is lost, nothing comes twice") {
    for (auto which : {ise::sim::direction::to_server, ise::sim::direction::to_client}) {
        for (std::uint64_t bytes = 0;; ++bytes) {
            quay it("tcp", 3, bytes);
            it.boat.period = 100ms;
            it.world.net().cut("boat", "shore", which, bytes);
            it.start();
            INFO((which == ise::sim::direction::to_server ? "up, " : "down, ") << bytes << " bytes");
            REQUIRE(it.until([&] { return it.complete(); }));
            REQUIRE(it.seen.telemetry.size() == 3);
            REQUIRE(it.seen.again == 0);
            REQUIRE(it.never_back());
            if (it.world.net().cuts() == 0) break;
        }
    }
}

TEST_CASE("gprs proxy: whichever operation fails, the link heals") {
    for (const auto* protocol : {"tcp", "udp"}) {
        for (std::uint64_t n = 0;; ++n) {
            quay it(protocol, 3);
            it.boat.period = 100ms;
            it.start_proxy();
            it.watch();
            it.world.run_for(1s);
            it.world.fail_at(n);
            it.start_boat();
            INFO(protocol << ", operation " << n);
            // The console may be the one that was cut off, and miss packets by that: what the proxy published is looked
            // at.
            REQUIRE(it.until([&] { return it.boat.measured == 3 && it.boat.waiting == 0; }));
            REQUIRE(it.until([&] { return it.seen.state && it.seen.state->telemetry_published == 3; }));
            REQUIRE(it.seen.state->packets_received == 3);
            if (!it.world.faults().failed()) break;
            if (n > 400) break; // what goes on for ever goes on well
        }
    }
}

TEST_CASE(
    "gprs proxy: a link that is half open for minutes loses nothing: the newest fix comes first, the rest as history") {
    for (const auto* protocol : {"tcp", "udp"}) {
        quay it(protocol, 100);
        it.start();
        REQUIRE(it.until([&] { return it.seen.telemetry.size() >= 10; }));
        it.world.net().partition("boat", "shore");
        it.world.run_for(2min);
        auto before = it.seen.telemetry.size();
        CHECK(it.boat.half_open >= 1);
        it.world.net().heal("boat", "shore");
        INFO(protocol);
        REQUIRE(it.until([&] { return it.complete(); }));
        CHECK(it.seen.telemetry.size() == 100);
        CHECK(it.never_back());
        auto late = std::count_if(it.seen.telemetry.begin(), it.seen.telemetry.end(),
                                  [](const auto& packet) { return packet.history; });
        CHECK(late > 40);
        auto first = it.seen.telemetry.begin() + static_cast<std::ptrdiff_t>(before);
        // Not at the end of all that.
        CHECK(std::any_of(first, first + 15, [](const auto& packet) { return !packet.history; }));
    }
}

TEST_CASE("gprs proxy: a boat that fell silent is given up, and the state says so") {
    quay it;
    it.start();
    REQUIRE(it.until([&] { return it.complete(); }));
    it.craft->pause();
    REQUIRE(it.until([&] { return it.seen.state && !it.seen.state->connected; }));
    CHECK(it.seen.state->trouble.find("180 s") != std::string::npos);
    CHECK(it.seen.state->half_open == 1);
    it.craft->go_on();
    REQUIRE(it.until([&] { return it.seen.state->connected; }));
    CHECK(it.seen.state->trouble.empty());
}

TEST_CASE("gprs proxy: one that is killed and started again is called again, and nothing is missing") {
    for (const auto* protocol : {"tcp", "udp"}) {
        quay it(protocol, 60);
        it.start();
        REQUIRE(it.until([&] { return it.seen.telemetry.size() >= 10; }));
        it.proxy->crash();
        it.world.run_for(20s);
        it.proxy->restart();
        INFO(protocol);
        REQUIRE(it.until([&] { return it.boat.measured == 60 && it.boat.waiting == 0; }));
        it.world.run_for(5s);
        // Only what its subscriber missed while it was away from the proxy can be missing at him; the boat's side is
        // whole.
        CHECK(it.seen.state->given_up == 0);
        CHECK(it.seen.state->acknowledged == 60);
        CHECK(it.never_back());
    }
}

TEST_CASE("gprs proxy: a boat that was restarted counts anew, and is understood") {
    quay it("tcp", 10);
    it.start();
    REQUIRE(it.until([&] { return it.seen.telemetry.size() >= 4; }));
    it.boat.boot = 6;
    it.craft->restart();
    REQUIRE(it.until([&] { return it.complete(); }));
    REQUIRE(it.until([&] { return it.seen.state->boot == 6 && it.seen.state->acknowledged == 10; }));
    CHECK_FALSE(it.seen.telemetry.back().history);
    CHECK(it.seen.telemetry.back().boot == 6);
}

TEST_CASE("gprs proxy: lossy, late, doubled and disordered datagrams are all there in the end") {
    quay it("udp", 60, 9);
    auto& air = it.world.net().between("boat", "shore");
    air.loss = 0.25;
    air.duplicate = 0.1;
    air.reorder = 0.2;
    air.reorder_delay = 3s;
    air.latency = 800ms;
    it.start();
    REQUIRE(it.until([&] { return it.complete(); }));
    CHECK(it.seen.telemetry.size() == 60);
    CHECK(it.seen.again == 0);
    CHECK(it.never_back());
    CHECK(it.boat.resent > 0);
}

namespace {

/// Keeps telemetry as a test says.
struct doubtful_store final : telemetry_store {
    bool works = false;
    std::size_t asked = 0;
    std::vector<telemetry_packet> kept;
    ise::task<> keep(std::vector<telemetry_packet> packets) override {
        ++asked;
        if (!works) throw ise::error(ise::errc::io_failed, "the disk is full");
        kept.insert(kept.end(), packets.begin(), packets.end());
        co_return;
    }
};

} // namespace

TEST_CASE("gprs proxy: the boat is acknowledged only once the store has it, and hears of no packet that is not safe") {
    quay it;
    auto store = std::make_shared<doubtful_store>();
    it.options.store = store;
    it.start();
    REQUIRE(it.until([&] { return it.boat.measured == 5 && it.seen.telemetry.size() == 5; }));
    REQUIRE(
        it.until([&] { return it.seen.state && it.seen.state->trouble.find("disk is full") != std::string::npos; }));
    it.world.run_for(1min);
    CHECK(it.boat.waiting == 5);
    CHECK(it.boat.acknowledged == 0);
    CHECK(it.seen.state->not_safe_yet == 5);
    CHECK(store->asked > 3);
    CHECK(std::count_if(it.warnings.begin(), it.warnings.end(),
                        [](const auto& line) { return line.find("disk is full") != std::string::npos; }) == 1);
    store->works = true;
    REQUIRE(it.until([&] { return it.boat.waiting == 0; }));
    CHECK(store->kept.size() == 5);
    CHECK(it.seen.telemetry.size() == 5);
    CHECK(it.seen.again == 0);
    REQUIRE(it.until([&] { return it.seen.state->trouble.empty(); }));
}

TEST_CASE("gprs proxy: a communication node keeps what the boat may forget, in parts that it takes") {
    quay it("tcp", 400);
    it.boat.period = 1ms; // more than one part
    it.options.store_at = "tcp://node:7430";
    std::set<std::uint32_t> kept;
    std::size_t largest = 0;
    bool works = false;
    it.start();
    REQUIRE(it.until([&] { return it.boat.measured == 400; }));
    auto troubled_by = [&](const std::string& what) {
        return it.until([&] { return it.seen.state && it.seen.state->trouble.find(what) != std::string::npos; });
    };
    REQUIRE(troubled_by("cannot be kept"));
    CHECK(it.boat.acknowledged == 0);
    it.world.host("node").start_process("node", [&](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quay::quiet());
        ise::component_options where;
        where.listen = {ise::endpoint::parse("tcp://0.0.0.0:7430").value()};
        auto keeper = [&](ise::component& self) -> ise::task<> {
            self.provide(services::telemetry_store, [&](keep_request request) {
                if (!works) throw ise::error(ise::errc::refused, "the disk is full");
                largest = std::max(largest, request.packets.size());
                for (const auto& packet : request.packets) kept.insert(packet.sequence);
                return keep_reply();
            });
            co_await self.sleep(24h);
        };
        node->start("atirma/shore/node-1", keeper, where);
        return node;
    });
    REQUIRE(troubled_by("disk is full"));
    CHECK(it.boat.acknowledged == 0);
    works = true;
    REQUIRE(it.until([&] { return it.boat.waiting == 0; }));
    CHECK(kept.size() == 400);
    CHECK(largest <= keep_request::max_packets);
}

TEST_CASE("gprs proxy: a telecommand is acknowledged by the boat, and done once however often it comes") {
    for (const auto* protocol : {"tcp", "udp"}) {
        quay it(protocol, 3);
        it.start();
        quay::asked first, again;
        REQUIRE(it.until([&] { return it.complete(); }));
        it.command(7, first);
        REQUIRE(it.until([&] { return first.has_value(); }));
        REQUIRE(*first);
        CHECK((*first)->state == telecommand_stage::acknowledged);
        CHECK((*first)->text == "aye");
        it.command(7, again);
        REQUIRE(it.until([&] { return again.has_value(); }));
        CHECK((*again)->state == telecommand_stage::acknowledged);
        CHECK(it.boat.executed == std::vector<std::uint32_t>{7});
        CHECK(it.boat.heard.size() == 1);
        REQUIRE(it.seen.states.size() >= 3);
        CHECK(it.seen.states.front().link == link_id::gprs);
    }
}

TEST_CASE("gprs proxy: without a boat a telecommand waits, goes as soon as there is one, and expires in time") {
    quay it;
    it.start_proxy();
    it.watch();
    it.world.run_for(1s);
    quay::asked waits, expires;
    it.command(7, waits, 300, 5s);
    it.command(8, expires, 10, 30s);
    REQUIRE(it.until([&] { return waits && expires; }));
    CHECK((*waits)->state == telecommand_stage::pending);
    CHECK((*expires)->state == telecommand_stage::expired);
    CHECK((*expires)->text.find("before it could be sent") != std::string::npos);
    it.start_boat();
    REQUIRE(it.until(
        [&] { return !it.seen.states.empty() && it.seen.states.back().state == telecommand_stage::acknowledged; }));
    CHECK(it.boat.executed == std::vector<std::uint32_t>{7});
}

TEST_CASE("gprs proxy: a telecommand that a broken link swallowed goes again over the next, and is done once") {
    quay it("tcp", 100);
    it.start();
    REQUIRE(it.until([&] { return it.seen.telemetry.size() >= 3; }));
    it.boat.mute = true;
    quay::asked answer;
    it.command(7, answer, 300, 4min);
    REQUIRE(it.until([&] { return it.boat.heard.size() == 1; }));
    it.world.net().partition("boat", "shore");
    it.boat.mute = false;
    it.world.run_for(60s);
    it.world.net().heal("boat", "shore");
    REQUIRE(it.until([&] { return answer.has_value(); }));
    REQUIRE(*answer);
    CHECK((*answer)->state == telecommand_stage::acknowledged);
    CHECK(it.boat.heard.size() >= 2);
    CHECK(it.boat.executed == std::vector<std::uint32_t>{7});
}

TEST_CASE("gprs proxy: a result without a packet brings neither a time nor a value") {
    quay it;
    it.start_proxy();
    it.watch();
    it.world.run_for(1s);
    auto boat = [](ise::component& self) -> ise::task<> {
        auto shore = ise::endpoint::parse("tcp://shore:7420").value();
        auto made = co_await self.env().connect(self.on(), shore);
        auto line = std::move(made.value());
        auto say = [&line](const std::string& text) {
            asio::const_buffer piece(text.data(), text.size());
            line->try_write(std::span(&piece, 1));
        };
        say(gprs::encode(gprs::login{"atirma", 5, 1, 0}));
        std::string heard;
        std::array<char, 256> buffer;
        while (heard.find("$PATC,7,") == std::string::npos) {
            auto got = co_await line->read_some(asio::buffer(buffer));
            if (got.problem) co_return;
            heard.append(buffer.data(), got.bytes);
        }
        say(gprs::encode(gprs::outcome{7, 0, {}}));
        co_await self.sleep(1h);
    };
    it.world.host("boat").start_process("boat", [boat](ise::sim::process& here) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(here, quay::quiet());
        node->start("", boat, quay::asks_only());
        return node;
    });
    telecommand_request request;
    request.id = 7;
    request.command = commands::get_parameter{};
    quay::asked answer;
    it.user([request, &answer](ise::component& self) -> ise::task<> {
        auto shore = quay::at_proxy(self);
        answer = co_await shore.try_call(services::telecommand, request, 20s);
    });
    REQUIRE(it.until([&] { return answer && !it.seen.states.empty() && is_final(it.seen.states.back().state); }));
    REQUIRE(*answer);
    CHECK((*answer)->state == telecommand_stage::acknowledged);
    CHECK_FALSE((*answer)->value);
    CHECK(it.seen.states.back().result == ack_code::done);
    CHECK_FALSE(it.seen.states.back().executed_at);
    CHECK_FALSE(it.seen.states.back().value);
}

TEST_CASE("gprs proxy: an endpoint that is taken, or none, ends it with words that help") {
    for (const auto* listen : {"tcp://0.0.0.0:7411", "boat", "local:///tmp/x", ""}) {
        quay it;
        it.options.listen = {listen};
        if (!*listen) it.options.listen.clear();
        std::string failed;
        it.world.host("shore").start_process("proxy", [&](ise::sim::process& here) -> std::shared_ptr<void> {
            auto node = std::make_shared<ise::node>(
                here, quay::quiet([&failed](const ise::log_record& record) { failed += ise::format_line(record); }));
            ise::component_options where;
            where.listen = {ise::endpoint::parse("tcp://0.0.0.0:7411").value()};
            node->start<gprs_proxy>("atirma/shore/gprs", where, it.options);
            return node;
        });
        INFO("listen " << listen);
        REQUIRE(it.until([&] { return !failed.empty(); }, 10s));
        INFO(failed);
        if (std::string(listen).starts_with("tcp")) CHECK(failed.find("7411") != std::string::npos);
        else CHECK(failed.find("tcp://") != std::string::npos);
    }
}

} // namespace stories_test
