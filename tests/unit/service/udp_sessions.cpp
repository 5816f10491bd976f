// Components over datagrams in the virtual world: calls that outlive their session, a peer that moves, strangers.
#include <ise/net/connect.hpp>
#include <ise/transport/udp/port.hpp>
#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/datagram_router.hpp>
#include <support/raw_peer.hpp>
#include <support/sim_parties.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <random>

namespace udp_sessions_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;
using ise::errc;
using ise::execution;
using ise_test::Contains;

namespace {

ise::endpoint at(const std::string& text) { return ise::endpoint::parse(text).value(); }

ise::task<ise::result<mode_set>> try_helm(ise::remote boat, std::string mode, ise::duration limit) {
    set_mode request{std::move(mode)};
    auto got = co_await boat.try_call(helm, request, limit);
    co_return got;
}

ise::service_options quick() {
    ise::service_options made;
    made.accepts.heartbeat_ns = 500'000'000;
    made.first_back_off = 20ms;
    made.max_back_off = 200ms;
    return made;
}

ise::task<> accept_all(ise::listener& at, std::unique_ptr<ise::stream>& into) {
    for (;;) {
        auto came = co_await at.accept();
        if (came.first) co_return;
        into = std::move(came.second);
    }
}

struct outcome {
    int runs = 0;
    std::shared_ptr<started<ise::result<mode_set>>> call;
};

// Calls under a script of faults; each runs at most once, and what was answered ran.
void calls_under_faults(std::uint64_t seed) {
    INFO(fmt::format("seed {}", seed));
    sim_parties sea(seed);
    std::mt19937_64 random(seed);
    auto& between = sea.world.net().between("boat", "shore");
    between.latency = std::chrono::milliseconds(1 + random() % 60);
    between.loss = static_cast<double>(random() % 40) / 100;
    between.duplicate = static_cast<double>(random() % 30) / 100;
    between.reorder = static_cast<double>(random() % 50) / 100;
    auto& boat = sea.add("boat", quick());
    auto& shore = sea.add("shore", quick());
    std::map<std::string, outcome> all;
    boat.provide(helm, [&](set_mode asked) -> ise::task<mode_set> {
        ++all[asked.mode].runs;
        if (asked.mode.back() == '3') co_await ise::sleep_for(boat.on, 3s);
        mode_set answer{true, asked.mode};
        co_return answer;
    });
    auto where = boat.listen("udp://10.0.0.1:7400");
    auto there = shore.at(where);
    for (int round = 0; round < 8; ++round) {
        for (int i = 0; i < 6; ++i) {
            auto name = fmt::format("{}.{}", round, i);
            all[name].call = start(shore.on, try_helm(there, name, 20s));
        }
        auto pause = sea.world.now() + std::chrono::milliseconds(random() % 2000);
        sea.world.run_until([&] { return sea.world.now() >= pause; }, 3s);
        switch (random() % 4) {
            case 0: // a partition that is longer than the peer is taken for alive
                sea.world.net().partition("boat", "shore");
                pause = sea.world.now() + 2500ms;
                sea.world.run_until([&] { return sea.world.now() >= pause; }, 3s);
                sea.world.net().heal("boat", "shore");
                break;
            case 1:
                if (!shore.services->sessions().empty())
                    shore.services->sessions().begin()->second->wire().close(ise::failure(errc::peer_lost, "cut"));
                break;
            case 2:
                if (!boat.services->sessions().empty())
                    boat.services->sessions().begin()->second->wire().close(ise::failure(errc::peer_lost, "cut"));
                break;
            default: break;
        }
    }
    REQUIRE(sea.run_until(
        [&] { return std::all_of(all.begin(), all.end(), [](auto& one) { return one.second.call->done; }); }));
    int answered = 0;
    for (auto& [name, one] : all) {
        INFO(name);
        auto& got = one.call->get();
        CHECK(one.runs <= 1);
        if (got) {
            ++answered;
            CHECK(one.runs == 1);
            CHECK(got->reason == name);
        } else if (got.error().executed() == execution::not_executed) {
            INFO(got.error().message());
            CHECK(one.runs == 0);
        }
    }
    CHECK(answered > 0);
    CHECK(sea.stop());
}

} // namespace

