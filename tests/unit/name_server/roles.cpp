// Roles: several components serve one, and handles to it fail over and come back.
#include "system.hpp"

#include <algorithm>
#include <optional>

namespace roles_test {

using namespace names_test;

namespace {

constexpr std::string_view role = "atirma/gateway";
// For so many seconds.
inline constexpr ise::action<number, number, number> think_over{"think_over"};

// Answers with its own number, and publishes it ten times a second.
class gateway final : public ise::component {
public:
    explicit gateway(std::int64_t own, ise::duration thinks = {}) : own_(own), thinks_(thinks) {}
    int served = 0;

private:
    ise::task<> run() override {
        provide(twice, [this](number) -> ise::task<number> {
            ++served;
            if (thinks_ > ise::duration{}) co_await sleep(thinks_);
            number answer{own_};
            co_return answer;
        });
        provide(think_over, [this](number seconds, ise::progress<number>) -> ise::task<number> {
            co_await sleep(std::chrono::seconds(seconds.value));
            number answer{own_};
            co_return answer;
        });
        auto out = publish(count);
        for (;;) {
            co_await sleep(100ms);
            out(number{own_});
        }
    }
    std::int64_t own_;
    ise::duration thinks_;
};

// A shore side with gateways 1, 2, … of falling priority, and what its client hears from the role.
struct shore {
    explicit shore(int members = 2, ise::role_options way = ise::role_options()) : how(way) {
        for (int i = 1; i <= members; ++i) start_member(i);
        it.world.run_until([&] { return it.holds("shore/gateway" + std::to_string(members)); }, 10s);
    }
    void start_member(int i, ise::duration thinks = {}) {
        auto begin = [this, i, thinks](ise::node& node) {
            auto options = everywhere();
            options.roles[std::string(role)] = 10 * (5 - i);
            nodes[i] = &node;
            gateways[i] = &node.start<gateway>("shore/gateway" + std::to_string(i), options, i, thinks);
        };
        processes[i] = &it.start("host" + std::to_string(i), "gateway", begin);
    }
    // Calls ten times a second.
    void start_caller(ise::duration deadline = 10s) {
        it.start_body("boat", "caller", [this, deadline](ise::component& self) -> ise::task<> {
            auto there = co_await self.find(std::string(role), how, 10s);
            for (;;) {
                auto got = co_await there.try_call(twice, number{1}, deadline);
                if (got) {
                    answers.push_back(got->value);
                } else {
                    failures.push_back(got.error());
                }
                holder = there.holder();
                co_await self.sleep(100ms);
            }
        });
    }
    void start_listener() {
        it.start_body("boat", "listener", [this](ise::component& self) -> ise::task<> {
            auto there = co_await self.find(std::string(role), how, 10s);
            auto packets = co_await there.subscribe(count);
            for (;;) {
                auto packet = co_await packets.next();
                if (!packet) break;
                heard.push_back(packet->value);
                gaps.push_back(packet.lost_before());
            }
            ended = true;
        });
    }
    bool answers_from(std::int64_t who, ise::duration within) {
        return it.world.run_until([&] { return !answers.empty() && answers.back() == who; }, within);
    }
    bool hears(std::int64_t who, ise::duration within) {
        return it.world.run_until([&] { return !heard.empty() && heard.back() == who; }, within);
    }

