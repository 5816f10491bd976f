// Who makes way at a listener whose places are all taken, and an accept loop that nothing ends.
#include <ise/net/bounded_acceptor.hpp>

#include <ise/core/inproc_stream.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/sim/world.hpp>

#include <support/catch.hpp>
#include <support/local_sockets.hpp>

#include <asio/error.hpp>

#include <algorithm>
#include <cerrno>
#include <deque>
#include <map>

namespace fair_places_test {

using namespace std::chrono_literals;
using ise::net::fair_places;
using ise::net::host_of;

namespace {

struct entrance {
    explicit entrance(std::size_t most) : places(most) {}
    /// Whether it got a place.
    bool come(const std::string& name, const std::string& host, bool served = false) {
        auto place = places.take("tcp://" + host + ":4000");
        if (!place) return false;
        place->on_displaced([this, name] { lost.push_back(name); });
        if (served) place->serve();
        here[name] = std::move(place);
        return true;
    }
    fair_places places;
    std::vector<std::string> lost;
    std::map<std::string, std::unique_ptr<fair_places::place>> here;
};

/// A listener that fails as it is told to, and then brings connections.
class troubled final : public ise::listener {
public:
    explicit troubled(ise::loop& on) : wake_(on) {}
    ise::task<std::pair<std::error_code, std::unique_ptr<ise::stream>>> accept() override { return next(); }
    void close() override { wake_.resume(); }
    ise::endpoint where() const override { return ise::endpoint::parse("tcp://127.0.0.1:7").value(); }

