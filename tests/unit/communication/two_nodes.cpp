// Two nodes without proxies, and operators at either of them.
#include "desk.hpp"

#include <components/boat/recall.hpp>
#include <components/communication_node/communication_node.hpp>

#include <ise/database/database.hpp>

#include <deque>

namespace two_nodes_test {

using namespace atirma;
using namespace std::chrono_literals;
using ise_test::Contains;

namespace {

const std::string one = "shore/one", two = "shore/two";

struct nodes {
    nodes() {
        for (const auto& name : {one, two}) {
            auto file = "memory:two-nodes-" + name;
            disks.push_back(std::move(ise::database::open(file, {}).value()));
            auto host = name.substr(name.find('/') + 1);
            processes[name] = &names.start(host, host, [this, name, file](ise::node& node) {
                communication_node_options options;
                options.file = file;
                options.secondary = name == two;
                options.peer = name == two ? one : two;
                made[name] = &node.start<communication_node>(name, names_test::everywhere(), std::move(options));
            });
        }
        REQUIRE(world.run_until([&] { return made[one]->how().peer_lives && made[two]->how().peer_lives; }, 1min));
    }
    using job = std::function<ise::task<>(ise::component&)>;
    /// Something done by an operator, who has the path "test/NAME" and stays connected.
    void let(const std::string& who, job what) {
        auto [desk, fresh] = jobs.try_emplace(who, std::make_shared<std::deque<job>>());
        desk->second->push_back(std::move(what));
        if (!fresh) return;
        names.start_body(who, who, [todo = desk->second](ise::component& self) -> ise::task<> {
            for (;;) {
                while (!todo->empty()) {
                    auto next = std::move(todo->front());
                    todo->pop_front();
                    auto doing = next(self);
                    co_await std::move(doing);
                }
                co_await self.sleep(100ms);
            }
        });
    }
    template <class Contract>
    ise::result<typename Contract::response_type> ask(const std::string& who, const std::string& whom,
                                                      const Contract& service,
                                                      typename Contract::request_type request) {
        std::optional<ise::result<typename Contract::response_type>> answer;
        let(who, [&answer, &service, request, whom](ise::component& self) -> ise::task<> {
            auto there = self.at(whom);
            auto got = co_await there.try_call(service, request, 20s);
            answer = std::move(got);
        });
        REQUIRE(world.run_until([&] { return answer.has_value(); }, 1min));
        return std::move(*answer);
    }
    ise::result<recall_reply> call_back(const std::string& who, const std::string& whom, std::string why = {}) {
        recall_request request;
        request.id = 7;
        request.why = std::move(why);
        return ask(who, whom, services::telecommand_recall, request);
    }

    std::vector<ise::database> disks; // held, as the nodes come and go
    names_test::system names;
    ise::sim::world& world = names.world;
    std::map<std::string, ise::sim::process*> processes;
    std::map<std::string, communication_node*> made;
    std::map<std::string, std::shared_ptr<std::deque<job>>> jobs;
};

} // namespace

TEST_CASE("nodes: a telecommand is called back at either node, whichever has it under way") {
    nodes it;
    telecommand_request ping;
    ping.id = 7;
    ping.command = commands::ping();
    ping.valid_s = 300;
    it.let("ana", [ping](ise::component& self) -> ise::task<> {
        auto there = self.at(one);
        auto got = co_await there.try_call(services::telecommand, ping, 1s);
    });
    REQUIRE(it.world.run_until([&] { return it.made[two]->how().telecommands_open == 1; }, 10s));

    auto stranger = it.call_back("eve", two);
    REQUIRE_FALSE(stranger);
    CHECK(stranger.error().code() == ise::errc::refused);
    CHECK_THAT(stranger.error().message(), Contains("authority"));
    CHECK(it.made[one]->how().telecommands_open == 1);
    SECTION("the node that has it is reached") {
        auto reply = it.call_back("ana", two, "not by ana");
        REQUIRE(reply);
        CHECK(reply->recalled);
        CHECK(reply->text == "called back before it was sent (by test/ana)");
        CHECK(it.made[one]->how().telecommands_open == 0);
        CHECK(it.world.run_until([&] { return it.made[two]->how().telecommands_open == 0; }, 5s));
    }
    SECTION("the node that has it has just died") {
        it.processes[one]->crash();
        auto reply = it.call_back("ana", two);
        if (!reply) { // not taken over yet
            CHECK_THAT(reply.error().message(), Contains("shore/one") && Contains("again"));
            it.world.run_for(10s);
            reply = it.call_back("ana", two);
        }
        REQUIRE(reply);
        CHECK(is_final(reply->state.value()));
    }
}

TEST_CASE("node: the other node's request to call back is not sent on, and needs no operator") {
    node_test::on_a_node([](ise::component& self) -> ise::task<> {
        communication_node_options options;
        options.peer = two;
        node_test::desk it(self, std::make_unique<node_test::dying_store>(), options);
        command_record record;
        record.status.id = 7;
        record.status.asked_by = "ana";
        record.status.asked_at = record.status.at = it.here.clock();
        record.valid_until = it.here.clock() + 300s;
        record.node = two; // as this node knows it
        it.telecommands.know({record});
        recall_request request;
        request.id = 7;
        request.why = std::string(1000, 'x');
        std::string refusal;
        try {
            auto asking = it.telecommands.call_back(request, two);
            (void)co_await std::move(asking);
        } catch (const ise::error& why) {
            refusal = why.what();
        }
        CHECK_THAT(refusal, Contains("it is under way at shore/two, not here"));
        it.telecommands.take_over();
        auto asking = it.telecommands.call_back(request, two);
        auto reply = co_await std::move(asking);
        CHECK(reply.recalled);
        CHECK(reply.text == "called back before it was sent (" + std::string(256, 'x') + ")");
    });
}

} // namespace two_nodes_test
