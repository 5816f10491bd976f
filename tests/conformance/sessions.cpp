// The table "What is guaranteed over which transport" of ise/wire/FORMAT.md, row by row: sessions.
#include "traffic.hpp"

#include <ise/net/connect.hpp>

#include <asio/buffer.hpp>

#include <array>

using namespace conformance;

namespace {

// Says that every path is held by whoever listens at `where`.
struct stale final : ise::resolver {
    ise::endpoint where;
    ise::task<ise::result<ise::resolution>> resolve(std::string path) override {
        ise::resolution found;
        auto& holder = found.members.emplace_back();
        holder.path = path;
        holder.endpoints = {where};
        co_return found;
    }
    ise::task<ise::result<ise::resolution>> resolve_when_present(std::string path, ise::time_point) override {
        return resolve(std::move(path));
    }
    ise::task<std::uint64_t> next_life(std::string, std::uint64_t, ise::time_point) override { co_return 0; }
};

void wrong_peer(pair& at) {
    at.boat.provide(helm, [](set_mode) { return mode_set{}; });
    at.open();
    auto names = std::make_shared<stale>();
    names->where = at.where;
    at.shore.services->use_resolver(names);
    auto right = at.run(try_helm(ise::remote(at.shore.services->link_to(std::string("boat"))), "x", 10s));
    CHECK(right);
    auto way = at.shore.services->link_to(std::string("buoy"));
    auto wrong = start(at.shore.on, try_helm(ise::remote(way), "x", 1h));
    at.run_until([&] { return way->obstacle().find("here is 'boat', not 'buoy'") != std::string::npos; });
    wrong->cancel.emit(asio::cancellation_type::terminal);
    at.run_until([&] { return wrong->done; });
    CHECK(at.boat.services->counts().calls_served == 1);
}

// Greets, and is silent from then on.
ise::task<> greet(pair& at, std::unique_ptr<ise::stream>& held, std::shared_ptr<bool> welcome) {
    auto& on = at.shore.on;
    auto made = co_await ise::net::connect_until(on, at.where, on.now() + 1h, at.shore.services->peers().credentials());
    held = std::move(made.value());
    ise::buffer out;
    ise::wire::hello mine;
    ise::wire::put_frame(out, ise::wire::frame_type::hello, 0, 0, [&](ise::buffer& body) { ise::encode(mine, body); });
    for (asio::const_buffer rest(out.data(), out.size()); rest.size() > 0;) { // a transport may take less than all
        auto wrote = held->try_write(std::span(&rest, 1));
        rest += wrote.bytes;
        if (wrote.problem) co_await held->wait_writable();
    }
    std::array<std::byte, 512> room;
    auto got = co_await held->read_some(asio::buffer(room));
    *welcome = got.bytes > 0;
}

void silent_peer(pair& at) {
    at.open();
    std::unique_ptr<ise::stream> held;
    auto welcome = std::make_shared<bool>(false);
    auto greeted = start(at.shore.on, greet(at, held, welcome));
    at.run_until([&] { return greeted->done && !at.boat.services->sessions().empty(); });
    greeted->get();
    CHECK(*welcome);
    auto silent_since = at.boat.on.now();
    at.run_until([&] { return at.boat.services->sessions().empty(); }); // it does not wait for ever
    auto beats =
        static_cast<double>((at.boat.on.now() - silent_since).count()) / static_cast<double>(at.has.heartbeat_ns);
    INFO(beats << " heartbeats");
    if (at.over.is_virtual()) CHECK((beats > 2.5 && beats < 3.5));
    held.reset();
}

// Each side finds by itself that it hears nothing any more.
void nothing_passes(pair& at) {
    at.boat.provide(helm, [](set_mode) { return mode_set{}; });
    at.open_through_relay();
    REQUIRE(at.run(try_helm(at.there, "x", 10s)));
    auto silent_since = at.boat.on.now();
    at.between->swallow();
    std::map<party*, double> found;
    at.run_until([&] {
        for (auto* one : {&at.boat, &at.shore})
            if (one->services->sessions().empty() && !found.contains(one))
                found[one] = static_cast<double>((one->on.now() - silent_since).count()) /
                             static_cast<double>(at.has.heartbeat_ns);
        return found.size() == 2;
    });
    INFO(found[&at.boat] << " and " << found[&at.shore] << " heartbeats");
    // The last sign came up to one before.
    for (auto& [who, beats] : found)
        if (at.over.is_virtual()) CHECK((beats > 1.5 && beats < 3.5));
    CHECK(at.run(try_helm(at.there, "x", 10min))); // and it goes on over a new session
}

void moving_peer(pair& at) {
    at.boat.provide(helm, [](set_mode asked) { return mode_set{true, asked.mode}; });
    auto out = at.boat.publish(position);
    at.open_through_relay();
    auto got = follow(at.shore, at.there, ise::subscribe_options::keep_last(64));
    at.run_until([&] { return got->subscribed; });
    auto session = at.shore.services->sessions().begin()->second;
    for (int i = 1; i <= 10; ++i) {
        at.between->forget();
        if (i % 2 == 0) { // it is the requester that speaks first from its new address, or the provider to the old one
            auto answer = at.run(try_helm(at.there, std::to_string(i), 1min));
            REQUIRE(answer);
            CHECK(answer->reason == std::to_string(i));
        }
        out(numbered(i));
        at.run_until([&] { return got->last() == i; });
    }
    CHECK(session->open());
    CHECK(at.boat.services->counts().sessions_accepted == 1);
    CHECK(got->counts().resumed == 0);
    got->check_exact();
}

} // namespace

TEMPLATE_TEST_CASE("the wrong peer is refused", "", OVER_EVERY_TRANSPORT) { over<TestType>(wrong_peer); }

TEMPLATE_TEST_CASE("a peer that is half open is found within three heartbeats", "", OVER_EVERY_TRANSPORT) {
    over<TestType>(silent_peer);
}

// Within a process nothing lies between the two that could go silent.
TEMPLATE_TEST_CASE("where nothing passes any more both sides find it within three heartbeats", "", tcp, tcp6, tls, udp,
                   udp6, local, sealed_tcp, sealed_local, virtual_tcp, virtual_tls, virtual_udp) {
    over<TestType>(nothing_passes);
}

// Of streams the table promises nothing here: theirs break (faults.cpp has that), and local and in-process ones have no
// address.
TEMPLATE_TEST_CASE("the session goes on when the peer's address changes", "", OVER_DATAGRAMS) {
    over<TestType>(moving_peer);
}
