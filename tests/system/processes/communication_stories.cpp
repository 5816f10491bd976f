// Two communication nodes as processes of their own, with a boat and a radio: killed in turn.
#include "deployment.hpp"

#include <fstream>
#include <iterator>
#include <regex>
#include <set>

using ise_test::Contains;

namespace {

class two_nodes : public deployment {
public:
    two_nodes() {
        run_atirma("air", "xbee-link", {"--shore-port", file("shore"), "--boat-port", file("boat")});
        run_atirma("boat", "boat-simulator", {"--serial", file("boat")});
        run_atirma("xbee", "xbee-proxy", {"--serial", file("shore")});
        run_atirma("one", "communication-node", node("one", "two"));
        auto second = node("two", "one");
        second.push_back("--secondary");
        run_atirma("two", "communication-node", second);
    }
    ise_test::ran set_mode(int id, const std::string& mode) {
        return call("atirma/communication", "telecommand",
                    fmt::format(R"({{"id":{},"command":{{"kind":"set_mode","mode":"{}"}}}})", id, mode),
                    "atirma/operators/ana");
    }
    // Of the packets on that node's disk that it shows.
    std::multiset<std::string> track(const std::string& name) {
        auto result = call("atirma/shore/" + name, "track", R"({"max_packets":1000})");
        INFO(result.err);
        REQUIRE(result.exit_code == 0);
        std::multiset<std::string> made;
        std::regex number(R"re("boot":\d+,"sequence":\d+)re");
        for (std::sregex_iterator at(result.out.begin(), result.out.end(), number), last; at != last; ++at)
            made.insert(at->str());
        return made;
    }
    std::string state(const std::string& name) { return next_of("atirma/shore/" + name, "communication_state"); }

private:
    std::vector<std::string> node(const std::string& name, const std::string& peer) {
        return {"--path", "atirma/shore/" + name, "--peer",  "atirma/shore/" + peer,
                "--file", file(name + ".db"),     "--proxy", "xbee=atirma/shore/xbee"};
    }
};

} // namespace

TEST_CASE(
    "processes: communication nodes are killed in turn, telecommands go on, and both have everything in the end") {
    two_nodes it;
    auto refused = it.set_mode(1, "hold");
    CHECK(refused.exit_code != 0);
    CHECK_THAT(refused.err, Contains("nobody holds the authority"));
    auto nobody = it.call("atirma/communication", "authority", R"({"action":"take"})");
    CHECK(nobody.exit_code != 0); // the next anonymous command is somebody else
    CHECK_THAT(nobody.err, Contains("anonymous@shm") && Contains("--as PATH"));
    auto taken = it.call("atirma/communication", "authority", R"({"action":"take"})", "atirma/operators/ana");
    INFO(taken.err);
    CHECK_THAT(taken.out, Contains(R"("holder":"atirma/operators/ana")"));
    auto other = it.call("atirma/communication", "telecommand", R"({"id":3,"command":{"kind":"tack_now"}})");
    CHECK_THAT(other.err, Contains("atirma/operators/ana holds the authority") && Contains("not anonymous@shm"));
    CHECK_THAT(it.set_mode(2, "hold").out, Contains(R"("state":"acknowledged")"));
    int id = 10;
    for (const char* victim : {"one", "two", "one"}) {
        INFO(victim);
        it.kill(victim);
        ++id;
        auto mode = std::string(id % 2 ? "automatic" : "hold");
        auto result = it.set_mode(id, mode);
        // A call that was written to the node that died is not sent again by itself: the operator asks with the same
        // id.
        auto acknowledged = [&] { return result.out.find(R"("state":"acknowledged")") != std::string::npos; };
        for (int tries = 0; tries < 20 && !acknowledged(); ++tries) result = it.set_mode(id, mode);
        INFO(result.err);
        CHECK_THAT(result.out, Contains(R"("state":"acknowledged")") && Contains(R"("result":"done")"));
        it.run_again(victim);
        REQUIRE(it.until([&] { return it.state(victim).find(R"("serving":true)") != std::string::npos; }));
        REQUIRE(it.until([&] {
            return it.state("one").find(R"("peer_lives":true)") != std::string::npos &&
                   it.state("two").find(R"("peer_lives":true)") != std::string::npos;
        }));
    }
    it.end("boat");
    std::multiset<std::string> one, two;
    REQUIRE(it.until([&] {
        one = it.track("one");
        two = it.track("two");
        return one == two && one.size() >= 20;
    }));
    CHECK(std::set<std::string>(one.begin(), one.end()).size() == one.size()); // none twice
    auto record = it.call("atirma/shore/two", "telecommand_record", "{}");
    for (int known : {2, 11, 12, 13}) CHECK_THAT(record.out, Contains(fmt::format(R"("id":{},)", known)));
    auto check = [&](const std::string& file) { return ise_test::run_program({"atirma", "store", "check", file}); };
    auto running = check(it.file("one.db"));
    CHECK(running.exit_code == 0);
    CHECK_THAT(running.out, Contains("the file is sound"));
    for (const char* name : {"one", "two"}) CHECK(it.end(name).exit_code == 0);
    CHECK(check(it.file("two.db")).exit_code == 0);
    {
        std::fstream disk(it.file("two.db"), std::ios::in | std::ios::out | std::ios::binary);
        std::string content((std::istreambuf_iterator<char>(disk)), std::istreambuf_iterator<char>());
        auto operator_of = content.rfind("atirma/operators/ana");
        REQUIRE(operator_of != std::string::npos);
        disk.clear();
        disk.seekp(static_cast<std::streamoff>(operator_of));
        disk.put('A');
    }
    auto damaged = check(it.file("two.db"));
    CHECK(damaged.exit_code == 1);
    CHECK_THAT(damaged.out, Contains("differ from their checksums") && Contains("the file is damaged"));
    CHECK(check(it.file("no.db")).exit_code == 1);
    CHECK(ise_test::run_program({"atirma", "store", "check"}).exit_code == 2);
}

TEST_CASE(
    "processes: a telecommand is traced from the operator's call through node and proxy to the boat, whose span is "
    "linked by the telecommand's number") {
    two_nodes it;
    REQUIRE(it.until([&] {
        return it.call("atirma/communication", "authority", R"({"action":"take"})", "atirma/operators/ana").exit_code ==
               0;
    }));
    CHECK_THAT(it.set_mode(2, "hold").out, Contains(R"("state":"acknowledged")"));
    const std::vector<std::string> way{"calls 'telecommand' of atirma/shore/xbee",
                                       "atirma/shore/xbee answers 'telecommand'",
                                       "atirma/shore/xbee: set_mode over xbee to the boat", "executes set_mode"};
    const auto drawn = it.trace_of("atirma/operators/ana", "telecommand", way);
    INFO(drawn);
    std::size_t at = drawn.find("atirma/operators/ana calls 'telecommand'");
    REQUIRE(at != std::string::npos);
    for (const auto& step : way) {
        const auto next = drawn.find(step, at);
        CHECK(next != std::string::npos);
        if (next != std::string::npos) at = next;
    }
    CHECK_THAT(drawn, !Contains("is not in these files"));
}
