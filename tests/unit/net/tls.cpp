// TLS over the virtual world: what certificates do and do not let in, on virtual time.
#include <ise/net/connect.hpp>
#include <ise/transport/security.hpp>
#include <ise/transport/tls/identity.hpp>
#include <support/authority.hpp>
#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/sim_parties.hpp>

namespace tls_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;
using ise::errc;
using ise_test::Contains;

namespace {

// Made once: commands take their time.
authority& trusted() {
    static authority made("the trusted one");
    return made;
}
const std::filesystem::path& usual() {
    static auto folder = trusted().issue("usual");
    return folder;
}

// A boat that is called and a shore that calls, each with credentials of its own.
struct sea {
    sim_parties all;
    party* boat = nullptr;
    party* shore = nullptr;
    ise::remote there;

    void give(const std::string& host, const std::filesystem::path& folder, const std::string& more = {}) {
        auto& to = all.world.host(host);
        for (const char* file : {"ca.pem", "certificate.pem", "key.pem"})
            to.write_file(std::string("tls/") + file, read_all(folder / file));
        if (!more.empty()) to.write_file("tls/ca.pem", read_all(folder / "ca.pem") + more);
    }
    void sail(const std::string& at = "tls://boat:7400") {
        ise::security_options with_tls;
        with_tls.tls_folder = "tls";
        boat = &all.add("boat", {}, with_tls);
        shore = &all.add("shore", {}, with_tls);
        boat->provide(helm, [](set_mode asked) { return mode_set{true, asked.mode}; });
        boat->provide(echo, [](blob given) { return given; });
        boat->listen("tls://0.0.0.0:7400");
        there = shore->at(at);
    }
    static ise::task<ise::result<mode_set>> ask(ise::remote at, ise::duration within) {
        set_mode hold{"hold"};
        auto got = co_await at.try_call(helm, hold, within);
        co_return got;
    }
    ise::result<mode_set> call(ise::duration within = 10s) { return all.run(*shore, ask(there, within)); }
    bool warned(const std::string& what) const {
        return std::ranges::any_of(boat->warnings,
                                   [&](const std::string& line) { return line.find(what) != std::string::npos; });
    }
    std::string warnings() const {
        std::string text;
        for (const auto& line : boat->warnings) text += line + "\n";
        return text;
    }
    // Nothing comes in, and both sides say why.
    void refused(const std::string& told_shore, const std::string& told_boat) {
        auto before = boat->services->counts().calls_served;
        auto got = call();
        REQUIRE_FALSE(got);
        INFO("boat logged: " << warnings());
        CHECK_THAT(got.error().message(), Contains(told_shore));
        CHECK(warned(told_boat));
        CHECK(boat->services->sessions().empty());
        CHECK(boat->services->counts().calls_served == before);
        all.stop();
    }
};

const std::string refused_ours = "it refused the certificate of this side: ";

} // namespace

TEST_CASE("tls: both sides show a certificate, and messages small and big go both ways") {
    sea at;
    at.give("boat", usual());
    at.give("shore", usual());
    at.all.world.net().between("boat", "shore").latency = 20ms;
    at.all.world.net().between("boat", "shore").loss = 0.02;
    at.sail();
    auto got = at.call();
    REQUIRE(got);
    CHECK(got->reason == "hold");
    auto big = [](ise::remote to) -> ise::task<ise::result<blob>> {
        blob packet;
        packet.content.resize(3 << 20);
        for (std::size_t i = 0; i < packet.content.size(); ++i)
            packet.content[i] = static_cast<std::uint8_t>(i * 31 + (i >> 9));
        auto back = co_await to.try_call(echo, packet, 10min);
        if (back && back->content != packet.content) co_return ise::failure(errc::malformed, "it came back changed");
        co_return back;
    };
    auto echoed = at.all.run(*at.shore, big(at.there));
    INFO((echoed ? std::string() : echoed.error().message()));
    CHECK(echoed);
    CHECK((*at.shore->services->sessions().begin()).second->peer_name().find("tls://") != std::string::npos);
    CHECK(at.all.stop());
    CHECK(at.boat->warnings.empty());
}

