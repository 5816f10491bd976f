// TLS as a hostile peer speaks it: handshakes that never finish, certificates without end. Others do not notice.
#include <ise/net/connect.hpp>
#include <ise/transport/security.hpp>

#include <asio/buffer.hpp>

#include <support/authority.hpp>
#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/raw_peer.hpp>

#include <fstream>

namespace tls_strangers_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;
using ise_test::Contains;

namespace {

authority& trusted() {
    static authority made("the trusted one");
    return made;
}

// A boat that is called over TLS, a shore in good order, and the open sea.
struct guarded {
    explicit guarded() : boat(add("boat", usual())), shore(add("shore", usual())) {
        boat.provide(helm, [](set_mode asked) { return mode_set{true, asked.mode}; });
        boat.listen("tls://0.0.0.0:7400");
    }
    static const std::filesystem::path& usual() {
        static auto folder = trusted().issue("usual-of-strangers");
        return folder;
    }
    party& add(const std::string& host, const std::filesystem::path& folder) {
        for (const char* file : {"ca.pem", "certificate.pem", "key.pem"})
            all.world.host(host).write_file(std::string("tls/") + file, read_all(folder / file));
        ise::security_options with;
        with.tls_folder = "tls";
        return all.add(host, {}, with);
    }
    ise::result<mode_set> call(party& from, ise::duration within = 10s) {
        auto ask = [](ise::remote at, ise::duration limit) -> ise::task<ise::result<mode_set>> {
            set_mode hold{"hold"};
            auto got = co_await at.try_call(helm, hold, limit);
            co_return got;
        };
        return all.run(from, ask(from.at("tls://boat:7400"), within));
    }
    void others_do_not_notice() {
        auto got = call(shore, 1s);
        INFO((got ? std::string() : got.error().message()));
        CHECK(got);
    }
    std::string warnings() const {
        std::string text;
        for (const auto& line : boat.warnings) text += line + "\n";
        return text;
    }
    // What a client in good order says first: heard by somebody who only listens.
    ise::bytes client_hello() {
        auto host = sea.make_loop("ear");
        auto ear = sea.listen(host->loop(), ise::endpoint::parse("tcp://0.0.0.0:7400").value()).value();
        ise::bytes heard;
        auto listen = [](ise::listener& at, ise::bytes& into) -> ise::task<> {
            auto came = co_await at.accept();
            into.resize(4096);
            auto got = co_await came.second->read_some(asio::buffer(into));
            into.resize(got.bytes);
        };
        auto hearing = start(host->loop(), listen(*ear, heard));
        auto asking =
            start(shore.on, ise::net::connect_until(shore.on, ise::endpoint::parse("tls://sea:7400").value(),
                                                    shore.on.now() + 1s, shore.services->peers().credentials()));
        all.run_until([&] { return hearing->done && asking->done; });
        return heard;
    }

    sim_parties all;
    party& boat;
    party& shore;
    ise::sim::process& sea = all.world.host("sea").start_process("sea");
    const std::string channel = "tcp://boat:7400";
};

} // namespace

TEST_CASE("tls: strangers whose handshakes never finish hold no place that others need") {
    guarded at;
    auto hello = at.client_hello();
    REQUIRE(hello.size() > 100);
    std::vector<std::unique_ptr<raw_peer>> crowd;
    for (std::size_t i = 0; i < 400; ++i) {
        crowd.push_back(std::make_unique<raw_peer>(at.all, at.sea, at.channel));
        if (i % 4 == 1) crowd.back()->say(hello); // it is answered with a certificate, and waited for
        if (i % 4 == 2) crowd.back()->say(ise::bytes_view(hello).first(hello.size() / 2));
    }
    at.all.world.run_for(10ms);
    at.others_do_not_notice();
    at.all.world.run_for(6s);
    CHECK(std::ranges::all_of(crowd, [](const auto& peer) { return peer->closed(); }));
    INFO(at.warnings());
    CHECK_THAT(at.warnings(), Contains("(max_handshakes)") && Contains("did not greet in time (connect_time)"));
    CHECK(at.boat.warnings.size() < 30);
    CHECK(at.boat.services->sessions().empty());
    at.others_do_not_notice();
}

TEST_CASE("tls: a byte a second is no handshake") {
    guarded at;
    auto hello = at.client_hello();
    raw_peer slow(at.all, at.sea, at.channel);
    std::size_t said = 0;
    while (!slow.closed() && said < hello.size()) {
        slow.say(ise::bytes_view(hello).subspan(said++, 1));
        at.all.world.run_for(1s);
    }
    CHECK(said <= 6);
    CHECK_THAT(at.warnings(), Contains("did not greet in time (connect_time)"));
    at.others_do_not_notice();
}

TEST_CASE("tls: of who goes on talking after its TLS failed no more than max_drained is read") {
    guarded at;
    at.others_do_not_notice();
    at.all.world.run_for(1s);
    const auto at_rest = at.boat.scope.size();
    raw_peer loud(at.all, at.sea, at.channel);
    const ise::bytes noise(1000, std::byte{'x'});
    auto say = [&](int times) {
        for (int i = 0; i < times; ++i) {
            loud.say(noise);
            at.all.world.run_for(10ms);
        }
    };
    say(50);
    CHECK(loud.closed()); // told that it failed, and read yet so that it sees why
    CHECK(at.boat.scope.size() == at_rest + 1);
    say(30);
    CHECK(at.boat.scope.size() == at_rest);
    CHECK_THAT(at.warnings(), Contains("it speaks without TLS, or something else"));
    // Who falls silent is read no longer than its handshake may take.
    raw_peer quiet(at.all, at.sea, at.channel);
    quiet.say(noise);
    at.all.world.run_for(4s);
    CHECK(at.boat.scope.size() == at_rest + 1);
    at.all.world.run_for(2s);
    CHECK(at.boat.scope.size() == at_rest);
    at.others_do_not_notice();
}

TEST_CASE("tls: certificates that are too large, or too long a chain, are refused by the limit's name") {
    guarded at;
    auto folder = trusted().issue("much");
    std::string expected;
    SECTION("large") {
        std::ofstream more(folder / "certificate.pem", std::ios::app);
        for (int i = 0; i < 100; ++i) more << trusted().certificate();
        expected = "more than 32768 bytes of certificates (max_certificates)";
    }
    SECTION("long") {
        folder = trusted().issue_below("much", 7);
        expected = "longer than 5 (max_chain)";
    }
    SECTION("long, but not too long") { folder = trusted().issue_below("much", 3); }
    auto& much = at.add("much", folder);
    auto got = at.call(much, 3s);
    INFO(at.warnings());
    CHECK(got.has_value() == expected.empty());
    if (!expected.empty()) CHECK_THAT(at.warnings(), Contains(expected));
    at.others_do_not_notice();
}

} // namespace tls_strangers_test
