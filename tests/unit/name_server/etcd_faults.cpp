// The client of etcd on the virtual world, with members that answer late, or with an error.
#include "system.hpp"

#include <ise/core/sleep.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/name_server/etcd_store.hpp>

#include <asio/buffer.hpp>
#include <fmt/format.h>

#include <array>
#include <functional>
#include <map>
#include <optional>

namespace etcd_faults_test {

using namespace names_test;
using ise_test::Contains;

namespace {

using questions = std::function<ise::task<>(ise::etcd_store&, ise::loop&)>;

// Members a and b on hosts of these names; the client is on a host of its own.
class members_and_client {
public:
    members_and_client() {
        for (const char* name : {"a", "b"})
            world.host(name).start_process("etcd", [this, name = std::string(name)](ise::sim::process& env) {
                return lone_program(env, [this, name](ise::component& self) { return serve(self, name); });
            });
    }

    void ask(const questions& all, const std::string& user = {}) {
        bool done = false;
        world.host("client").start_process("names", [&](ise::sim::process& env) {
            return lone_program(env, [&, user](ise::component& self) -> ise::task<> {
                ise::etcd_options options;
                options.members = ise::parse_etcd_members("etcd://a:2379,b:2379").value();
                options.user = user;
                options.password = "of the names";
                ise::etcd_store store(self.on(), std::move(options));
                co_await all(store, self.on());
                done = true;
            });
        });
        REQUIRE(world.run_until([&] { return done; }, 60s));
    }

