// The time of publication that packets carry, and peers that do not know of it.
#include <ise/core/little_endian.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/trace_id.hpp>
#include <ise/packet/codec.hpp>
#include <ise/service/dynamic.hpp>
#include <ise/wire/frame.hpp>
#include <ise/wire/messages.hpp>

#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/raw_peer.hpp>
#include <support/sim_parties.hpp>

#include <optional>
#include <vector>

namespace stamps_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;

namespace {

using stamps = std::vector<std::optional<ise::wall_time>>;

ise::task<stamps> read(ise::remote from, std::size_t count, ise::subscribe_options options) {
    stamps got;
    auto fixes = co_await from.subscribe(position, options);
    while (got.size() < count) {
        auto packet = co_await fixes.next();
        if (!packet) break;
        got.push_back(packet.published_at());
    }
    co_return got;
}

ise::task<std::optional<ise::wall_time>> read_dynamic(ise::remote from) {
    auto service = ise::dynamic_contract::of(position);
    auto request = ise::default_packet(service.packet(ise::role::subscribe_request));
    auto stream = co_await ise::subscribe_dynamic(from, service, std::move(request));
    auto packet = co_await stream.value().next();
    co_return packet.published_at();
}

struct fixture {
    sim_parties all;
    party& boat = all.add("boat");
    party& shore = all.add("shore");
    ise::publication<ise::subscription<fix>> out = boat.publish(position);

    void publish(double number) {
        ise::loop::turn in(boat.on);
        out(fix{number, 0, 0});
    }
};

} // namespace

TEST_CASE("packets bear the provider's wall clock when they were published, however long they travel") {
    for (const char* scheme : {"tcp", "udp"}) {
        INFO(scheme);
        fixture at;
        auto where = std::string(scheme) + "://boat:7400";
        at.boat.listen(std::string(scheme) + "://0.0.0.0:7400");
        static_cast<ise::sim::process&>(at.boat.env).set_wall_offset(3s); // its clock is ahead
        at.all.world.net().between("boat", "shore").latency = 200ms;
        at.publish(0);
        const auto first = at.boat.env.wall();
        at.all.world.run_for(5s);
        auto got = start(at.shore.on, read(at.shore.at(where), 3, ise::subscribe_options::keep_last(10)));
        at.all.run_until([&] { return at.out.subscribers() == 1; });
        at.all.world.run_for(5s);
        const auto second = at.boat.env.wall();
        at.publish(1);
        at.all.world.run_for(1ms);
        const auto third = at.boat.env.wall();
        at.publish(2);
        at.all.run_until([&] { return got->done; });
        CHECK(got->get() == stamps{first, second, third}); // the last value keeps its own
        CHECK(at.all.run(at.shore, read_dynamic(at.shore.at(where))) == third);
    }
}

TEST_CASE("packets of one turn bear one time, which the next turn reads anew") {
    fixture at;
    at.boat.listen("tcp://0.0.0.0:7400");
    auto got = start(at.shore.on, read(at.shore.at("tcp://boat:7400"), 4, ise::subscribe_options::keep_last(10)));
    at.all.run_until([&] { return at.out.subscribers() == 1; });
    {
        ise::loop::turn in(at.boat.on);
        at.out(fix{1, 0, 0});
        at.out(fix{2, 0, 0});
    }
    at.all.world.run_for(1s);
    at.publish(3);
    at.publish(4);
    at.all.run_until([&] { return got->done; });
    const auto& all = got->get();
    REQUIRE(all.size() == 4);
    CHECK((all[0] && all[0] == all[1]));
    CHECK(*all[2] - *all[0] == 1s);
    CHECK(all[3] == all[2]);
}

TEST_CASE("packets that are sent again after a lost session keep their time") {
    fixture at;
    at.boat.listen("tcp://0.0.0.0:7400");
    auto got = start(at.shore.on, read(at.shore.at("tcp://boat:7400"), 3, ise::subscribe_options::lossless(10)));
    at.all.run_until([&] { return at.out.subscribers() == 1; });
    stamps expected;
    for (int i = 1; i <= 3; ++i) {
        expected.push_back(at.boat.env.wall());
        at.publish(i);
        if (i == 1)
            for (auto& [raw, session] : at.boat.services->sessions())
                session->wire().close(ise::failure(ise::errc::peer_lost, "cut"));
        at.all.world.run_for(2s);
    }
    at.all.run_until([&] { return got->done; });
    CHECK(got->get() == expected);
}

