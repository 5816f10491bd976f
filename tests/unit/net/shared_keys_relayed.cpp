// Somebody without the key between two who have it, who passes on what they say until the session is made: he must not
// get one that he could speak on.
#include <ise/core/inproc_stream.hpp>
#include <ise/naming/services.hpp>
#include <ise/net/relayed.hpp>
#include <ise/sim/world.hpp>
#include <ise/transport/security.hpp>
#include <ise/transport/shared_key.hpp>

#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/real_parties.hpp>
#include <support/relay_kinds.hpp>

#include <fmt/format.h>

namespace shared_keys_relayed_test {

using namespace std::chrono_literals;
using namespace ise_test;
using namespace boat_services;
using ise::errc;
using ise_test::Contains;

namespace {

ise::security with_key(char letter = 'k') {
    ise::security made;
    made.key = ise::shared_key::make(std::string(64, letter), "a test").value();
    return made;
}

ise::endpoint as_endpoint(const std::string& text) { return ise::endpoint::parse(text).value(); }

// On real sockets: a node, an instantiation server, and a port that the node takes for its name server.
struct street {
    street() {
        host.provide(helm, [this](set_mode asked) {
            ++started_processes;
            mode_set done{true, asked.mode};
            return done;
        });
    }
    ~street() {
        if (!between) return;
        between->stop();
        all.run_until([&] { return between->ended(); });
    }
    // Where who dials it is passed on.
    ise::endpoint put_between(const ise::endpoint& there, const std::string& at = "tcp://127.0.0.1:0") {
        between = make_byte_relay(all.env(), all.make_loop(), as_endpoint(at), there);
        return between->where();
    }
    ise::result<mode_set> call(const ise::remote& whom) { return all.run(node, ask(whom)); }
    static ise::task<ise::result<mode_set>> ask(ise::remote whom) {
        set_mode run{"run"};
        auto got = co_await whom.try_call(helm, run, 2s);
        co_return got;
    }
    ise::remote dial(const ise::endpoint& at, std::string_view path) {
        return ise::remote(node.services->link_to(at, std::string(path)));
    }

