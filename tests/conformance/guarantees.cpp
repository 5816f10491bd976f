// The table "What is guaranteed over which transport" of ise/wire/FORMAT.md, row by row.
#include <ise/net/connect.hpp>
#include <support/boat_services.hpp>
#include <support/catch.hpp>

#include "transports.hpp"

using namespace boat_services;
using namespace conformance;
using namespace std::chrono_literals;
using ise::errc;
using ise::execution;

namespace {

ise::task<ise::result<mode_set>> try_helm(ise::remote boat, std::string mode, ise::duration limit) {
    set_mode request{std::move(mode)};
    auto got = co_await boat.try_call(helm, request, limit);
    co_return got;
}
ise::task<ise::result<blob>> try_echo(ise::remote boat, std::size_t size) {
    blob big;
    big.content.resize(size);
    for (std::size_t i = 0; i < size; ++i) big.content[i] = static_cast<std::uint8_t>(i * 7);
    auto got = co_await boat.try_call(echo, big, 60s);
    co_return got;
}

// Takes packets until `count` have come or were told lost.
struct reading {
    std::vector<double> packets;
    std::uint64_t lost = 0;
    std::uint64_t resumed = 0;
    bool subscribed = false;
};
ise::task<> read(ise::remote boat, ise::subscribe_options options, std::uint64_t count, std::shared_ptr<reading> into) {
    auto stream = co_await boat.subscribe(position, options);
    into->subscribed = true;
    while (into->packets.size() + into->lost < count) {
        auto packet = co_await stream.next();
        if (!packet) break;
        into->packets.push_back(packet->latitude_deg);
        into->lost += packet.lost_before();
        into->resumed = stream.counts().resumed;
    }
}
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
    ise::task<ise::result<ise::resolution>> resolve_when_present(std::string path, ise::time_point) override { return resolve(std::move(path)); }
    ise::task<std::uint64_t> next_life(std::string, std::uint64_t, ise::time_point) override { co_return 0; }
};

fix at_latitude(double latitude) { return fix{latitude, 0, 0}; }

} // namespace

#define OVER_EVERY_TRANSPORT tcp, tcp6, tls, udp, udp6, local, in_process, virtual_tcp, virtual_tls, virtual_udp

TEMPLATE_TEST_CASE("a call is answered, small or big, and concurrent calls overtake each other", "", OVER_EVERY_TRANSPORT) {
    pair<TestType> at;
    at.boat.provide(helm, [&](set_mode asked) -> ise::task<mode_set> {
        if (asked.mode == "slow") co_await ise::sleep_for(at.boat.on, 100ms);
        mode_set answer{true, asked.mode};
        co_return answer;
    });
    at.boat.provide(echo, [](blob given) { return given; });
    at.open();
    auto slow = start(at.shore.on, try_helm(at.there, "slow", 10s));
    auto quick = start(at.shore.on, try_helm(at.there, "quick", 10s));
    at.run_until([&] { return quick->done; });
    CHECK_FALSE(slow->done);
    at.run_until([&] { return slow->done; });
    CHECK((quick->get()->reason == "quick" && slow->get()->reason == "slow"));

    auto big = start(at.shore.on, try_echo(at.there, TestType::big_message));
    int between = 0;
    while (!big->done) {
        auto got = at.run(try_helm(at.there, "quick", 30s));
        INFO((got ? std::string() : got.error().message()));
        REQUIRE(got);
        ++between;
    }
    REQUIRE(big->get());
    CHECK(big->get()->content.size() == TestType::big_message);
    CHECK(big->get()->content[100'001] == static_cast<std::uint8_t>(100'001 * 7));
    CHECK(between >= TestType::calls_beside_big); // it held up none
}

TEMPLATE_TEST_CASE("a request runs at most once, whatever becomes of the session", "", OVER_EVERY_TRANSPORT) {
    pair<TestType> at;
    std::map<std::string, int> runs;
    at.boat.provide(helm, [&](set_mode asked) { ++runs[asked.mode]; return mode_set{true, asked.mode}; });
    at.open();
    REQUIRE(at.run(try_helm(at.there, "first", 10s)));
    for (int round = 0; round < 10; ++round) {
        std::vector<std::shared_ptr<started<ise::result<mode_set>>>> calls;
        for (int i = 0; i < 20; ++i) calls.push_back(start(at.shore.on, try_helm(at.there, fmt::format("{}.{}", round, i), 30s)));
        int turns = 0;
        at.run_until([&] { return ++turns > round; });
        if (!at.shore.services->sessions().empty()) at.cut();
        at.run_until([&] { return std::all_of(calls.begin(), calls.end(), [](auto& one) { return one->done; }); });
        for (int i = 0; i < 20; ++i) {
            auto& got = calls[static_cast<std::size_t>(i)]->get();
            auto ran = runs[fmt::format("{}.{}", round, i)];
            CHECK(ran <= 1);
            if (got) CHECK(ran == 1);
            if (TestType::calls_are_repeated) CHECK(got);
            if (!got && got.error().executed() == execution::not_executed) CHECK(ran == 0);
        }
    }
    REQUIRE(at.run(try_helm(at.there, "last", 30s)));
}

