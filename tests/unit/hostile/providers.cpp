// Sessions in good order over which a provider publishes what it likes.
#include <ise/core/little_endian.hpp>
#include <ise/wire/frame.hpp>
#include <ise/wire/messages.hpp>

#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/raw_peer.hpp>
#include <support/sim_parties.hpp>

#include <ostream>

namespace providers_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;
using ise::wire::frame_type;
namespace flag = ise::wire::flag;

namespace {

// All that a subscriber learns.
struct learned {
    std::vector<double> packets;
    std::vector<std::uint64_t> lost_before;
    std::vector<std::optional<ise::wall_time>> times;
    std::uint64_t received = 0, lost_at_provider = 0, lost_here = 0, skipped = 0, undecodable = 0;
    std::string cause;
    bool connected = false;

    bool operator==(const learned&) const = default;
    friend std::ostream& operator<<(std::ostream& out, const learned& of) {
        for (std::size_t i = 0; i < of.packets.size(); ++i) out << of.packets[i] << "(" << of.lost_before[i] << ") ";
        return out << "received " << of.received << " lost " << of.lost_at_provider << "+" << of.lost_here
                   << " skipped " << of.skipped << " undecodable " << of.undecodable << " connected " << of.connected
                   << " " << of.cause;
    }
};

struct packet {
    std::uint64_t sequence = 0;
    std::uint8_t flags = flag::stamped;
    std::uint64_t id = 1;
    std::size_t size = 1000; // of the body, if it is cut
};

ise::bytes frame_of(const packet& of) {
    ise::buffer out;
    ise::wire::put_frame(out, frame_type::packet, of.flags, of.id, [&](ise::buffer& to) {
        ise::buffer body;
        body.append(of.sequence);
        if (of.flags & flag::skipped) body.append(std::uint32_t{1});
        if (of.flags & flag::stamped) body.append(static_cast<std::int64_t>(1'000 + of.sequence));
        if (of.flags & flag::caused)
            for (auto part : {std::uint64_t{5}, std::uint64_t{6}, std::uint64_t{7}}) body.append(part);
        auto content = ise::encode(fix{1.0 * static_cast<double>(of.sequence), 0, 0});
        body.append(ise::bytes_view(content));
        to.append(body.view().first(std::min(of.size, body.size())));
    });
    return out.to_bytes();
}

// A subscriber of a provider that plays by a script, and takes nothing before the end of it.
struct scripted_provider {
    explicit scripted_provider(ise::subscribe_options options, ise::service_options of_subscriber = {})
        : shore(all.add("shore", of_subscriber)) {
        auto host = sea.make_loop("raw");
        auto ear = sea.listen(host->loop(), ise::endpoint::parse("tcp://0.0.0.0:7400").value()).value();
        std::unique_ptr<ise::stream> line;
        auto accepting = start(host->loop(), accept(*ear, line));
        following = start(shore.on, follow(*this, shore.at("tcp://sea:7400"), options));
        REQUIRE(all.run_until([&] { return accepting->done; }));
        peer.emplace(all, std::move(host), std::move(line));
        REQUIRE(all.run_until([&] { return peer->count(frame_type::hello) == 1; }));
        ise::wire::welcome welcome;
        welcome.self.incarnation = 1;
        welcome.features = ise::wire::feature::first | ise::wire::feature::clock | ise::wire::feature::stamps |
                           ise::wire::feature::packet_traces;
        peer->say(frame_type::welcome, 0, welcome);
        REQUIRE(all.run_until([&] { return peer->count(frame_type::subscribe) == 1; }));
        ise::wire::subscribed answer;
        answer.incarnation = 1;
        answer.first_sequence = 1;
        answer.fingerprints = position.types().fingerprints;
        peer->say(frame_type::subscribed, 1, answer);
        REQUIRE(all.run_until([&] { return subscribed; }));
    }

    learned end() {
        all.world.run_for(1s);
        ise::loop::turn in(shore.on);
        learned got;
        while (auto one = fixes.try_next()) {
            got.packets.push_back(one->latitude_deg);
            got.lost_before.push_back(one.lost_before().value_or(999));
            got.times.push_back(one.published_at());
        }
        const auto& counts = fixes.counts();
        got.received = counts.received;
        got.lost_at_provider = counts.lost_at_provider;
        got.lost_here = counts.lost_here;
        got.skipped = counts.skipped;
        got.undecodable = counts.undecodable;
        got.connected = fixes.connected();
        if (fixes.ended()) got.cause = fixes.cause().message();
        return got;
    }

    static ise::task<> accept(ise::listener& at, std::unique_ptr<ise::stream>& into) {
        auto came = co_await at.accept();
        into = std::move(came.second);
    }
    static ise::task<> follow(scripted_provider& self, ise::remote from, ise::subscribe_options options) {
        self.fixes = co_await from.subscribe(position, options);
        self.subscribed = true;
    }

    sim_parties all;
    party& shore;
    ise::sim::process& sea = all.world.host("sea").start_process("sea");
    std::optional<raw_peer> peer;
    ise::subscriber<ise::subscription<fix>> fixes;
    bool subscribed = false;
    std::shared_ptr<started<void>> following;
};

std::vector<packet> voyage(int which) {
    std::vector<packet> all;
    for (std::uint64_t i = 1; i <= 12; ++i) all.push_back({i});
    auto& one = all[5];
    switch (which) {
        case 0: break;
        case 1: one.size = 15; break; // without all of its time
        case 2: one.size = 7; break;  // without all of its sequence
        case 3: one.size = 20; break; // without all of the packet
        case 4: all.erase(all.begin() + 5); break;
        case 5: one.sequence = 3; break;
        case 6: one.id = 2; break; // of no subscription
        case 7: one.flags = 0; break;
        case 8: one.flags = flag::stamped | flag::skipped; break;
        case 9: one.flags = flag::stamped | flag::caused; break;
        case 10: // with bits that mean nothing here
            for (auto& each : all) each.flags = flag::stamped | 0x70;
            break;
        case 11: one.sequence = ~std::uint64_t{0}; break;
        case 12: // of a version that does not know times
            for (auto& each : all) each.flags = 0;
            break;
        default: all.front().sequence = 2; break;
    }
    return all;
}

} // namespace

TEST_CASE("packets that come together are treated as those that come one by one") {
    const int which = GENERATE(range(0, 14));
    const int policy = GENERATE(range(0, 5));
    auto options = ise::subscribe_options::keep_last(policy == 0 ? 100 : 4);
    if (policy == 2) options = ise::subscribe_options::keep_latest();
    if (policy == 3) options = ise::subscribe_options::lossless(8);
    if (policy == 4) options.policy = ise::overflow::disconnect;
    INFO(which << " " << policy);

    scripted_provider alone(options), together(options), halves(options);
    ise::bytes stream;
    for (const auto& one : voyage(which)) {
        auto frame = frame_of(one);
        alone.peer->say(ise::bytes_view(frame));
        alone.all.world.run_for(10ms);
        stream.insert(stream.end(), frame.begin(), frame.end());
    }
    together.peer->say(ise::bytes_view(stream));
    for (std::size_t at = 0; at < stream.size(); at += 150) {
        halves.peer->say(ise::bytes_view(stream).subspan(at, std::min<std::size_t>(150, stream.size() - at)));
        halves.all.world.run_for(10ms);
    }
    const auto expected = alone.end();
    CHECK(together.end() == expected);
    CHECK(halves.end() == expected);
    if (which == 0 && policy == 0) {
        CHECK(expected.packets.size() == 12);
        CHECK(expected.times.back() == ise::wall_time(ise::duration(1012)));
    }
    if (which == 4 && policy == 0) CHECK(expected.lost_before[5] == 1);
}

TEST_CASE("hostile: a provider that publishes beyond the credit of a lossless subscriber ends the subscription") {
    scripted_provider at(ise::subscribe_options::lossless(5));
    ise::bytes stream;
    for (std::uint64_t i = 1; i <= 100; ++i) {
        auto frame = frame_of({i});
        stream.insert(stream.end(), frame.begin(), frame.end());
    }
    at.peer->say(ise::bytes_view(stream));
    const auto got = at.end();
    CHECK(got.packets == std::vector<double>{1, 2, 3, 4, 5});
    CHECK_THAT(got.cause, Contains("were not taken in time"));
}

TEST_CASE("hostile: packets that are not taken are bounded by bytes as well as by their number") {
    ise::service_options options;
    options.session_bytes = 1024; // so four times as much waits
    const bool lossless = GENERATE(false, true);
    scripted_provider at(lossless ? ise::subscribe_options::lossless(1000) : ise::subscribe_options::keep_last(1000),
                         options);
    const bool together = GENERATE(false, true);
    ise::bytes stream;
    for (std::uint64_t i = 1; i <= 300; ++i) {
        auto frame = frame_of({i});
        stream.insert(stream.end(), frame.begin(), frame.end());
        if (together && i < 300) continue;
        at.peer->say(ise::bytes_view(stream));
        at.all.world.run_for(1ms);
        stream.clear();
    }
    const auto got = at.end();
    CHECK(got.packets.size() >= 50);
    if (lossless) {
        CHECK_THAT(got.cause, Contains("were not taken in time"));
        return;
    }
    if (!together) CHECK(got.packets.size() <= 100);
    CHECK(got.packets.size() + got.lost_here == 300);
    CHECK(got.lost_before.front() == got.lost_here);
    CHECK(got.packets.back() == 300);
    CHECK(got.connected);
}

} // namespace providers_test