    real_parties all;
    party& host = all.add("ise/host/shore", {}, with_key());
    party& node = all.add("boat", {}, with_key());
    std::unique_ptr<relay> between;
    int started_processes = 0;
};

} // namespace

TEST_CASE("relayed: a port that a node takes for its name server passes it on to an instantiation server, and nothing "
          "is started") {
    street at;
    auto taken_for_names = at.put_between(at.host.listen("tcp://127.0.0.1:0"));
    auto got = at.call(at.dial(taken_for_names, ise::naming::server_path));
    REQUIRE_FALSE(got);
    INFO(got.error().message());
    CHECK_THAT(got.error().message(),
               Contains("rejected the session") && Contains("it was dialled as " + taken_for_names.text()));
    CHECK(at.started_processes == 0);
    CHECK(at.host.services->counts().sessions_accepted == 0);
    CHECK(at.host.services->counts().sessions_rejected > 0);
    CHECK(at.node.services->sessions().empty());
}

TEST_CASE("relayed: also where the node does not know who is to answer") {
    street at;
    auto somewhere = at.put_between(at.host.listen("tcp://127.0.0.1:0"));
    auto got = at.call(at.node.at(somewhere));
    REQUIRE_FALSE(got);
    CHECK_THAT(got.error().message(), Contains("a third party relays the session"));
    CHECK(at.started_processes == 0);
    CHECK(at.host.services->counts().sessions_accepted == 0);
}

TEST_CASE("relayed: a listener on every address knows at which of them it was reached") {
    street at;
    auto listens = at.host.listen("tcp://0.0.0.0:0");
    listens.host = "127.0.0.1";
    auto direct = at.call(at.dial(listens, "ise/host/shore"));
    INFO((direct ? "" : direct.error().message()));
    CHECK(direct);
    auto another = listens;
    another.host = "127.0.0.2"; // the same listener
    CHECK(at.call(at.dial(another, "ise/host/shore")));
    CHECK(at.started_processes == 2);
    auto passed_on = at.call(at.dial(at.put_between(listens, "tcp://127.0.0.3:0"), "ise/host/shore"));
    CHECK_FALSE(passed_on);
    CHECK(at.started_processes == 2);
}

TEST_CASE("relayed: a local socket is its own, and one that passes on to it is not") {
    street at;
    auto name = fmt::format("@ise-relayed-{:016x}", at.all.env().random());
    auto listens = at.host.listen("local://" + name);
    CHECK(at.call(at.dial(listens, "ise/host/shore")));
    auto passed_on = at.call(at.dial(at.put_between(listens, "local://" + name + "-taken"), "ise/host/shore"));
    REQUIRE_FALSE(passed_on);
    CHECK_THAT(passed_on.error().message(), Contains("a third party relays the session"));
    CHECK(at.started_processes == 1);
}

TEST_CASE("relayed: a tunnel of one's own is named where it ends") {
    street at;
    auto tunnel = at.put_between(at.host.listen("tcp://127.0.0.1:0"));
    at.host.services->acceptor().advertise({tunnel});
    auto got = at.call(at.dial(tunnel, "ise/host/shore"));
    INFO((got ? "" : got.error().message()));
    CHECK(got);
}

TEST_CASE("relayed: another component than the one that was asked for is refused on both sides") {
    street at;
    auto listens = at.host.listen("tcp://127.0.0.1:0");
    auto got = at.call(at.dial(listens, ise::naming::server_path));
    REQUIRE_FALSE(got);
    CHECK_THAT(got.error().message(), Contains("here is 'ise/host/shore', not 'ise/name_server'"));
    CHECK(at.host.services->counts().sessions_accepted == 0);
}

TEST_CASE("relayed: what a hello says of its way, held against where it came in") {
    ise::sim::world world;
    auto& here = world.host("shore").start_process("here");
    ise::wire::hello hello;
    hello.host_key = here.identity().host_key;
    std::vector<ise::endpoint> advertised;
    auto refused = [&](std::vector<std::string> dialled, const std::string& reached) {
        hello.dialled = std::move(dialled);
        return ise::net::objection_to_way(hello, as_endpoint(reached), advertised, here).has_value();
    };
    auto own = world.host("shore").address();
    CHECK_FALSE(refused({}, "tcp://10.9.9.9:7400")); // of an earlier version
    CHECK_FALSE(refused({"tcp://10.9.9.9:7400"}, "tcp://10.9.9.9:7400"));
    CHECK(refused({"tcp://10.9.9.8:7400"}, "tcp://10.9.9.9:7400"));
    CHECK(refused({"tcp://10.9.9.9:7401"}, "tcp://10.9.9.9:7400"));
    CHECK(refused({"udp://10.9.9.9:7400"}, "tcp://10.9.9.9:7400"));
    CHECK(refused({"no endpoint"}, "tcp://10.9.9.9:7400"));

    SECTION("an address has several spellings") {
        CHECK_FALSE(refused({"tcp://10.9.9.9:7400"}, "tcp://[::ffff:10.9.9.9]:7400"));
        CHECK_FALSE(refused({"tcp://[fe80::1]:7400"}, "tcp://[fe80:0:0::1]:7400"));
    }
    SECTION("a name counts only where it is advertised: the address behind it was dialled") {
        CHECK(refused({"tcp://10.9.9.8:7400", "tcp://shore.local:7400"}, "tcp://10.9.9.9:7400"));
        advertised.push_back(as_endpoint("tcp://shore.local:7400"));
        CHECK_FALSE(refused({"tcp://10.9.9.8:7400", "tcp://shore.local:7400"}, "tcp://10.9.9.9:7400"));
        CHECK(refused({"tcp://10.9.9.8:7400", "tcp://boat.local:7400"}, "tcp://10.9.9.9:7400"));
    }
    SECTION("loopback and local sockets are another host's where the host is another") {
        CHECK_FALSE(refused({"tcp://127.0.0.1:7400"}, "tcp://127.0.0.1:7400"));
        CHECK_FALSE(refused({"local://@names"}, "local://@names"));
        CHECK_FALSE(refused({"udp://127.0.0.1:7400"}, "udp://0.0.0.0:7400"));
        hello.host_key = "another";
        CHECK(refused({"tcp://127.0.0.1:7400"}, "tcp://127.0.0.1:7400"));
        CHECK(refused({"tcp://[::1]:7400"}, "tcp://[::1]:7400"));
        CHECK(refused({"local://@names"}, "local://@names"));
        CHECK(refused({"udp://127.0.0.1:7400"}, "udp://0.0.0.0:7400"));
        advertised.push_back(as_endpoint("tcp://127.0.0.1:7400")); // a tunnel from there
        CHECK_FALSE(refused({"tcp://127.0.0.1:7400"}, "tcp://10.9.9.9:7400"));
    }
    SECTION("over udp a listener on every address does not know which was meant, but they are its host's") {
        CHECK_FALSE(refused({"udp://" + own + ":7400"}, "udp://0.0.0.0:7400"));
        CHECK(refused({"udp://10.9.9.8:7400"}, "udp://0.0.0.0:7400"));
    }
    SECTION("nobody between can use it") {
        CHECK_FALSE(refused({"tls://10.9.9.8:7400"}, "tls://10.9.9.9:7400"));
        CHECK_FALSE(refused({"inproc://one"}, "inproc://another"));
    }
}

} // namespace shared_keys_relayed_test