TEMPLATE_TEST_CASE("the answer precedes the first packet, order holds, and nothing is lost that is not counted", "", OVER_EVERY_TRANSPORT) {
    pair<TestType> at;
    auto out = at.boat.publish(position);
    at.open();
    out(at_latitude(0));
    auto got = std::make_shared<reading>();
    auto reader = start(at.shore.on, read(at.there, ise::subscribe_options::last(8), 501, got));
    at.run_until([&] { return !got->packets.empty(); });
    for (int i = 1; i <= 500; ++i) {
        out(at_latitude(i));
        if (i % 25 == 0) at.run_until([&] { return !got->packets.empty() && got->packets.back() == i; });
    }
    at.run_until([&] { return reader->done; });
    reader->get();
    CHECK(got->packets.front() == 0); // the last value
    CHECK(std::is_sorted(got->packets.begin(), got->packets.end()));
    CHECK(got->packets.back() == 500);
    CHECK(got->packets.size() + got->lost == 501);
}

TEMPLATE_TEST_CASE("lossless with credits loses nothing, however slow the reader, or is refused", "", OVER_EVERY_TRANSPORT) {
    pair<TestType> at;
    auto out = at.boat.publish(position);
    at.open();
    auto got = std::make_shared<reading>();
    auto reader = start(at.shore.on, read(at.there, ise::subscribe_options::lossless(5), 300, got));
    if (!TestType::lossless) {
        at.run_until([&] { return reader->done; });
        try {
            reader->get();
            FAIL("it was not refused");
        } catch (const ise::error& refused) {
            CHECK(refused.code() == errc::invalid_argument);
            CHECK_THAT(refused.what(), Catch::Matchers::Contains("udp"));
        }
        CHECK(out.subscribers() == 0);
        return;
    }
    at.run_until([&] { return got->subscribed; });
    auto send = [](ise::publication<ise::subscription<fix>> to) -> ise::task<> {
        for (int i = 1; i <= 300; ++i) {
            auto packet = at_latitude(i);
            co_await to.send(packet);
        }
    };
    auto sender = start(at.boat.on, send(out));
    at.run_until([&] { return reader->done && sender->done; });
    CHECK(got->packets.size() == 300);
    CHECK(got->lost == 0);
    CHECK(std::is_sorted(got->packets.begin(), got->packets.end()));
}

TEMPLATE_TEST_CASE("a message beyond the limit is refused with its size and the limit", "", OVER_EVERY_TRANSPORT) {
    pair<TestType> at;
    at.boat.provide(echo, [](blob given) { return given; });
    at.boat.provide(helm, [](set_mode) { return mode_set{true, "still here"}; });
    at.open();
    REQUIRE(at.run(try_helm(at.there, "x", 10s)));
    auto most = at.there.way().current()->wire().terms().peer_accepts.max_message_bytes;
    CHECK(most == TestType::message_limit);
    auto refused = at.run(try_echo(at.there, static_cast<std::size_t>(most)));
    REQUIRE_FALSE(refused);
    CHECK(refused.error().code() == errc::too_large);
    CHECK(refused.error().executed() == execution::not_executed);
    CHECK(refused.error().message().find(fmt::format("{}", most)) != std::string::npos);
    CHECK(at.run(try_helm(at.there, "x", 10s)));
}