TEST_CASE("over a rough way and lost sessions every call runs at most once, for every seed") {
    for (std::uint64_t seed = 1; seed <= 40; ++seed) calls_under_faults(seed);
}

TEST_CASE("a call whose session is lost while it runs is answered on the next one, having run once") {
    sim_parties sea;
    auto& boat = sea.add("boat", quick());
    auto& shore = sea.add("shore", quick());
    int runs = 0;
    boat.provide(helm, [&](set_mode) -> ise::task<mode_set> {
        ++runs;
        co_await ise::sleep_for(boat.on, 5s);
        mode_set answer{true, "done"};
        co_return answer;
    });
    auto where = boat.listen("udp://10.0.0.1:7400");
    auto call = start(shore.on, try_helm(shore.at(where), "x", 60s));
    REQUIRE(sea.run_until([&] { return runs == 1; }));
    shore.services->sessions().begin()->second->wire().close(ise::failure(errc::peer_lost, "cut"));
    REQUIRE(sea.run_until([&] { return call->done; }));
    REQUIRE(call->get());
    CHECK(call->get()->reason == "done");
    CHECK(runs == 1);
}

TEST_CASE("a call that may have run and finds no room on the next session says so") {
    sim_parties sea;
    auto& boat = sea.add("boat", quick());
    auto crowded = quick();
    crowded.session_bytes = 50'000;
    auto& shore = sea.add("shore", crowded);
    int runs = 0;
    boat.provide(helm, [&](set_mode) -> ise::task<mode_set> {
        ++runs;
        co_await ise::sleep_for(boat.on, 1h);
        co_return mode_set{};
    });
    auto there = shore.at(boat.listen("udp://10.0.0.1:7400"));
    std::vector<std::shared_ptr<started<ise::result<mode_set>>>> calls;
    for (int n = 1; n <= 3; ++n) { // each has left before the next comes
        calls.push_back(start(shore.on, try_helm(there, std::string(40'000, 'x'), 30min)));
        REQUIRE(sea.run_until([&] { return runs == n; }));
    }
    shore.services->sessions().begin()->second->wire().close(ise::failure(errc::peer_lost, "cut"));
    REQUIRE(sea.run_until([&] { return std::ranges::any_of(calls, &started<ise::result<mode_set>>::done); }));
    for (const auto& call : calls) {
        if (!call->done) continue;
        REQUIRE_FALSE(call->get());
        CHECK(call->get().error().code() == errc::overloaded);
        CHECK_THAT(call->get().error().message(), Contains("(session_bytes)"));
        CHECK(call->get().error().executed() == execution::unknown);
    }
}

TEST_CASE("a call that is given up after its session was lost is cancelled at the provider, over the next session") {
    sim_parties sea;
    auto& boat = sea.add("boat", quick());
    auto& shore = sea.add("shore", quick());
    int runs = 0, cancelled = 0;
    boat.provide(helm, [&](set_mode) -> ise::task<mode_set> {
        ++runs;
        try {
            co_await ise::sleep_for(boat.on, 1h);
        } catch (const std::exception&) {
            ++cancelled;
            throw;
        }
        co_return mode_set{};
    });
    auto where = boat.listen("udp://10.0.0.1:7400");
    auto call = start(shore.on, try_helm(shore.at(where), "x", 50min));
    REQUIRE(sea.run_until([&] { return runs == 1; }));
    auto lost = shore.services->sessions().begin()->second;
    lost->wire().close(ise::failure(errc::peer_lost, "cut"));
    REQUIRE(sea.run_until(
        [&] { return shore.services->sessions().size() == 1 && shore.services->sessions().begin()->second != lost; }));
    lost.reset();
    auto soon = sea.world.now() + 1s;
    sea.run_until([&] { return sea.world.now() >= soon; });
    CHECK(cancelled == 0);
    call->cancel.emit(asio::cancellation_type::terminal);
    CHECK(sea.run_until([&] { return cancelled == 1; }));
    CHECK(runs == 1);
}

TEST_CASE("what another life of the provider may have executed is not asked of the next") {
    sim_parties sea;
    auto& shore = sea.add("shore", quick());
    auto options = quick();
    auto& host = sea.world.host("boat");
    int runs = 0;
    struct program {
        program(ise::sim::process& process, int& runs, ise::service_options options)
            : boat(process, process.make_loop("main"), "boat", options) {
            boat.provide(helm, [this, &runs](set_mode) -> ise::task<mode_set> {
                ++runs;
                co_await ise::sleep_for(boat.on, 1h);
                co_return mode_set{};
            });
            boat.listen(fmt::format("udp://{}:7400", process.host().address()));
        }
        party boat;
    };
    auto& first = host.start_process(
        "boat", [&](ise::sim::process& process) { return std::make_shared<program>(process, runs, options); });
    auto call = start(shore.on, try_helm(shore.at(fmt::format("udp://{}:7400", host.address())), "x", 60s));
    REQUIRE(sea.run_until([&] { return runs == 1; }));
    first.restart();
    REQUIRE(sea.run_until([&] { return call->done; }));
    REQUIRE_FALSE(call->get());
    CHECK(call->get().error().code() == errc::peer_lost);
    CHECK(call->get().error().executed() == execution::unknown);
    CHECK_THAT(call->get().error().message(), ise_test::Contains("restarted"));
    CHECK(runs == 1);
}

namespace {

// A client that reaches its provider through a router, and has no session yet.
struct behind_router {
    behind_router() {
        boat.provide(helm, [](set_mode asked) { return mode_set{true, asked.mode}; });
    }

    sim_parties sea;
    party& boat = sea.add("boat", quick());
    party& shore = sea.add("shore", quick());
    ise::endpoint where = boat.listen("udp://10.0.0.1:7400");
    datagram_router between{sea.world.host("router").start_process("router"), where};
    ise::remote there = shore.at(fmt::format("udp://{}:9000", sea.world.host("router").address()));
};

// As a peer that breaks a rule behind content that is none: one byte more than its chunks have.
void add_stray_byte(ise::buffer& datagram) {
    auto header = ise::wire::read_header(datagram.view().data());
    if (static_cast<ise::wire::datagram_type>(header.type) != ise::wire::datagram_type::data ||
        datagram.size() >= ise::wire::datagram_bytes)
        return;
    datagram.append(std::uint8_t{0});
    ise::detail::store_little(datagram.data(), header.length + 1);
}

} // namespace

TEST_CASE("a session goes on when a router gives the peer another address") {
    behind_router all;
    auto& [sea, boat, shore, where, between, there] = all;
    auto out = boat.publish(position);
    REQUIRE(sea.run(shore, try_helm(there, "before", 10s)));
    auto session = shore.services->sessions().begin()->first;
    for (int i = 0; i < 5; ++i) {
        between.forget();
        auto got = sea.run(shore, try_helm(there, fmt::format("after {}", i), 10s));
        REQUIRE(got);
        CHECK(got->reason == fmt::format("after {}", i));
    }
    // Also where it is the provider that speaks.
    between.forget();
    auto later = sea.world.now() + 10s;
    sea.run_until([&] { return sea.world.now() >= later; });
    REQUIRE(shore.services->sessions().size() == 1);
    CHECK(shore.services->sessions().begin()->first == session);
    CHECK(boat.services->counts().sessions_accepted == 1);
    sea.stop();
    between.stop(sea.world);
}

TEST_CASE("an address that never answers gets nothing but the question, and the session goes on where it was") {
    behind_router all;
    auto& [sea, boat, shore, where, between, there] = all;
    REQUIRE(sea.run(shore, try_helm(there, "before", 10s)));

    auto& thief = sea.world.host("thief").start_process("thief");
    auto host = thief.make_loop("main");
    auto socket = std::move(thief.open_datagram(host->loop(), at("udp://0.0.0.0:5000")).value());
    std::size_t count = 0, longest = 0;
    ise::task_scope scope(host->loop(), [](const std::string&, std::exception_ptr) {});
    auto listen = [](ise::datagram_socket& to, std::size_t& datagrams, std::size_t& most) -> ise::task<> {
        for (;;) {
            auto came = co_await to.receive();
            if (came.first) co_return;
            ++datagrams;
            most = std::max(most, came.second->content.size());
        }
    };
    scope.spawn("thief", listen(*socket, count, longest));
    ise::bytes stolen;
    between.on_question = [&](ise::buffer& datagram) {
        auto type = static_cast<ise::wire::datagram_type>(ise::wire::read_header(datagram.data()).type);
        if (!stolen.empty() || type != ise::wire::datagram_type::data) return;
        stolen = datagram.to_bytes();
        datagram.clear();
    };
    for (int i = 0; i < 20; ++i) {
        stolen.clear();
        auto call = start(shore.on, try_helm(there, std::string(3000, 'x'), 10s));
        REQUIRE(sea.run_until([&] { return !stolen.empty(); }));
        socket->try_send(where, stolen); // from elsewhere, and before it comes again from where it should
        REQUIRE(sea.run_until([&] { return call->done; }));
        CHECK(call->get());
    }
    CHECK(count >= 20);
    CHECK(longest <= 64);
    CHECK(boat.services->counts().sessions_accepted == 1);
    sea.stop();
    between.stop(sea.world);
    scope.stop();
    sea.run_until([&] { return scope.size() == 0; });
    socket.reset();
}

TEST_CASE("datagrams that break a rule behind their content harm nothing, and what they brought comes again") {
    behind_router all;
    auto& [sea, boat, shore, where, between, there] = all;
    REQUIRE(sea.run(shore, try_helm(there, "greets", 10s)));
    unsigned count = 0, spoiled = 0;
    between.on_answer = [&](ise::buffer& datagram) {
        if (++count % 3 != 0) return;
        const auto before = datagram.size();
        add_stray_byte(datagram);
        spoiled += datagram.size() > before;
    };
    for (std::size_t i = 1; i <= 60; ++i) {
        std::string words(700 * i, static_cast<char>('a' + i % 26)); // frames of several datagrams
        auto got = sea.run(shore, try_helm(there, words, 10s));
        REQUIRE(got);
        CHECK(got->reason == words);
    }
    CHECK(spoiled > 20);
    CHECK(boat.services->counts().sessions_accepted == 1);
    sea.stop();
    between.stop(sea.world);
}

TEST_CASE("answers that come late, for a peer that pings and acks nothing, are bounded by session_bytes") {
    sim_parties sea;
    auto narrow = quick();
    narrow.session_bytes = 1 << 20;
    auto patient = quick();
    patient.accepts.heartbeat_ns = 3'600'000'000'000;
    auto& boat = sea.add("boat", narrow);
    auto& shore = sea.add("shore", patient);
    int runs = 0;
    boat.provide(echo, [&](blob) -> ise::task<blob> {
        ++runs;
        co_await ise::sleep_for(boat.on, 1s);
        blob answer;
        answer.content.resize(100'000);
        co_return answer;
    });
    auto where = boat.listen("udp://10.0.0.1:7400");
    datagram_router between(sea.world.host("router").start_process("router"), where);
    auto there = shore.at(fmt::format("udp://{}:9000", sea.world.host("router").address()));
    auto ask = [](ise::remote from) -> ise::task<ise::result<blob>> {
        blob little;
        auto got = co_await from.try_call(echo, little, 10min);
        co_return got;
    };
    std::vector<std::shared_ptr<started<ise::result<blob>>>> calls;
    for (int i = 0; i < 60; ++i) calls.push_back(start(shore.on, ask(there)));
    REQUIRE(sea.run_until([&] { return runs == 60; }));
    between.on_answer = [](ise::buffer& datagram) { datagram.clear(); };
    sea.world.run_for(5s);
    std::size_t most = 0;
    auto unsent = [&] {
        for (const auto& [at, held] : boat.services->sessions())
            most = std::max(most, at->wire().out().pending_call_bytes());
    };
    REQUIRE(boat.services->sessions().size() == 1);
    unsent();
    CHECK(most > 500'000);
    CHECK(most < narrow.session_bytes + 110'000);
    bool cut = GENERATE(false, true); // then all are asked for again at once
    if (cut) shore.services->sessions().begin()->second->wire().close(ise::failure(errc::peer_lost, "cut"));
    between.on_answer = nullptr;
    REQUIRE(sea.run_until([&] {
        unsent();
        return std::ranges::all_of(calls, &started<ise::result<blob>>::done);
    }));
    CHECK(most < narrow.session_bytes + 110'000);
    int answered = 0, overloaded = 0;
    for (const auto& call : calls) {
        const auto& got = call->get();
        if (got) {
            ++answered;
            CHECK(got->content.size() == 100'000);
            continue;
        }
        INFO(got.error().message());
        CHECK(got.error().executed() == execution::unknown);
        if (got.error().code() != errc::overloaded) continue;
        ++overloaded;
        CHECK_THAT(got.error().message(), ise_test::Contains("session_bytes"));
    }
    CHECK(answered >= 10);
    CHECK(overloaded > 0);
    CHECK(runs == 60);
    sea.stop();
    between.stop(sea.world);
}

TEST_CASE("the calls of a client that has vanished end with its linger, and their places are free") {
    sim_parties sea;
    auto& boat = sea.add("boat", quick());
    auto& shore = sea.add("shore", quick());
    auto& other = sea.add("other", quick());
    int runs = 0, cancelled = 0;
    ise::serve_options one;
    one.concurrent = 1;
    boat.provide(
        helm,
        [&](set_mode asked) -> ise::task<mode_set> {
            mode_set answer{true, asked.mode};
            if (asked.mode == "short") co_return answer;
            ++runs;
            try {
                co_await ise::sleep_for(boat.on, 48h);
            } catch (const std::exception&) {
                ++cancelled;
                throw;
            }
            co_return answer;
        },
        one);
    auto where = boat.listen("udp://10.0.0.1:7400");
    auto call = start(shore.on, try_helm(shore.at(where), "x", 24h));
    REQUIRE(sea.run_until([&] { return runs == 1; }));
    auto waits = start(shore.on, try_helm(shore.at(where), "y", 24h));
    auto service = boat.services->services().find_calls("helm");
    REQUIRE(sea.run_until([&] { return service->waiting() == 1; }));
    sea.world.net().partition("boat", "shore");
    sea.world.run_for(20s);
    CHECK(cancelled == 0);
    bool comes_back = GENERATE(false, true); // and then goes for good
    if (comes_back) {
        sea.world.net().heal("boat", "shore");
        sea.world.run_for(5min);
        CHECK(cancelled == 0);
        CHECK(service->waiting() == 1);
        sea.world.net().partition("boat", "shore");
        sea.world.run_for(20s);
        CHECK(cancelled == 0);
    }
    sea.world.run_for(15s);
    CHECK(cancelled == 1);
    CHECK(runs == 1);
    CHECK(service->running() == 0);
    CHECK(service->waiting() == 0);
    auto got = sea.run(other, try_helm(other.at(where), "short", 5s));
    CHECK(got);
    CHECK(boat.services->sessions().size() == 1); // the one of whoever vanished is gone
    sea.world.net().heal("boat", "shore");
    REQUIRE(sea.run_until([&] { return call->done && waits->done; }));
    for (const auto& result : {call, waits}) {
        REQUIRE_FALSE(result->get());
        CHECK(result->get().error().code() == errc::peer_lost);
        CHECK(result->get().error().executed() == execution::unknown);
        CHECK_THAT(result->get().error().message(), ise_test::Contains("linger"));
    }
    CHECK(runs == 1);
    CHECK(sea.stop());
}

TEST_CASE("strangers cost no memory, get no more than they sent, and do not disturb who is there") {
    sim_parties sea;
    auto& boat = sea.add("boat", quick());
    auto& shore = sea.add("shore", quick());
    boat.provide(helm, [](set_mode asked) { return mode_set{true, asked.mode}; });
    auto where = boat.listen("udp://10.0.0.1:7400");
    auto there = shore.at(where);
    REQUIRE(sea.run(shore, try_helm(there, "x", 10s)));

    auto& stranger = sea.world.host("stranger").start_process("stranger");
    auto host = stranger.make_loop("main");
    auto socket = std::move(stranger.open_datagram(host->loop(), at("udp://0.0.0.0:5000")).value());
    std::size_t sent = 0, answered = 0, longest = 0;
    ise::bytes last;
    ise::task_scope scope(host->loop(), [](const std::string&, std::exception_ptr) {});
    auto listen = [](ise::datagram_socket& to, std::size_t& bytes, std::size_t& most, ise::bytes& kept) -> ise::task<> {
        for (;;) {
            auto came = co_await to.receive();
            if (came.first) co_return;
            bytes += came.second->content.size();
            most = std::max(most, came.second->content.size());
            kept = came.second->content;
        }
    };
    scope.spawn("stranger", listen(*socket, answered, longest, last));
    auto throw_at = [&](const ise::bytes& raw) {
        sent += raw.size();
        socket->try_send(where, raw);
    };
    std::mt19937_64 random(7);
    auto pause = [&] {
        auto then = sea.world.now() + 5ms;
        sea.run_until([&] { return sea.world.now() >= then; });
    };
    for (int i = 0; i < 3000; ++i) { // anything, behind heads that look well
        ise::bytes raw(random() % 1300);
        for (auto& byte : raw) byte = static_cast<std::byte>(random());
        if (raw.size() >= 16 && i % 2) {
            ise::detail::store_little(raw.data(), static_cast<std::uint32_t>(raw.size() - 16));
            ise::detail::store_little(raw.data() + 4, static_cast<std::uint32_t>(4 + random() % 7));
        }
        throw_at(raw);
        if (i % 50 == 0) pause();
    }
    for (std::uint64_t id = 1; id <= 2000; ++id) { // openings with cookies of their own making
        ise::wire::cookie forged;
        for (auto& byte : forged) byte = static_cast<std::uint8_t>(random());
        ise::buffer out;
        ise::wire::put_opening(out, id, id % 2 ? ise::wire::cookie() : forged);
        throw_at(out.to_bytes());
        if (id % 50 == 0) pause();
    }
    pause();
    CHECK(answered > 0);
    CHECK(answered < sent / 10);
    CHECK(longest == 32); // a cookie
    CHECK(boat.services->sessions().size() == 1);
    CHECK(boat.scope.size() == 3); // the listener, and the one session with its reader
    CHECK(sea.run(shore, try_helm(there, "y", 10s)));
    CHECK(boat.services->counts().sessions_accepted == 1);

    // A cookie that was given opens one channel, however often it is shown, and one that says nothing more is left.
    auto given = ise::wire::read_datagram(last);
    REQUIRE(given);
    ise::wire::cookie good;
    std::memcpy(good.data(), given->body.data(), good.size());
    for (int i = 0; i < 100; ++i) {
        ise::buffer out;
        ise::wire::put_opening(out, given->id, good);
        throw_at(out.to_bytes());
    }
    pause();
    CHECK(boat.scope.size() == 4);
    auto later = sea.world.now() + 6s;
    sea.run_until([&] { return sea.world.now() >= later; });
    CHECK(boat.scope.size() == 3);
    scope.stop();
    sea.run_until([&] { return scope.size() == 0; });
    socket.reset();
}

TEST_CASE("what comes with the welcome is taken with it, over datagrams as over a stream") {
    const auto scheme = GENERATE(as<std::string>(), "tcp", "udp");
    INFO(scheme);
    const bool leaves = GENERATE(false, true);
    sim_parties all;
    auto& shore = all.add("shore");
    all.world.net().between("shore", "sea").latency = 300ms;
    auto host = all.world.host("sea").start_process("sea").make_loop("raw");
    auto where = at(scheme + "://0.0.0.0:7400");
    auto ear = where.kind->listen(host->loop(), where, ise::security()).value();
    std::unique_ptr<ise::stream> line;
    auto accepting = start(host->loop(), accept_all(*ear, line));
    auto calling = start(shore.on, try_helm(shore.at(scheme + "://sea:7400"), "hold", 5s));
    REQUIRE(all.run_until([&] { return line != nullptr; }));
    raw_peer peer(all, std::move(host), std::move(line));
    REQUIRE(all.run_until([&] { return peer.count(ise::wire::frame_type::hello) == 1; }));

    ise::wire::welcome welcome;
    welcome.self.incarnation = 1;
    ise::buffer together;
    auto put = [&](ise::wire::frame_type type, const auto& packet) {
        ise::wire::put_frame(together, type, 0, 0, [&](ise::buffer& body) { encode(packet, body); });
    };
    put(ise::wire::frame_type::welcome, welcome);
    for (int i = 0; i < 5; ++i) ise::wire::put_frame(together, ise::wire::frame_type::pong, 0, 0, [](ise::buffer&) {});
    if (leaves)
        put(ise::wire::frame_type::goodbye,
            ise::wire::farewell{static_cast<std::uint8_t>(errc::overloaded), "no room"});
    peer.say(together.view());
    auto& sessions = shore.services->sessions();
    REQUIRE(all.run_until([&] { return calling->done || !sessions.empty(); }));
    if (leaves) {
        all.world.run_for(1ms);
        CHECK(sessions.empty());
    } else {
        auto made = sessions.begin()->second;
        all.world.run_for(1ms);
        CHECK(made->wire().counts().frames_in == 5);
    }
    shore.scope.stop();
    ear->close();
    all.run_until([&] { return accepting->done && calling->done; });
    line.reset(); // of a further attempt
    ear.reset();  // before the peer, whose loop they are on
}

TEST_CASE("nobody listens there: the call fails in time and says so") {
    sim_parties sea;
    sea.world.host("boat");
    auto& shore = sea.add("shore", quick());
    auto got = sea.run(shore, try_helm(shore.at("udp://boat:7400"), "x", 8s));
    REQUIRE_FALSE(got);
    CHECK(got.error().code() == errc::timed_out);
    CHECK(got.error().executed() == execution::not_executed);
    CHECK_THAT(got.error().message(), ise_test::Contains("udp://boat:7400"));
}

TEST_CASE("any operation may fail, and calls over datagrams end all the same") {
    for (std::uint64_t n = 0;; ++n) {
        INFO(fmt::format("operation {}", n));
        sim_parties sea;
        auto& boat = sea.add("boat", quick());
        auto& shore = sea.add("shore", quick());
        int runs = 0;
        boat.provide(helm, [&](set_mode) { return mode_set{++runs == 1, "ok"}; });
        auto where = boat.listen("udp://10.0.0.1:7400");
        sea.world.faults().fail_at(n);
        auto got = sea.run(shore, try_helm(shore.at(where), "x", 30s));
        bool reached = sea.world.faults().failed();
        sea.world.faults().fail_never();
        INFO((got ? std::string() : got.error().message()));
        CHECK(got);
        CHECK(runs == 1);
        CHECK(sea.stop());
        if (!reached) break;
    }
}

} // namespace udp_sessions_test