    names_test::system it;
    ise::role_options how;
    std::map<int, ise::sim::process*> processes;
    std::map<int, ise::node*> nodes;
    std::map<int, gateway*> gateways;
    std::vector<std::int64_t> answers, heard;
    std::vector<std::optional<std::uint64_t>> gaps;
    std::vector<ise::failure> failures;
    std::string holder;
    bool ended = false;
};

} // namespace

TEST_CASE("roles: a handle finds the member of the highest priority that lives") {
    shore at(3);
    at.start_caller();
    REQUIRE(at.answers_from(1, 5s));
    CHECK(at.holder == "shore/gateway1");

    SECTION("it stops") { at.nodes.at(1)->stop(); }
    SECTION("its process crashes") { at.processes.at(1)->crash(); }
    SECTION("its host is gone without a word") { at.it.world.host("host1").crash(); }
    SECTION("it is cut off from its clients") { at.it.world.net().partition("host1", "boat"); }
    SECTION("the name server is away when its process crashes") {
        at.it.server->crash();
        at.it.world.run_for(10s);
        at.processes.at(1)->crash();
    }
    SECTION("the name server's host is gone when the member's host goes") {
        at.it.world.host("ns").crash();
        at.it.world.run_for(10s);
        at.it.world.host("host1").crash();
    }
    CHECK(at.answers_from(2, 15s));
    CHECK(at.holder == "shore/gateway2");
    // Whatever was given up had been written; nothing was refused, nothing ran out of time.
    for (const auto& why : at.failures) {
        CAPTURE(why.message());
        CHECK((why.code() == ise::errc::peer_lost || why.code() == ise::errc::cancelled));
    }
    at.processes.at(2)->crash();
    CHECK(at.answers_from(3, 15s));
}

TEST_CASE(
    "roles: a handle comes back to a better member once it is there for the steady time, or stays if it is told to") {
    bool stay = GENERATE(false, true);
    CAPTURE(stay);
    shore at(2, stay ? ise::role_options::no_failback() : ise::role_options::failback_after(5s));
    at.start_caller();
    at.start_listener();
    REQUIRE(at.answers_from(1, 5s));
    REQUIRE(at.hears(1, 5s));
    at.processes.at(1)->crash();
    REQUIRE(at.answers_from(2, 15s));
    REQUIRE(at.hears(2, 15s));

    REQUIRE(at.it.world.run_until([&] { return !at.it.holds("shore/gateway1"); }, 10s)); // of its former life
    at.start_member(1);
    REQUIRE(at.it.world.run_until([&] { return at.it.holds("shore/gateway1"); }, 10s));
    auto failed = at.failures.size();
    at.it.world.run_for(4900ms);
    CHECK(at.answers.back() == 2);
    at.it.world.run_for(1500ms);
    CHECK(at.answers.back() == (stay ? 2 : 1));
    CHECK(at.heard.back() == (stay ? 2 : 1));
    CHECK(at.failures.size() == failed); // moving costs no call
    CHECK_FALSE(at.ended);
}

TEST_CASE("roles: moving to a better member leaves the calls that run where they are") {
    shore at(0);
    at.start_member(2, 3s);
    REQUIRE(at.it.world.run_until([&] { return at.it.holds("shore/gateway2"); }, 5s));
    at.how = ise::role_options::failback_after(100ms);
    at.start_caller(10s);
    REQUIRE(at.it.world.run_until([&] { return at.gateways.at(2)->served == 1; }, 5s));
    at.start_member(1);
    REQUIRE(at.it.world.run_until([&] { return at.holder == "shore/gateway1"; }, 10s));
    CHECK(at.answers.front() == 2); // it was answered by the one that it was written to
    CHECK(at.failures.empty());
}

TEST_CASE("roles: moving to a better member waits for the end of an action's run") {
    shore at(0);
    at.start_member(2);
    REQUIRE(at.it.world.run_until([&] { return at.it.holds("shore/gateway2"); }, 5s));
    at.how = ise::role_options::failback_after(100ms);
    std::optional<number> outcome;
    std::string holder;
    bool begun = false;
    at.it.start_body("boat", "patient", [&](ise::component& self) -> ise::task<> {
        auto there = co_await self.find(std::string(role), at.how, 10s);
        const number seconds{30};
        auto run = co_await there.start(think_over, seconds);
        begun = true;
        outcome = co_await run.result();
        for (;;) {
            holder = there.holder();
            co_await self.sleep(100ms);
        }
    });
    REQUIRE(at.it.world.run_until([&] { return begun; }, 5s));
    at.start_member(1);
    REQUIRE(at.it.world.run_until([&] { return outcome.has_value(); }, 60s));
    CHECK(outcome->value == 2);
    CHECK(at.it.world.run_until([&] { return holder == "shore/gateway1"; }, 10s));
}

TEST_CASE("roles: a subscription goes on with another member, and the gap is of unknown length") {
    shore at(2);
    at.start_listener();
    REQUIRE(at.hears(1, 5s));
    at.it.world.run_for(1s);
    at.processes.at(1)->crash();
    REQUIRE(at.hears(2, 15s));
    auto first = static_cast<std::size_t>(std::ranges::find(at.heard, 2) - at.heard.begin());
    CHECK(!at.gaps.at(first));
    CHECK(std::ranges::count(at.gaps, std::optional<std::uint64_t>()) == 1);
    CHECK_FALSE(at.ended);
}

TEST_CASE("roles: a link that only broke is made again to the same member, and its subscription resumes exactly") {
    shore at(2);
    at.it.world.net().cut("boat", "host1", ise::sim::direction::to_client, 2500);
    at.start_listener();
    REQUIRE(at.it.world.run_until([&] { return at.it.world.net().cuts() == 1; }, 60s));
    auto before = at.heard.size();
    REQUIRE(before > 3);
    REQUIRE(at.it.world.run_until([&] { return at.heard.size() > before + 20; }, 10s));
    CHECK(std::ranges::count(at.heard, 1) == static_cast<std::ptrdiff_t>(at.heard.size()));
    CHECK(std::ranges::count(at.gaps, std::optional<std::uint64_t>()) == 0);
}

TEST_CASE(
    "roles: a call that was written ends as unknown, one that waits goes to the next member within its deadline") {
    shore at(0);
    at.start_member(1, 5s);
    REQUIRE(at.it.world.run_until([&] { return at.it.holds("shore/gateway1"); }, 5s));
    std::vector<ise::result<number>> outcomes;
    int begun = 0;
    at.it.start_body("boat", "caller", [&](ise::component& self) -> ise::task<> {
        auto there = co_await self.find(std::string(role));
        auto one = [&outcomes](ise::remote who) -> ise::task<> {
            auto got = co_await who.try_call(twice, number{1}, 30s);
            outcomes.push_back(got);
        };
        self.spawn("first", one(there));
        co_await self.sleep(1s);
        ++begun;
        while (begun < 2) co_await self.sleep(10ms);
        self.spawn("second", one(there)); // while there is nobody
        co_await self.sleep(1h);
    });
    REQUIRE(at.it.world.run_until([&] { return begun == 1; }, 5s));
    at.processes.at(1)->crash();
    REQUIRE(at.it.world.run_until([&] { return outcomes.size() == 1; }, 10s));
    REQUIRE_FALSE(outcomes[0]);
    CHECK(outcomes[0].error().code() == ise::errc::peer_lost);
    CHECK(outcomes[0].error().executed() == ise::execution::unknown);
    begun = 2;
    at.it.world.run_for(5s);
    CHECK(outcomes.size() == 1);
    at.start_member(2);
    REQUIRE(at.it.world.run_until([&] { return outcomes.size() == 2; }, 15s));
    REQUIRE(outcomes[1]);
    CHECK(outcomes[1]->value == 2);
}

TEST_CASE("roles: a component takes up and leaves a role while it runs") {
    names_test::system it;
    ise::component* second = nullptr;
    auto serve = [](std::int64_t own, std::int32_t priority) {
        return [own, priority](ise::component& self) -> ise::task<> {
            self.provide(twice, [own](number) {
                number answer{own};
                return answer;
            });
            self.serve_role(std::string(role), priority);
            co_await self.sleep(1h);
        };
    };
    it.start_body("host1", "one", serve(1, 1));
    it.start("host2", "two", [&](ise::node& node) { second = &node.start("test/two", serve(2, 0), everywhere()); });
    std::int64_t last = 0;
    it.start_body("boat", "caller", [&](ise::component& self) -> ise::task<> {
        auto there = co_await self.find(std::string(role), ise::role_options::failback_after(1s), 10s);
        for (;;) {
            auto got = co_await there.try_call(twice, number{1}, 5s);
            if (got) last = got->value;
            co_await self.sleep(50ms);
        }
    });
    REQUIRE(it.world.run_until([&] { return last == 1; }, 5s));
    second->serve_role(std::string(role), 7);
    CHECK(it.world.run_until([&] { return last == 2; }, 3s));
    second->leave_role(std::string(role));
    CHECK(it.world.run_until([&] { return last == 1; }, 3s));
}

TEST_CASE("roles: a name server that restarts forgets no member that its clients know") {
    shore at(3);
    at.start_caller();
    REQUIRE(at.answers_from(1, 5s));
    at.it.world.net().partition("host2", "ns");
    at.it.restart_server(); // it does not know the second for now
    at.it.world.run_for(1s);
    at.processes.at(1)->crash();
    CHECK(at.answers_from(2, 10s));
}

TEST_CASE("roles: nobody serves it") {
    names_test::system it;
    std::optional<ise::errc> found;
    std::optional<ise::failure> called;
    it.start_body("boat", "caller", [&](ise::component& self) -> ise::task<> {
        try {
            co_await self.find(std::string(role), 2s);
        } catch (const ise::error& thrown) {
            found = thrown.code();
        }
        auto got = co_await self.at(std::string(role)).try_call(twice, number{1}, 2s);
        if (!got) called = got.error();
    });
    REQUIRE(it.world.run_until([&] { return called.has_value(); }, 10s));
    CHECK(*found == ise::errc::no_such_name);
    CHECK(called->code() == ise::errc::timed_out);
    CHECK(called->message().find(role) != std::string::npos);
}

TEST_CASE("roles: what can be none is refused where it is written") {
    names_test::system it;
    std::vector<std::string> refused;
    it.start("host1", "one", [&](ise::node& node) {
        for (const std::string wrong : {"", "/gateway", "a b", "shore/gateway"}) {
            auto options = everywhere();
            options.roles[wrong] = 1;
            try {
                node.start<gateway>("shore/gateway", options, 1);
            } catch (const ise::error& thrown) {
                if (thrown.code() == ise::errc::invalid_argument) refused.push_back(wrong);
            }
        }
    });
    CHECK(refused.size() == 4);
}

TEST_CASE("roles: twenty clients follow every loss, whatever the network does") {
    auto seed = GENERATE(range(1u, 5u));
    CAPTURE(seed);
    names_test::system it(true, seed);
    std::map<int, ise::sim::process*> members;
    auto start = [&](int i) {
        members[i] = &it.start("host" + std::to_string(i), "gateway", [i](ise::node& node) {
            auto options = everywhere();
            options.roles[std::string(role)] = -i;
            node.start<gateway>("shore/gateway" + std::to_string(i), options, i);
        });
    };
    for (int i = 1; i <= 3; ++i) start(i);
    std::map<int, std::int64_t> last;
    for (int client = 0; client < 20; ++client) {
        it.start_body("boat" + std::to_string(client), "caller" + std::to_string(client),
                      [&, client](ise::component& self) -> ise::task<> {
                          auto there = self.at(std::string(role));
                          for (;;) {
                              auto got = co_await there.try_call(twice, number{1}, 5s);
                              last[client] = got ? got->value : 0;
                              co_await self.sleep(200ms);
                          }
                      });
        it.world.net().between("boat" + std::to_string(client), "host1").loss = 0.02;
    }
    auto all_at = [&](std::int64_t who) {
        return [&, who] {
            return last.size() == 20 &&
                   std::ranges::all_of(last, [who](const auto& entry) { return entry.second == who; });
        };
    };
    REQUIRE(it.world.run_until(all_at(1), 20s));
    members[1]->crash();
    CHECK(it.world.run_until(all_at(2), 20s));
    it.server->crash();
    it.world.host("host2").crash();
    CHECK(it.world.run_until(all_at(3), 40s));
    it.restart_server();
    start(1);
    CHECK(it.world.run_until(all_at(1), 40s));
}

} // namespace roles_test