TEMPLATE_TEST_CASE("deadline and cancellation reach the handler", "", OVER_EVERY_TRANSPORT) {
    pair<TestType> at;
    int begun = 0, cancelled = 0;
    at.boat.provide(helm, [&](set_mode) -> ise::task<mode_set> {
        ++begun;
        try {
            co_await ise::sleep_for(at.boat.on, 1h);
        } catch (const std::exception&) {
            ++cancelled;
            throw;
        }
        co_return mode_set{};
    });
    at.open();
    auto late = at.run(try_helm(at.there, "x", 200ms));
    REQUIRE_FALSE(late);
    CHECK(late.error().code() == errc::timed_out);
    at.run_until([&] { return cancelled == begun; });
    auto before = begun;
    auto given_up = start(at.shore.on, try_helm(at.there, "y", 1h));
    at.run_until([&] { return begun == before + 1; });
    given_up->cancel.emit(asio::cancellation_type::terminal);
    at.run_until([&] { return given_up->done && cancelled == begun; });
    CHECK(cancelled == begun);
}

TEMPLATE_TEST_CASE("a subscription resumes after the session was lost, with the exact gap", "", OVER_EVERY_TRANSPORT) {
    pair<TestType> at;
    auto out = at.boat.publish(position);
    at.open();
    auto got = std::make_shared<reading>();
    auto reader = start(at.shore.on, read(at.there, ise::subscribe_options::last(4), 40, got));
    at.run_until([&] { return out.subscribers() == 1; });
    for (int i = 1; i <= 10; ++i) out(at_latitude(i));
    at.run_until([&] { return !got->packets.empty() && got->packets.back() == 10; });
    at.cut();
    for (int i = 11; i <= 39; ++i) out(at_latitude(i)); // more than is kept; some go into the dead connection
    auto tick = [](ise::loop& on, ise::publication<ise::subscription<fix>> to) -> ise::task<> {
        for (int i = 40;; ++i) {
            co_await ise::sleep_for(on, 5ms);
            to(at_latitude(i));
        }
    };
    at.boat.scope.spawn("ticker", tick(at.boat.on, out));
    at.run_until([&] { return reader->done; });
    CHECK(got->packets.back() >= 40);
    CHECK(static_cast<double>(got->packets.size() + got->lost) == got->packets.back()); // exact to the packet
    CHECK(got->resumed == 1);
    CHECK(out.subscribers() == 1);
}

TEMPLATE_TEST_CASE("the wrong peer is refused", "", OVER_EVERY_TRANSPORT) {
    pair<TestType> at;
    at.boat.provide(helm, [](set_mode) { return mode_set{}; });
    at.open();
    auto names = std::make_shared<stale>();
    names->where = at.where;
    at.shore.services->use_resolver(names);
    auto right = at.run(try_helm(ise::remote(at.shore.services->link_to(std::string("boat"))), "x", 10s));
    CHECK(right);
    auto way = at.shore.services->link_to(std::string("buoy"));
    auto wrong = start(at.shore.on, try_helm(ise::remote(way), "x", 1h));
    CHECK(at.run_until([&] { return way->obstacle().find("here is 'boat', not 'buoy'") != std::string::npos; }));
    wrong->cancel.emit(asio::cancellation_type::terminal);
    at.run_until([&] { return wrong->done; });
    CHECK(at.boat.services->counts().calls_served == 1);
}

TEMPLATE_TEST_CASE("a peer that is half open is found", "", OVER_EVERY_TRANSPORT) {
    pair<TestType> at;
    at.open();
    // Greets, and is silent from then on.
    struct quiet {
        static ise::task<> greet(ise::loop& on, ise::endpoint where, ise::security with, std::unique_ptr<ise::stream>& held, std::shared_ptr<bool> welcome) {
            auto made = co_await ise::net::connect_until(on, where, on.now() + 1h, with.tls);
            held = std::move(made.value());
            ise::buffer out;
            ise::wire::hello mine;
            ise::wire::put_frame(out, ise::wire::frame_type::hello, 0, 0, [&](ise::buffer& body) { ise::encode(mine, body); });
            asio::const_buffer raw(out.data(), out.size());
            held->try_write(std::span(&raw, 1));
            std::array<std::byte, 512> room;
            auto got = co_await held->read_some(asio::buffer(room));
            *welcome = got.bytes > 0;
        }
    };
    std::unique_ptr<ise::stream> held;
    auto welcome = std::make_shared<bool>(false);
    auto greeted = start(at.shore.on, quiet::greet(at.shore.on, at.where, at.shore.services->credentials(), held, welcome));
    at.run_until([&] { return greeted->done && !at.boat.services->sessions().empty(); });
    greeted->get();
    CHECK(*welcome);
    CHECK(at.run_until([&] { return at.boat.services->sessions().empty(); })); // it does not wait for ever
    held.reset();
}
