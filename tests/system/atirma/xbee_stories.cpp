#include "sea.hpp"

#include <ise/database/database.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>

using namespace std::chrono_literals;
using namespace atirma;

namespace {

using asked = std::optional<ise::result<telecommand_reply>>;

void command(sea& it, telecommand_request request, ise::duration deadline, asked& into) {
    it.user([request, deadline, &into](ise::component& self) -> ise::task<> {
        auto proxy = sea::proxy(self);
        into = co_await proxy.try_call(services::telecommand, request, deadline);
    });
}

void set_air(sea& it, xbee_air_request request) {
    bool done = false;
    it.user([request, &done](ise::component& self) -> ise::task<> {
        auto air = sea::air(self);
        auto response = co_await air.try_call(services::air_control, request, 5s);
        response.value();
        done = true;
    });
    REQUIRE(it.until([&] { return done; }));
}

void switch_link(sea& it, bool up) {
    xbee_air_request request;
    request.up = up;
    set_air(it, request);
}

bool radio_works(const sea::watched& seen) { return !seen.telemetry.empty() && seen.local && seen.local->modem_ready; }

} // namespace

TEST_CASE("atirma: telemetry arrives at a subscriber through both modems, each packet once") {
    sea it;
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.telemetry.size() >= 60; }));
    std::set<std::pair<int, std::uint32_t>> numbers;
    std::set<std::string> types;
    for (const auto& packet : seen.telemetry) {
        numbers.emplace(packet.boot, packet.sequence);
        auto message = parse_telemetry(packet.raw);
        REQUIRE(message);
        types.insert(std::string(name_of(message->body)));
        CHECK(packet.link == link_id::xbee);
        CHECK(packet.measured_at == message->header.measured_at);
        CHECK(packet.received_at >= packet.measured_at);
        CHECK(packet.received_at - packet.measured_at < 10s);
    }
    CHECK(numbers.size() == seen.telemetry.size());
    CHECK(types.contains("location"));
    CHECK(types.contains("navigation"));
    CHECK(types.contains("wind"));
    CHECK(types.contains("waypoints"));
    CHECK(seen.lost == 0);
}

TEST_CASE("atirma: what the radio brings while nobody subscribes is told to the first who does") {
    sea it;
    it.world.run_for(30s);
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.telemetry.size() >= 30; }));
    CHECK(seen.telemetry.front().received_at < it.world.wall_start + 15s);
    CHECK(std::ranges::is_sorted(seen.telemetry, {}, [](const auto& packet) { return packet.sequence; }));
    auto& late = it.watch();
    REQUIRE(it.until([&] { return late.telemetry.size() >= 3; }));
    CHECK(late.telemetry.front().received_at > it.world.wall_start + 25s); // not all of it again
}

TEST_CASE("atirma: set_mode over the radio is acknowledged by the boat and changes its mode") {
    sea it;
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return radio_works(seen); }));
    REQUIRE(it.boat().pilot().mode() == sailing_mode::automatic);
    asked answer;
    command(it, set_mode(7, sailing_mode::hold), 20s, answer);
    REQUIRE(it.until([&] { return answer.has_value(); }));
    REQUIRE(*answer);
    CHECK((*answer)->id == 7);
    CHECK((*answer)->state == telecommand_stage::acknowledged);
    CHECK((*answer)->result == ack_code::done);
    CHECK((*answer)->text == "hold");
    CHECK(it.boat().pilot().mode() == sailing_mode::hold);
    // The subscription told the way there, without the proxy being asked.
    REQUIRE(
        it.until([&] { return !seen.states.empty() && seen.states.back().state == telecommand_stage::acknowledged; }));
    CHECK(seen.states.front().state == telecommand_stage::queued);
    CHECK(seen.states.back().id == 7);
}