TEST_CASE("tls: a certificate that has expired is refused, whoever shows it") {
    auto old = trusted().issue("old", authority::everywhere, {"20170101000000Z", "20170801000000Z"});
    sea at;
    SECTION("the caller") {
        at.give("boat", usual());
        at.give("shore", old);
        at.sail();
        at.refused(refused_ours + "by the clock there it has expired",
                   "its certificate (CN = old) has expired: it was valid until Aug  1 00:00:00 2017 GMT");
    }
    SECTION("the one who is called") {
        at.give("boat", old);
        at.give("shore", usual());
        at.sail();
        at.refused("its certificate (CN = old) has expired", refused_ours + "by the clock there it has expired");
    }
}

TEST_CASE("tls: a certificate that expires while sessions last lets no new one be made") {
    sea at;
    at.give("boat", usual());
    at.give("shore",
            trusted().issue("short", authority::everywhere, {"20170101000000Z", "20170904090000Z"})); // an hour
    at.sail();
    REQUIRE(at.call());
    at.all.world.run_for(2h);
    CHECK(at.call()); // the session goes on
    at.shore->services->sessions().begin()->second->wire().close(ise::failure(errc::peer_lost, "cut"));
    at.refused(refused_ours + "by the clock there it has expired", "its certificate (CN = short) has expired");
}

TEST_CASE("tls: a certificate that is not valid yet is refused") {
    sea at;
    at.give("boat", usual());
    at.give("shore", trusted().issue("early", authority::everywhere, {"20180101000000Z", "20990101000000Z"}));
    at.sail();
    at.refused("or not valid yet by the clock there",
               "its certificate (CN = early) is not valid before Jan  1 00:00:00 2018 GMT: is the clock right?");
}

TEST_CASE("tls: a certificate that was revoked is refused, whoever shows it, and others are not") {
    authority own("with a list");
    auto good = own.issue("good"), lost = own.issue("lost");
    own.revoke("lost");
    auto list = own.list();
    sea at;
    SECTION("the caller") {
        at.give("boat", good, list);
        at.give("shore", lost);
        at.sail();
        at.refused(refused_ours + "it was revoked", "its certificate (CN = lost) was revoked");
    }
    SECTION("the one who is called") {
        at.give("boat", lost);
        at.give("shore", good, list);
        at.sail();
        at.refused("its certificate (CN = lost) was revoked", refused_ours + "it was revoked");
    }
    SECTION("nobody") {
        at.give("boat", good, list);
        at.give("shore", own.issue("other"), list);
        at.sail();
        CHECK(at.call());
        CHECK(at.all.stop());
    }
}

TEST_CASE("tls: a file of authorities that is damaged anywhere is not used, also when it was never read before") {
    authority own("with a list that is cut");
    auto good = own.issue("good");
    auto whole = own.list(), cut = whole.substr(0, whole.size() - 60), damaged = whole;
    damaged[damaged.size() / 2] = '#';
    for (const auto& lists : {cut, damaged, cut + "\n" + whole}) {
        CAPTURE(lists);
        sea at;
        at.give("boat", good, lists);
        ise::security_options with_tls;
        with_tls.tls_folder = "tls";
        const auto loaded = ise::security::load(at.all.world.host("boat").start_process("boat"), with_tls);
        REQUIRE_FALSE(loaded);
        CHECK_THAT(loaded.error().message(), Contains("tls/ca.pem cannot be used"));
    }
}

