// The component on virtual time: its memory, its links without a modem, its clock.
#include <components/boat_simulator/boat_memory.hpp>
#include <components/boat_simulator/boat_simulator.hpp>

#include <ise/component/node.hpp>
#include <ise/sim/world.hpp>

#include <support/catch.hpp>
#include <support/damaged_file.hpp>

#include <array>
#include <fstream>
#include <string>
#include <vector>

namespace component_test {

using namespace atirma;
using namespace std::chrono_literals;

namespace {

/// A boat of the virtual world, whose memory is a file.
struct sea {
    sea() : world(1) {
        options.port.device.clear();
        options.memory_file = disk.file();
        options.gusts = false;
    }
    void start() {
        process = &world.host("boat").start_process("boat", [this](ise::sim::process& here) -> std::shared_ptr<void> {
            ise::node_options terms;
            terms.use_names = false;
            terms.log = log.sink();
            ise::component_options nowhere;
            nowhere.listens = false;
            auto node = std::make_shared<ise::node>(here, terms);
            boat = &node->start<boat_simulator>("atirma/boat", nowhere, options);
            return node;
        });
    }
    void crash() {
        boat = nullptr;
        process->crash();
        world.run_for(1s);
    }
    /// All but its first page, whoever has it open.
    void damage_memory() {
        const std::array<std::string_view, 2> as_it_is{};
        auto other = ise::database::open(disk.file(), as_it_is).value();
        other.execute("UPDATE boat SET one = 1").value(); // so that the boat reads again
        other.query("PRAGMA wal_checkpoint(TRUNCATE)").value();
        std::fstream out(disk.file(), std::ios::in | std::ios::out | std::ios::binary);
        out.seekp(0, std::ios::end);
        auto size = static_cast<std::size_t>(out.tellp());
        out.seekp(4096);
        out << std::string(size - 4096, 'x');
    }
    boat_memory memory() { return boat_memory::open(disk.file()).value(); }

    damaged_file::folder disk{"boat-component"};
    damaged_file::log_lines log;
    ise::sim::world world;
    boat_simulator_options options;
    ise::sim::process* process = nullptr;
    const boat_simulator* boat = nullptr;
};

telecommand clear_list(std::uint32_t id) {
    telecommand made;
    made.id = id;
    made.command = commands::waypoint_clear();
    return made;
}

} // namespace

TEST_CASE("boat simulator: telemetry of the time without a modem is kept, and none is dropped") {
    sea it;
    it.options.port.device = "/dev/no-modem";
    it.start();
    it.world.run_for(20min);
    CHECK(it.boat->radio_waiting() > 1200);
    CHECK(it.boat->boat()->queued(link_id::xbee) == 0);
    it.crash();
    CHECK(it.memory().not_receipted().value().size() > 1200);
}

TEST_CASE("boat simulator: the period of Iridium is the option's, whoever has the authority") {
    sea it;
    {
        simulator::boat_options before;
        simulator::simulated_boat boat(before, simulator::constant_wind({6, 45}));
        auto order = clear_list(1);
        order.authority = 4;
        auto done = boat.execute(order);
        it.memory().keep(boat.remember(), std::span(&done, 1)).value();
    }
    it.options.iridium.port.device = "/dev/no-modem";
    it.options.iridium.period_s = 1200;
    it.start();
    it.world.run_for(10s);
    CHECK(it.boat->boat()->authority() == 4);
    CHECK(it.boat->boat()->telemetry_period_s(link_id::iridium) == 1200);
    CHECK(it.boat->boat()->executed().size() == 1); // nobody has told it anything
}

TEST_CASE("boat simulator: a memory that is damaged while it sails is replaced by one with all telecommands executed") {
    sea it;
    {
        simulator::boat_options before;
        simulator::simulated_boat boat(before, simulator::constant_wind({6, 45}));
        for (std::uint32_t id : {11u, 12u, 13u}) boat.execute(clear_list(id));
        std::vector<acknowledgement> done(boat.executed().begin(), boat.executed().end());
        it.memory().keep(boat.remember(), done).value();
    }
    it.start();
    it.world.run_for(30s);
    CHECK(it.boat->boat()->executed().size() == 3);
    it.damage_memory();
    it.world.run_for(60s);
    CHECK(it.disk.set_aside().size() == 1);
    it.crash();
    auto kept = it.memory().executed().value();
    REQUIRE(kept.size() == 3);
    CHECK(kept.front().id == 11);
    CHECK(kept.back().id == 13);
}

TEST_CASE("boat simulator: its clock follows one that is set forward, and never goes back within a boot") {
    for (double speedup : {1.0, 20.0, 0.1}) {
        sea it;
        it.options.speedup = speedup;
        it.start();
        it.world.run_for(60s);
        auto behind = [&] {
            return std::chrono::duration_cast<std::chrono::milliseconds>(it.process->wall() -
                                                                         it.boat->boat()->clock_now());
        };
        CAPTURE(speedup, behind().count());
        CHECK(behind() <= 1200ms);
        it.process->set_wall_offset(1h);
        it.world.run_for(10s);
        CHECK(behind() >= 0ms);
        CHECK(behind() <= 1200ms);
        it.process->set_wall_offset(0s);
        auto before = it.boat->boat()->clock_now();
        it.world.run_for(10s);
        CHECK(it.boat->boat()->clock_now() - before == 10s);
        it.process->set_wall_offset(1h);
        it.world.run_for(10s);
        CHECK(behind() <= 1200ms);
        CHECK(behind() >= -10ms);
    }
}

TEST_CASE("boat simulator: a clock that no GPS sets follows no other one") {
    sea it;
    it.options.clock_off_s = -300;
    it.start();
    it.world.run_for(60s);
    it.process->set_wall_offset(1h);
    auto before = it.boat->boat()->clock_now();
    it.world.run_for(10s);
    CHECK(it.boat->boat()->clock_now() - before == 10s);
}

} // namespace component_test