TEST_CASE("atirma: the same id is executed once, and stands for one telecommand only") {
    sea it;
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return radio_works(seen); }));
    asked first, again, other;
    command(it, set_mode(9, sailing_mode::hold), 20s, first);
    REQUIRE(it.until([&] { return first.has_value(); }));
    command(it, set_mode(9, sailing_mode::hold), 20s, again);
    command(it, set_mode(9, sailing_mode::manual), 20s, other);
    REQUIRE(it.until([&] { return again && other; }));
    REQUIRE(*again);
    CHECK((*again)->state == telecommand_stage::acknowledged);
    REQUIRE_FALSE(*other);
    CHECK(other->error().code() == ise::errc::refused);
    CHECK(it.boat().pilot().mode() == sailing_mode::hold);
    it.world.run_for(5s);
    CHECK(seen.local->telecommands_sent == 1);
}

TEST_CASE("atirma: over a link that is off a telecommand is pending, and acknowledged when it is on again") {
    sea it;
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return radio_works(seen); }));
    switch_link(it, false);
    asked answer;
    command(it, set_mode(11, sailing_mode::station_keep), 5s, answer);
    REQUIRE(it.until([&] { return answer.has_value(); }, 6s)); // within its deadline
    REQUIRE(*answer);
    CHECK((*answer)->state == telecommand_stage::pending);
    CHECK_FALSE((*answer)->result);
    CHECK(it.boat().pilot().mode() == sailing_mode::automatic);
    switch_link(it, true);
    REQUIRE(it.until(
        [&] { return !seen.states.empty() && seen.states.back().state == telecommand_stage::acknowledged; }, 5min));
    CHECK(seen.states.back().id == 11);
    CHECK(seen.states.back().attempts >= 2);
    CHECK(it.boat().pilot().mode() == sailing_mode::station_keep);
}

TEST_CASE("atirma: a telecommand whose time is over has expired, and says that it may have been executed") {
    sea it;
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return radio_works(seen); }));
    switch_link(it, false);
    auto request = set_mode(12, sailing_mode::hold);
    request.valid_s = 20;
    asked answer;
    command(it, request, 40s, answer);
    REQUIRE(it.until([&] { return answer.has_value(); }));
    REQUIRE(*answer);
    CHECK((*answer)->state == telecommand_stage::expired);
    CHECK_FALSE((*answer)->text.empty());
}

TEST_CASE("atirma: who follows one telecommand is told of no other, and hears first where it stands") {
    sea it;
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return radio_works(seen); }));
    switch_link(it, false);
    asked a, b;
    command(it, set_mode(21, sailing_mode::hold), 2s, a);
    command(it, set_mode(22, sailing_mode::manual), 2s, b);
    REQUIRE(it.until([&] { return a && b; }));
    std::optional<followed_telecommands> first;
    std::vector<telecommand_status> result;
    it.user([&](ise::component& self) -> ise::task<> {
        follow_telecommand which{22};
        auto proxy = sea::proxy(self);
        ise::subscribe_options options;
        auto states = co_await proxy.subscribe(services::telecommand_state, which, options);
        first = states.response();
        for (;;) {
            auto state = co_await states.next();
            if (!state) break;
            result.push_back(*state);
        }
    });
    REQUIRE(it.until([&] { return first.has_value(); }));
    REQUIRE(first->now.size() == 1);
    CHECK(first->now.front().id == 22);
    switch_link(it, true);
    REQUIRE(it.until([&] { return !result.empty() && result.back().state == telecommand_stage::acknowledged; }, 5min));
    for (const auto& state : result) CHECK(state.id == 22);
}

TEST_CASE("atirma: a proxy that is killed and started again heals: its subscribers receive on, and know of the gap") {
    sea it;
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.telemetry.size() >= 10; }));
    it.proxy_process().crash();
    it.world.run_for(20s);
    auto before = seen.telemetry.size();
    it.proxy_process().restart();
    REQUIRE(it.until([&] { return seen.telemetry.size() >= before + 10; }));
    CHECK(seen.unknown_gaps == 1);
    asked answer;
    command(it, set_mode(31, sailing_mode::hold), 20s, answer);
    REQUIRE(it.until([&] { return answer.has_value(); }));
    REQUIRE(*answer);
    CHECK((*answer)->state == telecommand_stage::acknowledged);
}