namespace {

ise::wire::subscribe terms_of(const ise::packet_types& types) {
    ise::wire::subscribe terms;
    terms.service.service = "position";
    terms.service.fingerprints = types.fingerprints;
    return terms;
}

} // namespace

TEST_CASE("a subscriber of a version without times gets packets without them, beside one that gets them") {
    fixture at;
    at.boat.listen("tcp://0.0.0.0:7400");
    auto& process = at.all.world.host("museum").start_process("museum");
    raw_peer old(at.all, process, "tcp://boat:7400");
    ise::wire::hello hello;
    hello.self.incarnation = 7;
    hello.features = ise::wire::feature::first | ise::wire::feature::clock;
    old.greet(hello);
    old.say(ise::wire::frame_type::subscribe, 1, terms_of(position.types()));
    auto got = start(at.shore.on, read(at.shore.at("tcp://boat:7400"), 20, ise::subscribe_options::keep_last(100)));
    at.all.run_until([&] { return at.out.subscribers() == 2; });
    {
        ise::loop::turn in(at.boat.on);
        for (int i = 1; i <= 20; ++i) at.out(fix{double(i), 0, 0}); // would leave as one stretch
    }
    at.all.run_until([&] { return got->done && old.count(ise::wire::frame_type::packet) == 20; });
    for (const auto& one : got->get()) CHECK(one.has_value());
    double expected = 1;
    for (const auto& frame : old.got) {
        if (frame.header.type != ise::wire::frame_type::packet) continue;
        CHECK(frame.header.flags == 0);
        REQUIRE(frame.body.size() == 8 + ise::encode(fix{}).size());
        CHECK(ise::detail::load_little<std::uint64_t>(frame.body.data()) == static_cast<std::uint64_t>(expected));
        CHECK(ise::decode<fix>(ise::bytes_view(frame.body).subspan(8)).latitude_deg == expected);
        expected += 1;
    }
}

TEST_CASE("a peer of this version gets the time behind the sequence, and the count of skipped packets before it") {
    fixture at;
    at.boat.listen("tcp://0.0.0.0:7400");
    auto& process = at.all.world.host("peer").start_process("peer");
    raw_peer peer(at.all, process, "tcp://boat:7400");
    ise::wire::hello hello;
    hello.self.incarnation = 7;
    hello.features = ise::wire::feature::all;
    peer.greet(hello);
    auto terms = terms_of(position.types());
    terms.min_interval_ns = 1'000'000'000;
    peer.say(ise::wire::frame_type::subscribe, 1, terms);
    at.all.run_until([&] { return at.out.subscribers() == 1; });
    at.publish(1);
    at.publish(2);
    at.all.world.run_for(2s);
    at.publish(3);
    const auto last = at.boat.env.wall();
    at.all.run_until([&] { return peer.count(ise::wire::frame_type::packet) == 2; });
    const auto* frame = peer.last(ise::wire::frame_type::packet);
    CHECK(frame->header.flags == (ise::wire::flag::skipped | ise::wire::flag::stamped));
    REQUIRE(frame->body.size() == 8 + 4 + 8 + ise::encode(fix{}).size());
    CHECK(ise::detail::load_little<std::uint64_t>(frame->body.data()) == 3);
    CHECK(ise::detail::load_little<std::uint32_t>(frame->body.data() + 8) == 1);
    CHECK(ise::detail::load_little<std::int64_t>(frame->body.data() + 12) == last.time_since_epoch().count());
    CHECK(ise::decode<fix>(ise::bytes_view(frame->body).subspan(20)).latitude_deg == 3);
}