TEST_CASE("tls: what is revoked while it runs is not let in again, and a list that is gone or old lets nobody in") {
    authority own("that changes");
    auto good = own.issue("good"), lost = own.issue("lost");
    auto nobody = own.list({"20170101000000Z", "20170904120000Z"}); // four hours
    sea at;
    at.give("boat", good, nobody);
    at.give("shore", lost);
    at.sail();
    REQUIRE(at.call());
    auto cut = [&] {
        at.shore->services->sessions().begin()->second->wire().close(ise::failure(errc::peer_lost, "cut"));
    };
    SECTION("revoked") {
        own.revoke("lost");
        at.all.world.host("boat").write_file("tls/ca.pem", own.certificate() + own.list());
        at.all.world.run_for(ise::net::tls::identity::reread_after);
        cut();
        at.refused(refused_ours + "it was revoked", "its certificate (CN = lost) was revoked");
    }
    SECTION("out of date") {
        at.all.world.run_for(5h);
        cut();
        at.refused(refused_ours + "by the clock there it has expired, or the revocation list there is out of date",
                   "cannot be looked up: the revocation list here is out of date");
    }
    SECTION("gone") {
        at.all.world.host("boat").write_file("tls/ca.pem", own.certificate());
        at.all.world.run_for(ise::net::tls::identity::reread_after);
        cut();
        at.refused("tls://boat:7400", "tls/ca.pem cannot be used: it had a revocation list before, and has none now");
    }
    SECTION("half written, and mended") {
        at.all.world.host("boat").write_file("tls/ca.pem", own.certificate().substr(0, 200));
        at.all.world.run_for(ise::net::tls::identity::reread_after);
        cut();
        auto got = at.call();
        REQUIRE_FALSE(got);
        CHECK(at.warned("tls/ca.pem cannot be used: bad end line"));
        at.all.world.host("boat").write_file("tls/ca.pem", own.certificate() + nobody);
        at.all.world.run_for(ise::net::tls::identity::reread_after);
        CHECK(at.call());
        CHECK(at.all.stop());
    }
}

TEST_CASE("tls: a certificate of another authority is refused, whoever shows it") {
    authority stranger("somebody else");
    auto strange = stranger.issue("strange");
    sea at;
    SECTION("the caller") {
        at.give("boat", usual());
        stranger.believe("strange", trusted().certificate()); // it believes the boat
        at.give("shore", strange);
        at.sail();
        at.refused(refused_ours + "it was not issued by an authority that is believed there",
                   "its certificate (CN = strange) was not issued by an authority that is believed here");
    }
    SECTION("the one who is called") {
        stranger.believe("strange", trusted().certificate());
        at.give("boat", strange);
        at.give("shore", usual());
        at.sail();
        at.refused("its certificate (CN = strange) was not issued by an authority that is believed here",
                   refused_ours + "it was not issued by an authority");
    }
    SECTION("an authority of the same name") {
        authority twin("the trusted one");
        auto forged = twin.issue("forged");
        twin.believe("forged", trusted().certificate());
        at.give("boat", usual());
        at.give("shore", forged);
        at.sail();
        at.refused(refused_ours + "it was not issued by an authority that is believed there",
                   "its certificate (CN = forged) was not issued by an authority");
    }
}

TEST_CASE("tls: the certificate has to be for the host that was called, and for this use") {
    sea at;
    at.give("shore", usual());
    SECTION("another name") {
        at.give("boat", trusted().issue("buoy", "DNS:buoy,IP:10.9.9.9"));
        at.sail();
        at.refused("its certificate (CN = buoy) is not for 'boat', but for DNS:buoy, IP Address:10.9.9.9",
                   refused_ours + "it is not for the name or address that was called");
    }
    SECTION("another address") {
        at.give("boat", trusted().issue("elsewhere", "DNS:boat,IP:10.9.9.9"));
        at.sail("tls://10.0.0.2:7400");
        auto address = at.all.world.host("boat").address();
        at.there = at.shore->at("tls://" + address + ":7400");
        at.refused("is not for '" + address + "', but for DNS:boat, IP Address:10.9.9.9", refused_ours);
    }
    SECTION("its address") {
        at.give("boat", trusted().issue("here", "IP:10.0.0.1,IP:10.0.0.2"));
        at.sail("tls://" + at.all.world.host("boat").address() + ":7400");
        CHECK(at.call());
        CHECK(at.all.stop());
    }
    SECTION("a server's certificate shown by a caller") {
        at.give("boat", usual());
        at.give("shore", trusted().issue("server", authority::everywhere, {}, "serverAuth"));
        at.sail();
        at.refused(refused_ours + "it may not be used for this",
                   "its certificate (CN = server) may not be used for this");
    }
}

TEST_CASE("tls: who speaks without it is told apart, either way") {
    sea at;
    at.give("boat", usual());
    at.give("shore", usual());
    at.sail();
    SECTION("a caller without") {
        at.there = at.shore->at("tcp://boat:7400");
        at.refused("closed the connection during the handshake", "it speaks without TLS, or something else");
    }
    SECTION("a listener without") {
        at.boat->listen("tcp://0.0.0.0:7401");
        at.there = at.shore->at("tls://boat:7401");
        at.refused("tls://boat:7401", "received TLS on an endpoint without TLS");
    }
}