TEST_CASE("atirma: a boat without a memory that is started again within a second is told from the one before") {
    sea it;
    REQUIRE(it.until([&] { return it.boat_component().boat() != nullptr; }));
    std::set<std::uint16_t> boots;
    auto second = std::chrono::floor<std::chrono::seconds>(it.world.elapsed());
    for (int life = 0; life < 5; ++life) {
        CHECK(it.boat().boot() != 0);
        CHECK(boots.insert(it.boat().boot()).second);
        it.boat_process().restart();
        it.world.run_for(100ms);
        REQUIRE(it.boat_component().boat() != nullptr);
    }
    CHECK(it.world.elapsed() - second < 1s);
}

namespace {

/// A boat with a memory, which goes on with it in its next life.
struct remembering : sea {
    explicit remembering(const std::string& file) : disk(ise::database::open("memory:" + file, {}).value()) {
        boat_options.memory_file = "memory:" + file;
        boat_process().restart();
        REQUIRE(until([&] { return boat_component().boat() != nullptr; }));
    }
    /// The result of that telecommand at a proxy that has just started.
    ack_code result_of(telecommand_request request) {
        auto& seen = watch();
        asked answer;
        proxy_process().restart();
        REQUIRE(until([&] { return seen.local && seen.local->modem_ready; }));
        command(*this, request, 2min, answer);
        REQUIRE(until([&] { return answer.has_value(); }, 3min));
        REQUIRE(*answer);
        REQUIRE((*answer)->state == telecommand_stage::acknowledged);
        return (*answer)->result.value();
    }
    void lose_power() {
        boat_process().restart();
        REQUIRE(until([&] { return boat_component().boat() != nullptr; }));
    }

    ise::database disk; // over the boat's lives
};

} // namespace

TEST_CASE("atirma: what a boat answered as done is done after a loss of power in the same instant") {
    remembering it("atirma-answered");
    bool lost = false;
    it.boat_options.on_executed = [&](const acknowledgement& one) {
        if (one.id != 61 || std::exchange(lost, true)) return;
        throw std::runtime_error("the power is lost when the answer has left");
    };
    it.lose_power();
    asked answer;
    command(it, set_mode(61, sailing_mode::hold), 20s, answer);
    REQUIRE(it.until([&] { return lost; }));
    it.lose_power();
    CHECK(it.boat().pilot().mode() == sailing_mode::hold);
    it.result_of(set_mode(62, sailing_mode::automatic));
    CHECK(it.result_of(set_mode(61, sailing_mode::hold)) == ack_code::done);
    CHECK(it.boat().pilot().mode() == sailing_mode::automatic); // a repetition is answered, and changes nothing
}

TEST_CASE("atirma: a telecommand whose effect could not be remembered is executed when it comes again") {
    remembering it("atirma-half");
    it.disk.execute("CREATE TRIGGER broken BEFORE INSERT ON boat BEGIN SELECT RAISE(ABORT, 'no space'); END").value();
    CHECK(it.result_of(set_mode(61, sailing_mode::hold)) == ack_code::done);
    SECTION("after a loss of power") {
        it.disk.execute("DROP TRIGGER broken").value();
        it.lose_power();
        REQUIRE(it.boat().pilot().mode() == sailing_mode::automatic);
        CHECK(it.result_of(set_mode(61, sailing_mode::hold)) == ack_code::done);
        CHECK(it.boat().pilot().mode() == sailing_mode::hold);
    }
    SECTION("but not where the memory could be written later") {
        it.disk.execute("DROP TRIGGER broken").value();
        it.world.run_for(15s);
        it.lose_power();
        CHECK(it.boat().pilot().mode() == sailing_mode::hold);
        CHECK(it.disk.query("SELECT 1 FROM executed WHERE id = 61").value().size() == 1);
    }
}

TEST_CASE("atirma: the serial port vanishes and returns: the proxy says so, and telecommands wait for it") {
    sea it;
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return radio_works(seen); }));
    it.shore_line().vanish();
    REQUIRE(it.until([&] { return seen.local && !seen.local->port_open; }));
    CHECK(seen.local->trouble.find("/dev/ttyUSB0") != std::string::npos);
    asked answer;
    command(it, set_mode(41, sailing_mode::hold), 60s, answer);
    it.world.run_for(20s);
    CHECK_FALSE(answer);
    it.shore_line().come_back();
    REQUIRE(it.until([&] { return answer.has_value(); }));
    REQUIRE(*answer);
    CHECK((*answer)->state == telecommand_stage::acknowledged);
    auto packets = seen.telemetry.size();
    REQUIRE(it.until([&] { return seen.telemetry.size() > packets && seen.local->port_openings == 2; }));
    CHECK(seen.local->port_open);
    CHECK(seen.local->trouble.empty());
}