TEST_CASE("a packet that is published for a trace carries it to peers that know of it, to others not, and to later "
          "subscribers not") {
    fixture at;
    at.boat.listen("tcp://0.0.0.0:7400");
    const bool knows = GENERATE(true, false);
    raw_peer peer(at.all, at.all.world.host("peer").start_process("peer"), "tcp://boat:7400");
    ise::wire::hello hello;
    hello.self.incarnation = 7;
    hello.features = knows ? ise::wire::feature::all : ise::wire::feature::all & ~ise::wire::feature::packet_traces;
    peer.greet(hello);
    auto terms = terms_of(position.types());
    terms.min_interval_ns = 1'000'000'000;
    peer.say(ise::wire::frame_type::subscribe, 1, terms);
    at.all.run_until([&] { return at.out.subscribers() == 1; });
    at.publish(1);
    at.publish(2); // is skipped
    at.all.world.run_for(2s);
    {
        const ise::detail::trace_scope works_for({{5, 6, 7}, false});
        at.publish(3);
    }
    at.all.run_until([&] { return peer.count(ise::wire::frame_type::packet) == 2; });
    const auto* frame = peer.last(ise::wire::frame_type::packet);
    const std::uint8_t usual = ise::wire::flag::skipped | ise::wire::flag::stamped;
    const std::size_t head = knows ? 20 + 24 : 20;
    CHECK(frame->header.flags == (knows ? usual | ise::wire::flag::caused : usual));
    REQUIRE(frame->body.size() == head + ise::encode(fix{}).size());
    if (knows) {
        CHECK(ise::detail::load_little<std::uint64_t>(frame->body.data() + 20) == 5);
        CHECK(ise::detail::load_little<std::uint64_t>(frame->body.data() + 28) == 6);
        CHECK(ise::detail::load_little<std::uint64_t>(frame->body.data() + 36) == 7);
    }
    CHECK(ise::decode<fix>(ise::bytes_view(frame->body).subspan(head)).latitude_deg == 3);

    raw_peer late(at.all, at.all.world.host("late").start_process("late"), "tcp://boat:7400");
    late.greet(hello);
    late.say(ise::wire::frame_type::subscribe, 1, terms_of(position.types()));
    at.all.run_until([&] { return late.count(ise::wire::frame_type::packet) == 1; });
    frame = late.last(ise::wire::frame_type::packet);
    CHECK(frame->header.flags == ise::wire::flag::stamped);
    CHECK(ise::detail::load_little<std::uint64_t>(frame->body.data()) == 3);
    CHECK(ise::decode<fix>(ise::bytes_view(frame->body).subspan(16)).latitude_deg == 3);
}

TEST_CASE("packets for a trace and others in one burst arrive in their order, each with its own, without loss") {
    fixture at;
    at.boat.listen("tcp://0.0.0.0:7400");
    auto options = ise::subscribe_options::lossless(100);
    std::vector<std::uint64_t> traces;
    std::vector<double> numbers;
    auto follow = [&](ise::remote from) -> ise::task<> {
        auto fixes = co_await from.subscribe(position, options);
        while (numbers.size() < 20) {
            auto packet = co_await fixes.next();
            numbers.push_back(packet->latitude_deg);
            traces.push_back(ise::current_trace().trace);
        }
    };
    auto got = start(at.shore.on, follow(at.shore.at("tcp://boat:7400")));
    at.all.run_until([&] { return at.out.subscribers() == 1; });
    {
        ise::loop::turn in(at.boat.on);
        for (int i = 1; i <= 20; ++i) {
            ise::trace_id trace;
            if (i % 3 == 0) trace.trace = static_cast<std::uint64_t>(i);
            const ise::detail::trace_scope works_for({trace, false});
            at.out(fix{double(i), 0, 0});
        }
    }
    at.all.run_until([&] { return got->done; });
    for (int i = 1; i <= 20; ++i) {
        CHECK(numbers.at(static_cast<std::size_t>(i - 1)) == i);
        CHECK(traces.at(static_cast<std::size_t>(i - 1)) == (i % 3 == 0 ? static_cast<std::uint64_t>(i) : 0));
    }
}

} // namespace stamps_test
