// Nodes with credentials: taken from their options or variables, for every component, and demanded where they are told
// to.
#include "sea.hpp"

#include <ise/core/sleep.hpp>

namespace credentials_test {

using namespace sea;
using ise::errc;
using ise_test::Contains;

namespace {

class sayer final : public ise::component {
    task<> run() override {
        provide(echo, [](question asked) { return reply{asked.text}; });
        co_await sleep(24h);
    }
};

struct port {
    ise::sim::world world;
    log_book log;

    port() {
        for (const char* host : {"boat", "shore"}) {
            world.host(host).write_file("key", std::string(64, 'k'));
            world.host(host).write_file("other", std::string(64, 'x'));
        }
    }
    ise::node_options options() const {
        ise::node_options made;
        made.use_names = false;
        made.log = log.sink();
        return made;
    }
    static ise::component_options listening(const std::string& at) {
        ise::component_options made;
        made.listen = {ise::endpoint::parse(at).value()};
        return made;
    }
    /// What became of a call from a node to tcp://boat:7400.
    ise::result<reply> ask(ise::node& from) {
        auto got = std::make_shared<ise::result<reply>>();
        auto done = std::make_shared<bool>(false);
        ise::component_options silent;
        silent.listens = false;
        from.start(
            "",
            [got, done](ise::component& self) -> task<> {
                auto boat = self.at(ise::endpoint::parse("tcp://boat:7400").value());
                question asked{"ahoy"};
                auto outcome = co_await boat.try_call(echo, asked, 5s);
                *got = std::move(outcome);
                *done = true;
            },
            silent);
        REQUIRE(world.run_until([&] { return *done; }));
        return *got;
    }
};

} // namespace

TEST_CASE("nodes with the same key talk, whether it comes from options or from ISE_KEY, and others are told why not") {
    port at;
    auto& boat_process = at.world.host("boat").start_process("boat");
    boat_process.set_variable("ISE_KEY", "key");
    ise::node boat(boat_process, at.options());
    boat.start<sayer>("boat", port::listening("tcp://0.0.0.0:7400"));
    auto options = at.options();
    auto& process = at.world.host("shore").start_process("shore");
    std::string why, logged;
    SECTION("the same key") { options.security.key_file = "key"; }
    SECTION("another key") {
        options.security.key_file = "other";
        why = "the shared key there is another one";
        logged = "the shared key here is another one";
    }
    SECTION("no key") { why = logged = "a shared key is demanded here, and none was offered"; }
    ise::node shore(process, options);
    auto got = at.ask(shore);
    if (why.empty()) {
        REQUIRE(got);
        CHECK(got->text == "ahoy");
        return;
    }
    REQUIRE_FALSE(got);
    CHECK(got.error().executed() == ise::execution::not_executed);
    CHECK_THAT(got.error().message(), Contains(why));
    CHECK(at.log.has("a session was not made", logged));
}

TEST_CASE("a node with a key calls nobody who cannot prove it") {
    port at;
    ise::node boat(at.world.host("boat").start_process("boat"), at.options());
    boat.start<sayer>("boat", port::listening("tcp://0.0.0.0:7400"));
    auto options = at.options();
    options.security.key_file = "key";
    ise::node shore(at.world.host("shore").start_process("shore"), options);
    auto got = at.ask(shore);
    REQUIRE_FALSE(got);
    CHECK_THAT(got.error().message(), Contains("no shared key is known there"));
}

TEST_CASE("a node over udp asks for the key as well") {
    port at;
    auto options = at.options();
    options.security.key_file = "key";
    ise::node boat(at.world.host("boat").start_process("boat"), options);
    boat.start<sayer>("boat", port::listening("udp://0.0.0.0:7400"));
    bool right = GENERATE(true, false);
    if (!right) options.security.key_file = "other";
    ise::node shore(at.world.host("shore").start_process("shore"), options);
    auto got = std::make_shared<ise::result<reply>>();
    auto done = std::make_shared<bool>(false);
    ise::component_options silent;
    silent.listens = false;
    shore.start(
        "",
        [got, done](ise::component& self) -> task<> {
            auto there = self.at(ise::endpoint::parse("udp://boat:7400").value());
            question asked{"ahoy"};
            auto outcome = co_await there.try_call(echo, asked, 5s);
            *got = std::move(outcome);
            *done = true;
        },
        silent);
    REQUIRE(at.world.run_until([&] { return *done; }));
    CHECK(bool(*got) == right);
    if (!right) CHECK_THAT(got->error().message(), Contains("the shared key there is another one"));
}

TEST_CASE("a node that demands credentials listens beyond its host with them only") {
    port at;
    auto options = at.options();
    options.security.demanded = true;
    auto& process = at.world.host("boat").start_process("boat");
    SECTION("without") {
        ise::node boat(process, options);
        try {
            boat.start<sayer>("boat", port::listening("tcp://0.0.0.0:7400"));
            FAIL("it listens");
        } catch (const ise::error& refused) {
            CHECK(refused.code() == errc::unauthorized);
            CHECK_THAT(refused.what(), Contains("nobody may listen on tcp://0.0.0.0:7400 without credentials"));
        }
        boat.start<sayer>("boat", port::listening("tcp://127.0.0.1:7400"));
    }
    SECTION("by its variable") {
        options.security.demanded = false;
        process.set_variable("ISE_DEMAND_CREDENTIALS", "1");
        ise::node boat(process, options);
        CHECK_THROWS_AS(boat.start<sayer>("boat", port::listening("udp://0.0.0.0:7400")), ise::error);
    }
    SECTION("with a key") {
        options.security.key_file = "key";
        ise::node boat(process, options);
        boat.start<sayer>("boat", port::listening("tcp://0.0.0.0:7400"));
    }
}

TEST_CASE("a node whose credentials cannot be used is not made, and says which file") {
    port at;
    auto& process = at.world.host("boat").start_process("boat");
    auto made = [&](ise::node_options options) {
        try {
            ise::node boat(process, options);
            return std::string("made");
        } catch (const ise::error& refused) {
            return std::string(refused.what());
        }
    };
    auto options = at.options();
    options.security.key_file = "nowhere";
    CHECK_THAT(made(options), Contains("no shared key (--key, ISE_KEY)") && Contains("nowhere"));
    options = at.options();
    options.security.tls_folder = "nowhere";
    CHECK_THAT(made(options), Contains("no TLS (--tls, ISE_TLS)") && Contains("nowhere/ca.pem"));
    process.set_variable("ISE_DEMAND_CREDENTIALS", "yes");
    CHECK_THAT(made(at.options()), Contains("ISE_DEMAND_CREDENTIALS is 0 or 1, not 'yes'"));
}

} // namespace credentials_test