    std::deque<std::pair<std::error_code, std::unique_ptr<ise::stream>>> coming;

private:
    ise::task<std::pair<std::error_code, std::unique_ptr<ise::stream>>> next() {
        std::pair<std::error_code, std::unique_ptr<ise::stream>> one;
        if (coming.empty()) {
            co_await wake_.wait();
            one.first = asio::error::operation_aborted;
            co_return one;
        }
        one = std::move(coming.front());
        coming.pop_front();
        co_return one;
    }
    ise::waiter<> wake_;
};

} // namespace

TEST_CASE("places: a host is an IPv4 address, the /64 of an IPv6 address, or a local name") {
    CHECK(host_of("tcp://10.0.0.2:40112") == "10.0.0.2");
    CHECK(host_of("udp://10.0.0.2:1") == host_of("tcp://10.0.0.2:2"));
    CHECK(host_of("tcp://[::ffff:10.0.0.2]:5") == "10.0.0.2");
    CHECK(host_of("tcp://[2001:db8:1:2::1]:5") == host_of("tls://[2001:db8:1:2:ffff::9]:6"));
    CHECK(host_of("tcp://[2001:db8:1:2::1]:5") != host_of("tcp://[2001:db8:1:3::1]:5"));
    for (auto own : {"tcp://127.0.0.1:5", "tcp://127.255.3.4:5", "tcp://[::1]:5", "tcp://[::ffff:127.0.0.2]:5"})
        CHECK(host_of(own) == "127.0.0.1");
    CHECK(host_of("tcp://128.0.0.1:5") != "127.0.0.1");
    CHECK(host_of("local:///run/boat.sock") == "local:///run/boat.sock");
    CHECK(host_of("tcp://buoy:5") == "buoy");
    CHECK(host_of("").empty());
}

TEST_CASE("places: of the host with the most places the oldest that waits makes way, and no other host loses any") {
    entrance at(4);
    CHECK(at.come("boat", "10.0.0.1"));
    for (auto name : {"a", "b", "c"}) CHECK(at.come(name, "10.0.0.9"));
    CHECK(at.come("d", "10.0.0.9"));
    CHECK(at.lost == std::vector<std::string>{"a"});
    CHECK(at.come("friend", "10.0.0.2"));
    CHECK(at.lost == std::vector<std::string>{"a", "b"});
    for (int i = 0; i < 100; ++i) CHECK(at.come("crowd" + std::to_string(i), "10.0.0.9"));
    CHECK(std::find(at.lost.begin(), at.lost.end(), "boat") == at.lost.end());
    CHECK(std::find(at.lost.begin(), at.lost.end(), "friend") == at.lost.end());
    CHECK(at.places.taken() == 4);
    CHECK(at.places.displaced() == 102);
}

TEST_CASE("places: one that is served is lost only to a host that has at least two fewer") {
    entrance at(3);
    for (auto name : {"a", "b", "c"}) CHECK(at.come(name, "10.0.0.9", true));
    CHECK_FALSE(at.come("d", "10.0.0.9", true)); // its own host holds them
    CHECK(at.come("x", "10.0.0.1", true));
    CHECK(at.lost == std::vector<std::string>{"a"});
    CHECK_FALSE(at.come("y", "10.0.0.1", true)); // 2 and 1 are fair, and would only change sides
    CHECK(at.places.refused() == 2);
    at.here["b"]->wait();
    CHECK(at.come("z", "10.0.0.9", true)); // that one waits again
    CHECK(at.lost == std::vector<std::string>{"a", "b"});
    at.here.erase("z");
    CHECK(at.come("y", "10.0.0.1"));
    CHECK(at.places.taken() == 3);
}

TEST_CASE("places: of hosts with one place each the oldest that waits makes way") {
    entrance at(3);
    CHECK(at.come("served", "10.0.0.1", true));
    CHECK(at.come("b", "10.0.0.2"));
    CHECK(at.come("c", "10.0.0.3"));
    CHECK(at.come("d", "10.0.0.4"));
    CHECK(at.lost == std::vector<std::string>{"b"});
    at.here["c"]->serve();
    at.here["d"]->serve();
    CHECK_FALSE(at.come("e", "10.0.0.5"));
    CHECK_FALSE(at.places.make_way());
    at.here["served"]->wait();
    CHECK(at.places.make_way());
    CHECK(at.here["served"]->displaced());
    CHECK(at.places.taken() == 2);
}

TEST_CASE("acceptor: what passes does not end it, and out of descriptors whoever waits makes way") {
    std::size_t came = 0;
    std::vector<std::string> reports;
    bool lost = false;
    ise::sim::world world;
    world.host("shore").start_process("channel", [&](ise::sim::process& here) -> std::shared_ptr<void> {
        struct party {
            explicit party(ise::sim::process& of)
                : host(of.make_loop("channel")), scope(host->loop(), [](const auto&, auto) {}) {}
            std::unique_ptr<ise::loop_host> host;
            ise::task_scope scope;
            fair_places places{10};
            std::unique_ptr<fair_places::place> idle;
        };
        auto all = std::make_shared<party>(here);
        auto at = std::make_shared<troubled>(all->host->loop());
        all->idle = all->places.take("tcp://10.0.0.9:1");
        all->idle->on_displaced([&] { lost = true; });
        for (int why : {ECONNABORTED, EPROTO, EPERM, ENOBUFS})
            at->coming.emplace_back(std::error_code(why, std::system_category()), nullptr);
        for (int why : {int{asio::error::no_descriptors}, ENFILE, int{asio::error::no_memory}})
            at->coming.emplace_back(std::error_code(why, asio::error::get_system_category()), nullptr);
        at->coming.emplace_back(std::error_code(),
                                ise::make_inproc_pair(all->host->loop(), all->host->loop(), "test").first);
        all->scope.spawn("accepts", ise::net::accept_each(
                                        all->host->loop(), at, &all->places,
                                        [&](const std::string& what, const std::string&) { reports.push_back(what); },
                                        [&, at](ise::net::admitted who) {
                                            REQUIRE(who.line);
                                            ++came;
                                            at->close();
                                        }));
        return all;
    });
    REQUIRE(world.run_until([&] { return came == 1; }, 1min));
    CHECK(lost);
    REQUIRE(reports.size() == 7);
    CHECK(reports[4].find("new ones wait") != std::string::npos);
    const bool unix_limits = ise_test::has_local_sockets(); // Windows has no ulimit
    CHECK((reports[4].find("ulimit -n") != std::string::npos) == unix_limits);
}

TEST_CASE("acceptor: a socket that was closed while it paused ends it") {
    std::size_t reports = 0;
    bool ended = false;
    ise::sim::world world;
    world.host("shore").start_process("channel", [&](ise::sim::process& here) -> std::shared_ptr<void> {
        struct party {
            explicit party(ise::sim::process& of)
                : host(of.make_loop("channel")), scope(host->loop(), [](const auto&, auto) {}) {}
            std::unique_ptr<ise::loop_host> host;
            ise::task_scope scope;
        };
        auto all = std::make_shared<party>(here);
        auto at = std::make_shared<troubled>(all->host->loop());
        at->coming.emplace_back(std::error_code(ENOMEM, asio::error::get_system_category()), nullptr);
        at->coming.emplace_back(asio::error::bad_descriptor, nullptr); // what Asio answers then
        auto accepts = [](ise::task<> body, bool& result) -> ise::task<> {
            co_await std::move(body);
            result = true;
        };
        auto report = [&](const std::string&, const std::string&) { ++reports; };
        auto loop = ise::net::accept_each(all->host->loop(), at, nullptr, report, [](ise::net::admitted) {});
        all->scope.spawn("accepts", accepts(std::move(loop), ended));
        return all;
    });
    REQUIRE(world.run_until([&] { return ended; }, 1min));
    CHECK(reports == 1);
}

} // namespace fair_places_test
