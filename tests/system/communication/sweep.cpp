// Random faults by seed: whatever dies when, nothing that was acknowledged is missing, nothing is told twice, and the
// epochs that the boat obeys grow.
#include "shore.hpp"

#include <components/boat/random_source.hpp>

#include <support/catch.hpp>

using namespace communication_test;

namespace {

class storm {
public:
    explicit storm(std::uint64_t seed) : it(seed), dice_(seed * 7919) {
        it.start_node(one);
        it.start_node(two);
        REQUIRE(it.until([&] { return it.serves(one) && it.serves(two); }, 30s));
        seen = &it.listen();
        // Of every other seed all packets reach the nodes by replication alone, which nothing else makes up for.
        it.boat.over(link_id::gprs).publishes = seed % 2 == 0;
        if (seed % 2 == 0) it.sends_every_second({link_id::xbee, link_id::gprs});
        else it.sends_every_second({link_id::gprs});
    }
    void blow() {
        switch (dice_.next() % 11) {
            case 0: return cycle(one);
            case 1: return cycle(two);
            case 2: return cut("one", "two");
            case 3: return cut("one", "page");
            case 4: return cut("gprs", "one");
            case 5: return disk(dice_.next() % 2 ? one : two);
            case 6: return flip(dice_.next() % 2 ? link_id::xbee : link_id::gprs);
            case 7: return act(dice_.next() % 2 ? "ana" : "bea");
            case 8: return back_up(dice_.next() % 2 ? one : two);
            case 9: return go_back(dice_.next() % 2 ? one : two);
            default: it.crash("shore/gprs"); it.start_proxy(link_id::gprs);
        }
    }
    void calm() {
        it.world.net().heal_all();
        for (const auto& name : {one, two}) {
            if (full_.erase(name)) it.fill_disk(name, false);
            if (!it.process(name).running()) it.start_node(name);
        }
        for (auto& link : it.boat.links) link.up = true;
    }
    void pass() { it.world.run_for(std::chrono::milliseconds(500 + dice_.next() % 6000)); }

    shore it;
    listener* seen = nullptr;
    std::map<std::uint32_t, telecommand_reply> replies;
    int went_back = 0;

private:
    void cycle(const std::string& name) {
        if (it.process(name).running()) it.crash(name);
        else it.start_node(name);
    }
    void back_up(const std::string& name) {
        if (full_.contains(name)) return;
        it.back_up(name);
        backed_up_.insert(name);
    }
    // A backup is put back, as long as the other node has all that this one loses by it.
    void go_back(const std::string& name) {
        if (!backed_up_.contains(name) || full_.contains(name)) return;
        auto& other = name == one ? two : one;
        for (int i = 0; i < 10 && it.knows_alone(name, other); ++i) it.world.run_for(500ms);
        if (it.process(name).running()) it.crash(name);
        if (!it.knows_alone(name, other)) {
            it.restore(name);
            ++went_back;
        }
        it.start_node(name);
    }
    void cut(const std::string& a, const std::string& b) {
        if (dice_.next() % 2) it.world.net().partition(a, b);
        else it.world.net().heal(a, b);
    }
    void disk(const std::string& name) {
        bool now = !full_.contains(name);
        it.fill_disk(name, now);
        if (now) full_.insert(name);
        else full_.erase(name);
    }
    void flip(link_id link) { it.boat.over(link).up = !it.boat.over(link).up; }
    // Takes the authority by force and sends a command, whatever comes of it.
    void act(const std::string& who) {
        auto id = ++last_id_;
        it.let(who, [this, id](ise::component& self) -> ise::task<> {
            auto there = self.at(std::string(communication_role));
            authority_request force;
            force.action = authority_action::take;
            force.confirmed = true;
            co_await there.try_call(services::authority, force, 5s);
            auto request = adds_waypoint(id, 28.1 + id * 1e-4);
            request.valid_s = 60;
            auto reply = co_await there.try_call(services::telecommand, request, 5s);
            if (reply) replies[id] = *reply;
        });
    }

    random_source dice_;
    std::set<std::string> full_, backed_up_;
    std::uint32_t last_id_ = 100;
};

} // namespace

TEST_CASE("communication: random faults lose nothing that was acknowledged, tell nothing twice, and never lower the "
          "authority") {
    auto seed = GENERATE(range(1u, 17u));
    CAPTURE(seed);
    storm here(seed);
    for (int i = 0; i < 40; ++i) {
        here.blow();
        here.pass();
    }
    static int restored = 0;
    restored += here.went_back;
    if (seed == 16) CHECK(restored > 0);
    here.calm();
    here.it.world.run_for(60s);
    here.it.stop_sending();
    here.it.world.run_for(60s);
    auto& boat = here.it.boat;
    CHECK(boat.acknowledged.size() == boat.sequence); // the boat has nothing left that it waits for
    auto first = here.it.on_disk(one), second = here.it.on_disk(two);
    CHECK(first.size() == boat.sequence);
    CHECK(second.size() == boat.sequence);
    CHECK((first == second));
    CHECK((here.seen->known == first));
    CHECK(here.seen->twice == 0);
    CHECK(std::ranges::is_sorted(boat.epochs));
    for (auto& [id, times] : boat.executed) {
        CAPTURE(id);
        CHECK(times == 1);
    }
    CHECK(here.it.state(one).authority.epoch == here.it.state(two).authority.epoch);
    for (const auto& name : {one, two}) {
        auto state = here.it.state(name);
        CAPTURE(name, state.trouble);
        CHECK(state.serving);
        CHECK(state.held == 0);
        CHECK(state.shown == state.packets);
        CHECK(state.telecommands_open == 0);
    }
    // What an operator was told stays true.
    for (const auto& [id, reply] : here.replies) {
        if (reply.state != telecommand_stage::acknowledged || reply.result != ack_code::done) continue;
        CAPTURE(id);
        CHECK(boat.executed.contains(id));
    }
}
