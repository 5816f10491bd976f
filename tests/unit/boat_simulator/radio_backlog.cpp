#include <components/boat_simulator/boat_memory.hpp>
#include <components/boat_simulator/radio_backlog.hpp>

#include <support/catch.hpp>

namespace radio_backlog_test {

using namespace atirma;
using namespace atirma::simulator;
using namespace std::chrono_literals;

namespace {

constexpr ise::time_point start{std::chrono::hours(1)};

ise::bytes packet(std::uint32_t sequence, std::uint16_t boot = 3) {
    packet_header header;
    header.boot = boot;
    header.sequence = sequence;
    return encode_telemetry(header, wind{});
}

std::uint32_t sequence_of(const ise::bytes& raw) { return raw.empty() ? 0 : parse_telemetry(raw)->header.sequence; }

telemetry_receipt receipt(std::initializer_list<std::uint32_t> sequences) {
    telemetry_receipt made;
    for (auto one : sequences) made.packets.emplace(std::uint16_t{3}, one);
    return made;
}

} // namespace

TEST_CASE("radio backlog: what is not receipted goes again, after pauses that grow, until it is") {
    radio_backlog kept(start);
    for (std::uint32_t i = 1; i <= 3; ++i) CHECK(kept.put(start, packet(i)));
    CHECK(kept.next(start + 5s).empty());
    CHECK(kept.on_receipt(start + 5s, receipt({1, 3, 77})) == std::vector<packet_name>{{3, 1}, {3, 3}});
    CHECK(kept.waiting() == 1);
    CHECK(kept.next(start + 19s).empty());
    CHECK(sequence_of(kept.next(start + 20s)) == 2);
    CHECK(kept.next(start + 20s).empty());
    kept.on_radio_acknowledgement(start + 55s);
    CHECK(kept.next(start + 59s).empty());
    CHECK(sequence_of(kept.next(start + 60s)) == 2); // twice the pause
    CHECK(kept.sent_again() == 2);
    kept.on_receipt(start + 61s, receipt({2}));
    CHECK(kept.waiting() == 0);
    CHECK(kept.next(start + 10min).empty());
}

TEST_CASE("radio backlog: a shore that gives no receipts is sent nothing twice") {
    radio_backlog kept(start);
    kept.put(start, packet(1));
    for (auto passed = 0s; passed < 600s; passed += 10s) {
        kept.on_radio_acknowledgement(start + passed);
        CHECK(kept.next(start + passed).empty());
    }
    // Nor one that has stopped giving them, though its modem acknowledges.
    kept.put(start + 600s, packet(2));
    kept.on_receipt(start + 600s, receipt({2}));
    CHECK(sequence_of(kept.next(start + 601s)) == 1);
    kept.put(start + 601s, packet(3));
    kept.on_radio_acknowledgement(start + 1000s);
    CHECK(kept.next(start + 1000s).empty());
}

TEST_CASE("radio backlog: while nobody hears it the boat holds what it has, and looks for the shore") {
    radio_backlog kept(start);
    CHECK(kept.put(start + 29s, packet(1)));
    auto silent = start + 30s;
    std::vector<std::uint32_t> sent;
    for (std::uint32_t i = 0; i < 60; ++i)
        if (kept.put(silent + i * 1s, packet(100 + i))) sent.push_back(i);
    CHECK(sent == std::vector<std::uint32_t>{0, 15, 30, 45});
    CHECK(kept.next(silent + 60s).empty());
    kept.on_radio_acknowledgement(silent + 60s);
    CHECK(sequence_of(kept.next(silent + 60s)) == 101); // held, oldest first; for any shore that hears it
    CHECK(kept.put(silent + 60s, packet(200)));         // and what is new goes at once
    kept.on_duty(radio_backlog::max_duty_percent);
    CHECK(kept.next(silent + 60s).empty());
    kept.on_duty(radio_backlog::max_duty_percent - 1);
    CHECK(sequence_of(kept.next(silent + 60s)) == 102);
}

TEST_CASE("radio backlog: a receipt, forged or not, takes away no packet that was never sent") {
    radio_backlog kept(start);
    auto silent = start + 30s;
    CHECK(kept.put(silent, packet(1)));
    CHECK_FALSE(kept.put(silent, packet(2)));
    kept.put_held(packet(9, 2));
    telemetry_receipt forged;
    forged.packets = {{2, 9}, {3, 1}, {3, 2}, {3, 3}};
    CHECK(kept.on_receipt(silent, forged) == std::vector<packet_name>{{3, 1}});
    CHECK(kept.waiting() == 2);
    CHECK(sequence_of(kept.next(silent)) == 9);
    CHECK(sequence_of(kept.next(silent)) == 2);
    CHECK(kept.on_receipt(silent + 1s, forged).size() == 2);
}

TEST_CASE("radio backlog: it is bounded, and the oldest goes") {
    radio_backlog kept(start);
    for (std::uint32_t i = 1; i <= radio_backlog::capacity + 5; ++i) kept.put(start, packet(i));
    CHECK(kept.waiting() == radio_backlog::capacity);
    CHECK(kept.given_up() == 5);
    CHECK(kept.take_given_up() == std::vector<packet_name>{{3, 1}, {3, 2}, {3, 3}, {3, 4}, {3, 5}});
    CHECK(kept.take_given_up().empty());
}

TEST_CASE("radio backlog: what the modem did not take, and what a boat had before it lost its power, goes later") {
    radio_backlog kept(start);
    kept.put(start, packet(5));
    kept.not_taken(packet(5));
    CHECK(sequence_of(kept.next(start)) == 5);
    auto memory = boat_memory::open("memory:radio-backlog").value();
    for (std::uint32_t i = 1; i <= 3; ++i) REQUIRE(memory.put({2, i}, packet(i, 2)));
    REQUIRE(memory.forget({{2, 2}, {2, 9}}));
    auto before = memory.not_receipted().value();
    REQUIRE(before.size() == 2);
    for (auto& raw : before) kept.put_held(std::move(raw));
    CHECK(sequence_of(kept.next(start)) == 1);
    CHECK(sequence_of(kept.next(start)) == 3);
    CHECK(kept.waiting() == 3);
}

} // namespace radio_backlog_test
