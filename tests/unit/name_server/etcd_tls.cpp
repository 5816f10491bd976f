// The client of etcd over TLS, on the virtual world: a member that answers every request alike.
#include "system.hpp"

#include <ise/name_server/etcd_store.hpp>
#include <ise/transport/security.hpp>
#include <ise/transport/tls/identity.hpp>

#include <asio/buffer.hpp>

#include <support/authority.hpp>

#include <fmt/format.h>

#include <array>
#include <optional>

namespace etcd_tls_test {

using namespace names_test;
using namespace ise_test;
using ise::net::tls::identity;
using ise::net::tls::identity_files;
using ise_test::Contains;

namespace {

constexpr const char* user_and_password = R"({"name":"ise","password":"of the names"})";

authority& trusted() {
    static authority made("the trusted one");
    return made;
}
const std::filesystem::path& usual() {
    static auto folder = trusted().issue("usual");
    return folder;
}

const identity_files everything{"tls/ca.pem", "tls/certificate.pem", "tls/key.pem"};
const identity_files authorities_only{"tls/ca.pem", "", ""};

// The member is on the host boat, its client on shore; each has files of its own.
class member_and_client {
public:
    member_and_client(const std::filesystem::path& of_member, const std::filesystem::path& of_client) {
        give("boat", of_member);
        give("shore", of_client);
        world.host("boat").start_process("etcd", [this](ise::sim::process& env) {
            return lone_program(env, [this](ise::component& self) { return serve(self); });
        });
    }

    ise::result<std::uint64_t> probe(const identity_files& files, const std::string& user = {}) {
        std::optional<ise::result<std::uint64_t>> answer;
        world.host("shore").start_process("names", [&](ise::sim::process& env) {
            return lone_program(env, [&, files, user](ise::component& self) -> ise::task<> {
                ise::etcd_options options;
                options.members = ise::parse_etcd_members("etcds://boat:2379").value();
                options.tls = identity::load(self.env(), files).value();
                options.user = user;
                options.password = "of the names";
                ise::etcd_store store(self.on(), std::move(options));
                auto report = co_await store.probe();
                answer.emplace(std::move(report));
            });
        });
        REQUIRE(world.run_until([&] { return answer.has_value(); }));
        return *answer;
    }

    std::vector<std::string> asked; ///< heads and bodies
    ise::sim::world world{3};

private:
    void give(const std::string& host, const std::filesystem::path& folder) {
        for (const char* file : {"ca.pem", "certificate.pem", "key.pem"})
            world.host(host).write_file(std::string("tls/") + file, read_all(folder / file));
    }
    ise::task<> serve(ise::component& self) {
        auto at = ise::endpoint::parse("tls://0.0.0.0:2379").value();
        ise::security with;
        with.tls = identity::load(self.env(), "tls").value();
        auto listening = at.kind->listen(self.on(), at, std::move(with)).value();
        for (;;) {
            auto [problem, line] = co_await listening->accept();
            if (problem) co_return;
            std::array<char, 4096> room;
            for (;;) { // the requests of a test come in one piece
                auto got = co_await line->read_some(asio::buffer(room));
                if (got.problem) break;
                asked.emplace_back(room.data(), got.bytes);
                const std::string text = R"({"header":{"revision":"7"},"token":"a-token"})";
                auto answer = fmt::format("HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n{}", text.size(), text);
                asio::const_buffer all(answer.data(), answer.size());
                line->try_write(std::span(&all, 1));
            }
        }
    }
};

} // namespace

TEST_CASE("etcd over tls: a member and a client with certificates understand each other, with a password, too") {
    member_and_client both(usual(), usual());
    auto answer = both.probe(everything, "ise");
    INFO((answer ? std::string() : answer.error().message()));
    CHECK(answer);
    REQUIRE(both.asked.size() == 2);
    CHECK_THAT(both.asked[0], Contains("POST /v3/auth/authenticate ") && Contains(user_and_password));
    CHECK_THAT(both.asked[1], Contains("POST /v3/kv/range ") && Contains("Authorization: a-token"));
}

TEST_CASE("etcd over tls: a client without a certificate is told that one is demanded") {
    member_and_client both(usual(), usual());
    auto answer = both.probe(authorities_only);
    REQUIRE_FALSE(answer);
    CHECK_THAT(answer.error().message(), Contains("it demands a certificate, and this side has shown none"));
    CHECK(both.asked.empty());
}

TEST_CASE("etcd over tls: a member is asked nothing unless its certificate is good, and the reason is told") {
    authority stranger("somebody else");
    auto refused = [](const std::filesystem::path& of_member, const std::filesystem::path& of_client,
                      const std::string& why) {
        member_and_client both(of_member, of_client);
        auto answer = both.probe(everything, "ise");
        REQUIRE_FALSE(answer);
        CHECK_THAT(answer.error().message(), Contains("etcd: tls://boat:2379: its certificate") && Contains(why));
        CHECK(both.asked.empty());
    };
    SECTION("of another authority") {
        refused(stranger.issue("strange"), usual(), "not issued by an authority that is believed here (tls/ca.pem)");
    }
    SECTION("for another name") {
        refused(trusted().issue("buoy", "DNS:buoy,IP:10.9.9.9"), usual(), "is not for 'boat', but for DNS:buoy");
    }
    SECTION("expired") {
        refused(trusted().issue("old", authority::everywhere, {"20170101000000Z", "20170801000000Z"}), usual(),
                "has expired");
    }
}

TEST_CASE("etcd over tls: members of a store are all over TLS, or none") {
    auto secured = ise::parse_etcd_members("etcds://a:2379,b:2379").value();
    REQUIRE(secured.size() == 2);
    CHECK(secured[0].text() == "tls://a:2379");
    CHECK(secured[1].text() == "tls://b:2379");
    CHECK(ise::parse_etcd_members("etcd://a:2379").value().front().text() == "tcp://a:2379");
    for (const char* wrong : {"https://a:2379", "etcds://", "etcds://a", "etcds://a:2379,tcp://b:2379"})
        CHECK_FALSE(ise::parse_etcd_members(wrong));
}

} // namespace etcd_tls_test
