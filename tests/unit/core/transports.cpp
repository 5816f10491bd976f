#include <ise/core/endpoint.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/stream.hpp>
#include <ise/transport/security.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <stdexcept>

using namespace ise;

namespace {

task<result<std::unique_ptr<stream>>> connect_nowhere(loop&, endpoint to, security) {
    co_return failure(errc::unreachable, to.text());
}
result<std::unique_ptr<listener>> listen_nowhere(loop&, const endpoint& at, security) {
    return failure(errc::io_failed, at.text());
}

constinit const transport pigeon{
    .scheme = "pigeon",
    .example = "pigeon://loft",
    .address = address_form::name,
    .rank = 20,
    .same_host = true,
    .connect = connect_nowhere,
    .listen = listen_nowhere,
};

const transport& added_pigeon() {
    static const bool once = (add_transport(pigeon), true);
    static_cast<void>(once);
    return pigeon;
}

} // namespace

TEST_CASE("transports: an endpoint of each is read, and written as it was") {
    added_pigeon();
    for (auto kind : all_transports()) {
        auto made = endpoint::any_of(kind, "unique");
        INFO(made.text());
        CHECK(made.text().starts_with(std::string(kind->scheme) + "://"));
        auto read = endpoint::parse(made.text());
        REQUIRE(read);
        CHECK(*read == made);
        CHECK(within_host(made));
        CHECK(transport_of(made.text()) == &*kind);
        CHECK(kind->connect);
        CHECK(kind->listen);
    }
    CHECK(endpoint::parse("udp://0.0.0.0:7").value().kind == protocol::udp);
    CHECK(endpoint::any_of(protocol::inproc, "x") != endpoint::any_of(protocol::local, "x"));
}

TEST_CASE("transports: what is no endpoint is answered with an example of each scheme") {
    added_pigeon();
    for (auto text : {"7400", "icmp://host:1", "tcp://host", "tcp://:1", "tcp://a:b:1", "tcp://h:65536", "local://",
                      "local://@", "inproc://", "pigeon://"}) {
        INFO(text);
        auto wrong = endpoint::parse(text);
        REQUIRE_FALSE(wrong);
        CHECK(wrong.error().code() == errc::invalid_argument);
        for (auto kind : all_transports())
            CHECK_THAT(wrong.error().message(), ise_test::Contains(std::string(kind->example)));
    }
    CHECK_FALSE(endpoint::parse("local:///" + std::string(200, 'x')));
    CHECK(endpoint::parse("pigeon://" + std::string(200, 'x')));
}

TEST_CASE("transports: an added one is a row like the others") {
    const auto& row = added_pigeon();
    CHECK(find_transport("pigeon") == &row);
    CHECK(find_transport("pige") == nullptr);
    CHECK(transport_of("pigeon://loft") == &row);
    CHECK(transport_of("pigeon") == nullptr);
    CHECK(std::ranges::count(all_transports(), protocol(row)) == 1);
    auto schemes = schemes_between_processes();
    std::erase_if(schemes, [](const std::string& one) { return one == "local" || one == "shm"; }); // not everywhere
    CHECK(schemes == std::vector<std::string>{"tcp", "udp", "tls", "udp+tls", "pigeon"});
    CHECK(within_host(endpoint::parse("pigeon://anywhere").value()));
    CHECK_THROWS_AS(add_transport(row), std::logic_error);
    CHECK_THROWS_AS(add_transport(transports::tcp), std::logic_error);
}