TEST_CASE("tls: a node without certificates says what it takes") {
    sim_parties all;
    auto& bare = all.add("boat");
    auto refused = bare.services->listen(ise::endpoint::parse("tls://0.0.0.0:7400").value());
    REQUIRE_FALSE(refused);
    CHECK(refused.error().code() == errc::invalid_argument);
    CHECK_THAT(refused.error().message(), Contains("takes a certificate of this side") && Contains("--tls"));
    auto got = all.run(bare, sea::ask(bare.at("tls://shore:7400"), 1s));
    REQUIRE_FALSE(got);
    CHECK_THAT(got.error().message(), Contains("takes a certificate of this side"));
}

TEST_CASE("tls: files that cannot be used are named, with what is wrong") {
    ise::sim::world world;
    auto& host = world.host("boat");
    auto& env = host.start_process("boat");
    auto give = [&](const char* file, const std::string& content) {
        host.write_file(std::string("tls/") + file, content);
    };
    auto wrong = [&] {
        auto made = ise::net::tls::identity::load(env, "tls");
        return made ? std::string("nothing") : made.error().message();
    };
    CHECK_THAT(wrong(), Contains("tls/ca.pem"));
    give("ca.pem", trusted().certificate());
    give("certificate.pem", read_all(usual() / "certificate.pem"));
    give("key.pem", read_all(usual() / "key.pem"));
    CHECK(wrong() == "nothing");
    give("key.pem", read_all(trusted().issue("other") / "key.pem"));
    CHECK_THAT(wrong(), Contains("tls/key.pem cannot be used: it does not belong to tls/certificate.pem"));
    give("key.pem", "-----BEGIN PRIVATE KEY-----\nnonsense\n");
    CHECK_THAT(wrong(), Contains("tls/key.pem cannot be used"));
    give("certificate.pem", "nothing of the kind");
    CHECK_THAT(wrong(), Contains("tls/certificate.pem cannot be used: there is no certificate in it"));
    give("ca.pem", "");
    give("certificate.pem", read_all(usual() / "certificate.pem"));
    CHECK_THAT(wrong(), Contains("tls/ca.pem cannot be used") || Contains("tls/key.pem"));
}

TEST_CASE("tls: files that cannot be used are read again at their time, however many sessions are refused meanwhile") {
    using ise::net::tls::identity;
    ise::sim::world world;
    auto& host = world.host("boat");
    auto& env = host.start_process("boat");
    auto give = [&](const std::string& authorities) { host.write_file("tls/ca.pem", authorities); };
    give(trusted().certificate());
    for (const char* file : {"certificate.pem", "key.pem"})
        host.write_file(std::string("tls/") + file, read_all(usual() / file));
    auto with = identity::load(env, "tls").value();
    give("");
    world.run_for(identity::reread_after);
    auto refused = with->context(env);
    REQUIRE_FALSE(refused);
    CHECK_THAT(refused.error().message(), Contains("tls/ca.pem cannot be used"));
    give(trusted().certificate());
    world.run_for(identity::reread_after - 1ms);
    auto unread = with->context(env);
    REQUIRE_FALSE(unread);
    CHECK(unread.error().message() == refused.error().message());
    CHECK_FALSE(with->revoked(env, {}));
    CHECK_FALSE(with->context(env));
    world.run_for(1ms);
    CHECK(with->context(env));
}

TEST_CASE("tls: the connection is cut at every byte of the handshakes, and nothing hangs") {
    auto which = GENERATE(ise::sim::direction::to_server, ise::sim::direction::to_client);
    std::uint64_t cuts_seen = 0;
    for (std::uint64_t place = 0;; ++place) {
        INFO("cut after byte " << place);
        sea at;
        at.give("boat", usual());
        at.give("shore", usual());
        at.sail();
        at.all.world.net().cut("shore", "boat", which, place);
        auto got = at.call(60s); // once more, by itself
        INFO((got ? std::string() : got.error().message()));
        CHECK((got || got.error().executed() == ise::execution::unknown));
        auto cuts = at.all.world.net().cuts();
        if (cuts > 0) CHECK(at.call(60s));
        CHECK(at.all.stop());
        if (cuts == 0) break;
        ++cuts_seen;
    }
    CHECK(cuts_seen > 1000);
}

} // namespace tls_test