    std::map<std::string, std::vector<std::string>> asked; ///< heads and bodies, by member
    std::function<ise::duration(const std::string& member, const std::string& question)> takes;
    std::string error; ///< answered instead
    /// Of a member that knows one token at a time: the last that it gave, or none.
    std::optional<std::string> valid_token;
    int log_ins = 0;
    ise::sim::world world{3};

private:
    ise::task<> serve(ise::component& self, std::string name) {
        auto at = ise::endpoint::parse("tcp://0.0.0.0:2379").value();
        auto listening = at.kind->listen(self.on(), at, ise::security()).value();
        for (;;) {
            auto [problem, line] = co_await listening->accept();
            if (problem) co_return;
            self.spawn("connection", answer(self, name, std::move(line)));
        }
    }
    ise::task<> answer(ise::component& self, std::string name, std::unique_ptr<ise::stream> line) {
        std::array<char, 4096> room;
        for (;;) { // the requests of a test come in one piece
            auto got = co_await line->read_some(asio::buffer(room));
            if (got.problem) co_return;
            std::string question(room.data(), got.bytes);
            asked[name].push_back(question);
            const auto late = takes(name, question);
            const bool logs_in = question.find("/auth/authenticate ") != question.npos;
            bool stranger = valid_token && !logs_in && question.find("Authorization: " + *valid_token) == question.npos;
            co_await self.sleep(late);
            if (valid_token && logs_in) valid_token = fmt::format("token-{}", ++log_ins);
            const std::string text =
                stranger        ? R"({"error":"etcdserver: invalid auth token"})"
                : error.empty() ? fmt::format(R"({{"header":{{"revision":"7"}},"token":"{}","result":{{"TTL":"10"}}}})",
                                              valid_token.value_or("a-token"))
                                : error;
            auto reply = fmt::format("HTTP/1.1 {}\r\nContent-Length: {}\r\n\r\n{}",
                                     stranger        ? "401 Unauthorized"
                                     : error.empty() ? "200 OK"
                                                     : "503 Service Unavailable",
                                     text.size(), text);
            asio::const_buffer all(reply.data(), reply.size());
            line->try_write(std::span(&all, 1));
        }
    }
};

} // namespace

TEST_CASE("etcd that is slow: a member that takes 4 s is given up for a question, and renews a lease") {
    members_and_client it;
    it.takes = [](const std::string&, const std::string&) { return 4s; };
    it.ask([](ise::etcd_store& store, ise::loop& on) -> ise::task<> {
        auto began = on.now();
        auto alive = co_await store.probe();
        CHECK(alive.error().code() == ise::errc::timed_out);
        CHECK(on.now() - began < 2s);
        auto kept = co_await store.keep(7, 5s);
        CHECK(kept);
        kept = co_await store.keep(7, 3s);
        CHECK(kept.error().code() == ise::errc::timed_out);
        kept = co_await store.keep(7, 5s);
        CHECK(kept);
    });
    // Renewals stay at a member that is too slow for questions, and go on when it is too slow for them, too.
    REQUIRE(it.asked["a"].size() == 3);
    CHECK_THAT(it.asked["a"][1], Contains("POST /v3/lease/keepalive ") && Contains(R"("ID":"7")"));
    CHECK(it.asked["b"].size() == 1);
}

TEST_CASE("etcd that is slow: renewals go to the member that answers questions in time") {
    members_and_client it;
    it.takes = [](const std::string& member, const std::string&) -> ise::duration { return member == "a" ? 4s : 0s; };
    it.ask([](ise::etcd_store& store, ise::loop& on) -> ise::task<> {
        auto late = co_await store.probe();
        CHECK_FALSE(late);
        auto alive = co_await store.probe();
        CHECK(alive);
        auto began = on.now();
        auto kept = co_await store.keep(7, 5s);
        CHECK(kept);
        CHECK(on.now() - began < 1s);
    });
    CHECK(it.asked["a"].size() == 1);
    CHECK(it.asked["b"].size() == 2);
}

TEST_CASE("etcd that is slow: the token of one member is shown to the next one, without another log-in") {
    members_and_client it;
    it.takes = [](const std::string& member, const std::string& question) -> ise::duration {
        return member == "a" && question.find("kv/range") != question.npos ? 4s : 0s;
    };
    it.ask(
        [](ise::etcd_store& store, ise::loop&) -> ise::task<> {
            auto late = co_await store.probe();
            CHECK_FALSE(late);
            auto alive = co_await store.probe();
            CHECK(alive);
        },
        "ise");
    CHECK(it.asked["a"].size() == 2);
    REQUIRE(it.asked["b"].size() == 1);
    CHECK_THAT(it.asked["b"][0], Contains("POST /v3/kv/range ") && Contains("Authorization: a-token"));
}

namespace {

/// Asks so many times at once; the number of answers.
ise::task<int> ask_at_once(ise::etcd_store& store, ise::loop& on, int times) {
    int answers = 0;
    auto ask = [](ise::etcd_store& of, int& count) -> ise::task<> {
        auto kept = co_await of.keep(7, 5s);
        if (kept) ++count;
    };
    ise::task_scope all(on, [](const std::string&, std::exception_ptr) {});
    for (int n = 0; n != times; ++n) all.spawn("question", ask(store, answers));
    co_await all.join();
    co_return answers;
}

} // namespace

TEST_CASE("etcd with a password: questions that come at once share one log-in, and its failure") {
    members_and_client it;
    it.valid_token = "none";
    it.takes = [](const std::string&, const std::string&) { return 100ms; };
    const bool fails = GENERATE(false, true);
    if (fails) it.error = R"({"error":"etcdserver: no leader"})";
    it.ask(
        [&](ise::etcd_store& store, ise::loop& on) -> ise::task<> {
            int answers = co_await ask_at_once(store, on, 5);
            CHECK(answers == (fails ? 0 : 5));
        },
        "ise");
    CHECK(it.log_ins == 1);
}

TEST_CASE("etcd with a password: a refusal of an older token that comes late leaves the newer one") {
    members_and_client it;
    it.valid_token = "none";
    it.takes = [](const std::string&, const std::string&) { return 0s; };
    it.ask(
        [&](ise::etcd_store& store, ise::loop& on) -> ise::task<> {
            auto first = co_await store.probe();
            CHECK(first);
            it.valid_token = "none"; // as after five minutes
            bool slow = true;
            it.takes = [&slow](const std::string&, const std::string&) -> ise::duration {
                return std::exchange(slow, false) ? 1s : 0s;
            };
            int answers = co_await ask_at_once(store, on, 2);
            CHECK(answers == 2);
        },
        "ise");
    CHECK(it.log_ins == 2);
}

TEST_CASE("etcd that fails: an error is told in its words, also that of a stream") {
    members_and_client it;
    it.takes = [](const std::string&, const std::string&) { return 0s; };
    it.error = GENERATE(R"({"error":"etcdserver: no leader","code":14})",
                        R"({"error":{"grpc_code":14,"http_code":503,"message":"etcdserver: no leader"}})",
                        R"({"error":{"grpc_code":14},"words":"etcdserver: no leader"})", "etcdserver: no leader");
    it.ask([](ise::etcd_store& store, ise::loop&) -> ise::task<> {
        auto kept = co_await store.keep(7, 5s);
        CHECK_THAT(kept.error().message(), Contains("etcdserver: no leader"));
    });
}

} // namespace etcd_faults_test