TEST_CASE("atirma: lossy air costs retries and no telecommand") {
    sea it(3);
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return radio_works(seen); }));
    xbee_air_request lossy;
    lossy.extra_loss = 0.4;
    set_air(it, lossy);
    std::vector<asked> answers(6);
    for (std::size_t i = 0; i < answers.size(); ++i) {
        telecommand_request request;
        request.id = static_cast<std::uint32_t>(100 + i);
        request.command = commands::waypoint_add{{28.16, -15.45}}; // none replaces another
        request.valid_s = 300;
        command(it, request, 4min, answers[i]);
    }
    REQUIRE(it.until(
        [&] { return std::all_of(answers.begin(), answers.end(), [](const asked& a) { return a.has_value(); }); },
        10min));
    for (const auto& answer : answers) {
        REQUIRE(*answer);
        CHECK((*answer)->state == telecommand_stage::acknowledged);
    }
    std::set<std::pair<int, std::uint32_t>> numbers;
    for (const auto& packet : seen.telemetry) numbers.emplace(packet.boot, packet.sequence);
    CHECK(numbers.size() == seen.telemetry.size());
}

TEST_CASE("atirma: telecommands that make no sense are refused before they are sent") {
    sea it;
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return radio_works(seen); }));
    auto endless = set_mode(51, sailing_mode::hold);
    endless.valid_s = 0;
    telecommand_request nowhere;
    nowhere.id = 52;
    nowhere.command = commands::waypoint_add{{91, 0}};
    asked a, b;
    command(it, endless, 5s, a);
    command(it, nowhere, 5s, b);
    REQUIRE(it.until([&] { return a && b; }));
    REQUIRE_FALSE(*a);
    REQUIRE_FALSE(*b);
    CHECK(a->error().code() == ise::errc::refused);
    CHECK(b->error().code() == ise::errc::refused);
    CHECK(a->error().executed() == ise::execution::not_executed);
}

TEST_CASE("atirma: parameters of the local modem are read and set by name") {
    sea it;
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return radio_works(seen); }));
    std::vector<ise::result<xbee_param>> answers;
    it.user([&answers](ise::component& self) -> ise::task<> {
        std::vector<xbee_param_request> requests(6);
        requests[0].name = "power_level";
        requests[0].value = 2;
        requests[1].name = "PL";
        requests[2].name = "power_level";
        requests[2].value = 9;
        requests[3].name = "colour";
        requests[4].name = "temperature_c";
        requests[5].name = ""; // as in ise call … xb_local_param '{}'
        auto proxy = sea::proxy(self);
        for (auto& request : requests) {
            auto answer = co_await proxy.try_call(services::xb_local_param, request, 10s);
            answers.push_back(std::move(answer));
        }
    });
    REQUIRE(it.until([&] { return answers.size() == 6; }));
    REQUIRE(answers[0]);
    CHECK(answers[0]->value == 2);
    REQUIRE(answers[1]);
    CHECK(answers[1]->value == 2);
    REQUIRE_FALSE(answers[2]);
    CHECK(answers[2].error().code() == ise::errc::refused);
    REQUIRE_FALSE(answers[3]);
    CHECK(answers[3].error().message().find("power_level") != std::string::npos); // says what there is
    REQUIRE(answers[4]);
    CHECK(answers[4]->value == 27);
    REQUIRE_FALSE(answers[5]);
    CHECK(answers[5].error().code() == ise::errc::refused);
    for (const char* word : {"no parameter is named", "temperature_c", "power_level", R"({"name":"rssi_dbm"})"})
        CHECK(answers[5].error().message().find(word) != std::string::npos);
    REQUIRE(it.until([&] { return seen.local->power_level == 2; }));
    CHECK(seen.local->address == 0x0013A20040000001);
    CHECK(seen.local->rssi_dbm.value_or(0) < 0);
}

