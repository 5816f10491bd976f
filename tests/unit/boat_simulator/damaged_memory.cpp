// A boat's memory that the disk has damaged ends no boat.
#include <components/boat_simulator/boat_memory.hpp>
#include <components/boat_simulator/boat_simulator.hpp>

#include <ise/component/node.hpp>
#include <ise/packet/codec.hpp>
#include <ise/sim/world.hpp>

#include <support/catch.hpp>
#include <support/damaged_file.hpp>

namespace damaged_memory_test {

using namespace atirma;
using namespace std::chrono_literals;
using ise_test::Contains;

namespace {

/// A boat of the virtual world, whose memory is a file.
struct sea {
    sea() : world(1) {}
    void sail(std::chrono::seconds time) {
        auto& process =
            world.host("boat").start_process("boat", [this](ise::sim::process& here) -> std::shared_ptr<void> {
                ise::node_options terms;
                terms.use_names = false;
                terms.log = log.sink();
                ise::component_options nowhere;
                nowhere.listens = false;
                boat_simulator_options options;
                options.port.device.clear();
                options.memory_file = disk.file();
                options.gusts = false;
                auto node = std::make_shared<ise::node>(here, terms);
                node->start<boat_simulator>("atirma/boat", nowhere, options);
                return node;
            });
        world.run_for(time);
        process.crash();
        world.run_for(1s);
    }
    simulator::remembered_boat remembered() {
        auto db = ise::database::open_to_read(disk.file()).value();
        return ise::try_decode<simulator::remembered_boat>(db.query("SELECT state FROM boat").value().at(0).bytes(0))
            .value();
    }
    damaged_file::folder disk{"boat-memory"};
    damaged_file::log_lines log;
    ise::sim::world world;
};

} // namespace

TEST_CASE("a boat whose memory is no database sets it aside, says so, and sails with a new one") {
    sea it;
    damaged_file::write_garbage(it.disk.file());
    it.sail(30s);
    auto aside = it.disk.set_aside();
    REQUIRE(aside.size() == 1);
    CHECK_THAT(it.log.errors, Contains(aside.front()));
    auto before = it.remembered();
    it.sail(30s);
    CHECK(it.remembered().boot == before.boot + 1);
    CHECK(it.disk.set_aside().size() == 1);
}

TEST_CASE("a boat whose memory has a damaged page goes on where it was, with all that can still be read") {
    sea it;
    it.sail(30s);
    auto before = it.remembered();
    ise::bytes broken(100, std::byte{0xab}), kept(100, std::byte{0xcd});
    {
        auto memory = boat_memory::open(it.disk.file()).value();
        for (std::uint32_t i = 1; i <= 100; ++i) memory.put(i, i < 40 || i > 60 ? kept : broken).value();
    }
    damaged_file::overwrite_pages_with(it.disk.file(), broken);
    it.sail(30s);
    auto aside = it.disk.set_aside();
    REQUIRE(aside.size() == 1);
    CHECK_THAT(it.log.errors, Contains(aside.front()));
    CHECK(it.remembered().boot == before.boot + 1);
    auto memory = boat_memory::open(it.disk.file()).value();
    auto packets = memory.take_unacknowledged().value();
    CHECK(packets.size() > 10);
    for (const auto& one : packets) CHECK(one == kept);
}

} // namespace damaged_memory_test