TEST_CASE("atirma: the boat tells how strongly it hears the shore, once it has heard it") {
    sea it;
    auto& seen = it.watch();
    std::size_t looked_at = 0;
    auto parsed = [&]() -> std::optional<link_status> { // the next one of its radio
        while (looked_at < seen.telemetry.size()) {
            auto message = parse_telemetry(seen.telemetry[looked_at++].raw);
            const auto* link = message ? std::get_if<link_status>(&message->body) : nullptr;
            if (link && link->link == link_id::xbee) return *link;
        }
        return std::nullopt;
    };
    std::optional<link_status> last;
    REQUIRE(it.until([&] { return (last = parsed()).has_value(); }));
    CHECK(last->rssi_dbm == 0);
    asked answer;
    command(it, set_mode(9, sailing_mode::hold), 30s, answer);
    REQUIRE(it.until([&] { return answer.has_value(); }));
    REQUIRE(it.until([&] { return (last = parsed()) && last->rssi_dbm != 0; }));
    CHECK(last->rssi_dbm == Approx(seen.local->rssi_dbm.value()).margin(30)); // as far there as back
    CHECK(last->rssi_dbm < -20);
}

namespace {

using packet_numbers = std::set<std::pair<int, std::uint32_t>>;

// A store of packets, as communication nodes are one, that can refuse.
struct stored {
    packet_numbers packets;
    bool refuses = false;

    void start(sea& it) {
        it.world.host("store").start_process("store", [this](ise::sim::process& here) -> std::shared_ptr<void> {
            auto node = std::make_shared<ise::node>(here, sea::quiet());
            node->start(
                "store",
                [this](ise::component& self) -> ise::task<> {
                    self.provide(services::telemetry_store, [this](const keep_request& request) {
                        if (refuses) throw ise::error(ise::errc::refused, "the disk is full");
                        for (const auto& one : request.packets) packets.emplace(one.boot, one.sequence);
                        return keep_reply();
                    });
                    for (;;) co_await self.sleep(1h);
                },
                sea::listening(7415));
            return node;
        });
    }
};

} // namespace

TEST_CASE("atirma: what the radio loses, and what was in a proxy that died, the boat sends again until it is kept") {
    sea it;
    stored disk;
    disk.start(it);
    it.proxy_options.store_at = "tcp://store:7415";
    it.proxy_process().crash();
    auto& proxy = it.proxy_process().restart();
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return radio_works(seen) && disk.packets.size() > 20; }));
    auto waiting = [&] { return it.boat_component().radio_waiting(); };
    CHECK(it.until([&] { return waiting() < 20; }));
    SECTION("noise") {
        xbee_air_request noise;
        noise.extra_loss = 0.9;
        set_air(it, noise);
        it.world.run_for(3min);
        noise.extra_loss = 0;
        set_air(it, noise);
    }
    SECTION("out of range for a while") {
        switch_link(it, false);
        it.world.run_for(3min);
        CHECK(waiting() > 100);
        switch_link(it, true);
    }
    SECTION("the store refuses") {
        disk.refuses = true;
        it.world.run_for(1min);
        CHECK(waiting() > 50);
        REQUIRE(seen.local->trouble.find("the boat gets no receipts") != std::string::npos);
        disk.refuses = false;
    }
    SECTION("the proxy is killed") {
        proxy.crash();
        it.world.run_for(30s);
        proxy.restart();
    }
    // Everything up to then comes ashore, though the boat goes on sending.
    it.world.run_for(30s);
    auto newest = disk.packets.rbegin()->second;
    CHECK(newest > 100);
    auto whole = [&] {
        auto boot = it.boat().boot();
        for (std::uint32_t i = 0; i < newest; ++i)
            if (!disk.packets.contains({boot, i})) return false;
        return true;
    };
    CHECK(it.until([&] { return whole() && waiting() < 25; }, 20min));
    CHECK(seen.local->receipts_sent > 0);
}

TEST_CASE("atirma: a proxy without a store gives no receipts, and the boat sends nothing twice") {
    sea it;
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return radio_works(seen); }));
    it.world.run_for(5min);
    CHECK(seen.local->receipts_sent == 0);
    CHECK(seen.local->duplicates == 0);
    CHECK(it.boat_component().radio_waiting() > 200);
}
