#include <ise/packet/archive.hpp>

#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/sim_parties.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

namespace subscriptions_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;
using ise::errc;
using ise_test::Contains;

namespace {

struct area {
    std::string name;
};
struct granted {
    int number = 0;
};
constexpr ise::subscription<fix, area, granted> watched("watched");

// Its number is not to everybody's liking.
struct picky {
    int number = 0;
    template <class Archive>
    void serialize(Archive& archive) {
        archive(number);
        if (Archive::is_loading::value && number == 13) throw std::runtime_error("13 brings bad luck");
    }
};
constexpr ise::subscription<picky> numbers("numbers");

// Knows how often one was written.
struct watchful {
    static inline int written = 0;
    int number = 0;
    template <class Archive>
    void serialize(Archive& archive) {
        if (Archive::is_saving::value) ++written;
        archive(number);
    }
};
constexpr ise::subscription<watchful> watch("watch");

// What a subscriber got: the packets (their latitudes), and the gap before each.
struct reading {
    std::vector<double> packets;
    std::vector<std::optional<std::uint64_t>> gaps;
    std::optional<ise::failure> end;
    std::optional<ise::subscriber<ise::subscription<fix>>> stream;
};
using shared_reading = std::shared_ptr<reading>;

ise::task<> follow(ise::remote from, shared_reading into, ise::subscribe_options options) {
    auto fixes = co_await from.subscribe(position, options);
    into->stream.emplace(std::move(fixes));
    for (;;) {
        auto packet = co_await into->stream->next();
        if (!packet) break;
        into->packets.push_back(packet->latitude_deg);
        into->gaps.push_back(packet.lost_before());
    }
    into->end = into->stream->cause();
}

// Subscribes and takes nothing until it is told to.
ise::task<> hold(ise::remote from, ise::subscription<fix> what, shared_reading into, ise::subscribe_options options) {
    auto fixes = co_await from.subscribe(what, options);
    into->stream.emplace(std::move(fixes));
}
void drain(reading& from) {
    for (auto packet = from.stream->try_next(); packet; packet = from.stream->try_next()) {
        from.packets.push_back(packet->latitude_deg);
        from.gaps.push_back(packet.lost_before());
    }
}

fix at_latitude(double latitude) { return fix{latitude, 0, 0}; }
std::vector<double> range(int first, int last) {
    std::vector<double> made;
    for (int i = first; i <= last; ++i) made.push_back(i);
    return made;
}

struct fixture {
    sim_parties all;
    party& boat;
    party& shore;
    ise::publication<ise::subscription<fix>> fixes;
    ise::remote there;
    std::vector<std::shared_ptr<started<void>>> running;

    explicit fixture(ise::service_options options = {}) : boat(all.add("boat", options)), shore(all.add("shore")) {
        fixes = boat.publish(position);
        boat.listen("tcp://0.0.0.0:7400");
        there = shore.at("tcp://boat:7400");
    }
    ~fixture() {
        running.clear();
        all.stop();
        CHECK(boat.escaped.empty());
    }
    shared_reading read(ise::subscribe_options options = {}) {
        auto made = std::make_shared<reading>();
        running.push_back(start(shore.on, follow(there, made, options)));
        all.run_until([&] { return made->stream.has_value(); });
        return made;
    }
    shared_reading sit(ise::subscribe_options options) {
        auto made = std::make_shared<reading>();
        all.run(shore, hold(there, position, made, options));
        return made;
    }
    void publish(int first, int last) {
        ise::loop::turn in(boat.on);
        for (int i = first; i <= last; ++i) fixes(at_latitude(i));
    }
    void settle() { all.world.run_for(2s); }
    void cut() {
        for (auto& [raw, session] : shore.services->sessions())
            session->wire().close(ise::failure(errc::peer_lost, "cut"));
    }
};

} // namespace

TEST_CASE("the last value comes first, and nothing after it is missed") {
    fixture at;
    at.publish(1, 3);
    auto got = at.read();
    at.publish(4, 6);
    at.settle();
    CHECK(got->packets == range(3, 6));
    CHECK(got->gaps == std::vector<std::optional<std::uint64_t>>{0, 0, 0, 0});

    ise::subscribe_options fresh;
    fresh.last_value = false;
    auto later = at.read(fresh);
    at.publish(7, 7);
    at.settle();
    CHECK(later->packets == range(7, 7));
}

TEST_CASE("what is published right after the provider committed is not missed") {
    fixture at;
    ise::publication_callbacks<ise::subscription<fix, area, granted>> callbacks;
    std::vector<std::string> left;
    int count = 0;
    ise::publication<ise::subscription<fix, area, granted>> out;
    callbacks.on_subscribe = [&](const area& wanted, const ise::subscriber_info& who) -> ise::result<granted> {
        CHECK_THAT(who.peer, Contains("shore"));
        out(at_latitude(count)); // reentrant: whoever is not accepted yet gets it as the last value at most
        if (wanted.name == "forbidden") return ise::failure(errc::refused, "not your waters");
        return granted{++count};
    };
    callbacks.on_unsubscribe = [&](const auto&, const ise::subscriber_info& who) {
        left.push_back(who.peer);
        return ise::nothing{};
    };
    out = at.boat.publish(watched, callbacks);

    auto subscribe = [](ise::remote from, std::string name) -> ise::task<std::pair<int, double>> {
        area wanted{std::move(name)};
        auto fixes = co_await from.subscribe(watched, wanted, ise::subscribe_options());
        auto first = co_await fixes.next();
        std::pair<int, double> got(fixes.response().number, first->latitude_deg);
        co_return got;
    };
    auto got = at.all.run(at.shore, subscribe(at.there, "bay"));
    CHECK(got == std::pair(1, 0.0));
    at.settle();
    CHECK(left.size() == 1);
    CHECK(out.subscribers() == 0);

    auto refused = start(at.shore.on, subscribe(at.there, "forbidden"));
    at.all.run_until([&] { return refused->done; });
    CHECK(refused->code() == errc::refused);
    CHECK_THROWS_WITH(refused->get(), Contains("not your waters"));
    CHECK(left.size() == 1);
}

TEST_CASE("a provider may withdraw its service in the callback in which a subscriber leaves") {
    fixture at;
    auto& services = at.boat.services->services();
    int left = 0;
    ise::publication_callbacks<ise::subscription<fix, area, granted>> callbacks;
    callbacks.on_unsubscribe = [&](const auto&, const ise::subscriber_info&) {
        ++left;
        services.remove("watched");
        return ise::nothing{};
    };
    services.add(ise::make_publication(*at.boat.services, watched, std::move(callbacks))).value();
    std::optional<errc> end;
    auto stay = [](ise::remote from, std::optional<errc>& into) -> ise::task<> {
        area wanted{"bay"};
        auto stream = co_await from.subscribe(watched, wanted, ise::subscribe_options());
        auto packet = co_await stream.next();
        if (!packet) into = stream.cause().code();
    };
    at.running.push_back(start(at.shore.on, stay(at.there, end)));
    at.all.run_until([&] { return services.find_publication("watched")->subscribers() == 1; });
    at.settle(); // the subscriber has the answer
    SECTION("as the service is withdrawn") {
        services.remove("watched");
        at.all.run_until([&] { return end.has_value(); });
        CHECK(end.value_or(errc{}) == errc::no_such_service);
    }
    SECTION("as the component stops") { at.boat.services->stop(1s); }
    SECTION("as the subscriber does not come back") {
        at.all.world.net().partition("boat", "shore");
        at.all.run_until([&] { return left == 1; });
        at.all.world.net().heal_all();
    }
    CHECK(left == 1);
    CHECK_FALSE(services.find_publication("watched"));
}

TEST_CASE("a subscriber whose acceptance withdraws the service is refused, and its provider hears that it left") {
    fixture at;
    int left = 0;
    ise::publication_callbacks<ise::subscription<fix, area, granted>> callbacks;
    callbacks.on_subscribe = [&](const area&, const ise::subscriber_info&) -> ise::result<granted> {
        at.boat.services->services().remove("watched");
        return granted{1};
    };
    callbacks.on_unsubscribe = [&](const auto&, const ise::subscriber_info&) {
        ++left;
        return ise::nothing{};
    };
    auto out = at.boat.publish(watched, std::move(callbacks));
    auto subscribe = [](ise::remote from) -> ise::task<int> {
        area wanted{"bay"};
        auto stream = co_await from.subscribe(watched, wanted, ise::subscribe_options());
        co_return stream.response().number;
    };
    auto subscribing = start(at.shore.on, subscribe(at.there));
    at.all.run_until([&] { return subscribing->done; });
    CHECK(subscribing->code() == errc::no_such_service);
    CHECK(out.subscribers() == 0);
    CHECK(left == 1);
}

TEST_CASE("a subscription to what is not there, or is another kind of service, is refused") {
    fixture at;
    at.boat.provide(helm, [](set_mode) { return mode_set{}; });
    for (const char* name : {"nowhere", "helm"}) {
        auto subscribe = [](ise::remote from, std::string what) -> ise::task<> {
            ise::subscription<fix> contract(what);
            auto fixes = co_await from.subscribe(contract);
        };
        auto got = start(at.shore.on, subscribe(at.there, name));
        at.all.run_until([&] { return got->done; });
        CHECK_THROWS_WITH(got->get(), Contains(name) && Contains("service"));
    }
}

TEST_CASE("every policy of a subscriber that does not take its packets") {
    fixture at;
    SECTION("keep latest: only the newest, the gap counted") {
        auto got = at.sit(ise::subscribe_options::keep_latest());
        for (int i = 1; i <= 5; ++i) {
            at.publish(i, i);
            at.settle();
        }
        drain(*got);
        CHECK(got->packets == range(5, 5));
        CHECK(got->gaps == std::vector<std::optional<std::uint64_t>>{4});
        CHECK(got->stream->counts().lost_here == 4);
    }
    SECTION("keep latest within one turn: dropped at the provider, before it is written") {
        auto got = at.sit(ise::subscribe_options::keep_latest());
        at.publish(1, 5);
        at.settle();
        drain(*got);
        CHECK(got->packets == range(5, 5));
        CHECK(got->gaps == std::vector<std::optional<std::uint64_t>>{4});
        CHECK(got->stream->counts().lost_at_provider == 4);
        CHECK(at.boat.services->counts().packets_dropped == 4);
    }
    SECTION("keep the last few") {
        auto got = at.sit(ise::subscribe_options::keep_last(3));
        for (int i = 1; i <= 10; ++i) {
            at.publish(i, i);
            at.settle();
        }
        drain(*got);
        CHECK(got->packets == range(8, 10));
        CHECK(got->gaps == std::vector<std::optional<std::uint64_t>>{7, 0, 0});
    }
    SECTION("lossless: the provider holds back, credits let it go on, and a publisher that waits is not overtaken") {
        auto got = at.sit(ise::subscribe_options::lossless(4));
        auto send = [](ise::publication<ise::subscription<fix>> out, int first, int last) -> ise::task<> {
            for (int i = first; i <= last; ++i) {
                auto packet = at_latitude(i);
                co_await out.send(packet);
            }
        };
        auto sending = start(at.boat.on, send(at.fixes, 1, 20));
        at.settle();
        CHECK_FALSE(sending->done);
        CHECK(at.fixes.published() == 8); // four here, four held back there
        for (int i = 0; i < 10; ++i) {
            drain(*got);
            at.settle();
        }
        CHECK(sending->done);
        CHECK(got->packets == range(1, 20));
        CHECK(std::count(got->gaps.begin(), got->gaps.end(), 0u) == 20);
    }
    SECTION("lossless: beyond what the provider may hold back it ends, and says so") {
        auto got = at.sit(ise::subscribe_options::lossless(4));
        at.publish(1, 4);
        at.settle();
        at.publish(5, 9);
        at.settle();
        drain(*got);
        CHECK(got->packets == range(1, 4));
        REQUIRE(got->stream->ended());
        CHECK(got->stream->cause().code() == errc::overloaded);
        CHECK(at.fixes.subscribers() == 0);
    }
    SECTION("disconnect: it ends at the first packet that would be lost") {
        auto got = at.sit(ise::subscribe_options::disconnect(2));
        for (int i = 1; i <= 3; ++i) {
            at.publish(i, i);
            at.settle();
        }
        REQUIRE(got->stream->ended());
        CHECK(got->stream->cause().code() == errc::overloaded);
        drain(*got);
        CHECK(got->packets == range(1, 2));
        CHECK(at.fixes.subscribers() == 0);
    }
}

namespace {

// Publishes with `send()`, and notes the longest time that one took.
ise::task<> send_steadily(ise::publication<ise::subscription<fix>> out, ise::loop& on, int count,
                          ise::duration& longest) {
    for (int i = 1; i <= count; ++i) {
        auto began = on.now();
        auto packet = at_latitude(i);
        co_await out.send(packet);
        longest = std::max(longest, on.now() - began);
        co_await ise::sleep_for(on, 10ms);
    }
}

// Every packet arrived, or is counted where the subscription ended.
void check_every_packet_or_the_end(const reading& got, std::uint64_t published) {
    CHECK(std::count(got.gaps.begin(), got.gaps.end(), 0u) == std::ptrdiff_t(got.gaps.size()));
    CHECK(got.packets == range(1, static_cast<int>(got.packets.size())));
    const auto& counts = got.stream->counts();
    if (!got.end) CHECK(got.packets.size() == published);
    else CHECK(got.packets.size() + counts.lost_at_provider == published);
}

} // namespace

TEST_CASE("a lossless subscriber that is out of reach holds up a publisher that waits for a second at most, and others "
          "hear everything") {
    fixture at;
    auto& far = at.all.add("far");
    auto healthy = std::make_shared<reading>();
    at.running.push_back(
        start(far.on, follow(far.at("tcp://boat:7400"), healthy, ise::subscribe_options::keep_last(5000))));
    auto got = at.read(ise::subscribe_options::lossless(4));
    at.all.run_until([&] { return at.fixes.subscribers() == 2; });
    ise::duration longest{};
    auto sending = start(at.boat.on, send_steadily(at.fixes, at.boat.on, 1000, longest));
    SECTION("its session is gone") {
        at.all.world.run_for(2s);
        at.all.world.net().partition("boat", "shore");
        for (auto& [raw, held] : at.boat.services->sessions())
            if (held->peer_name().find("far") == std::string::npos)
                held->wire().close(ise::failure(errc::peer_lost, "pulled"));
        CHECK(at.all.run_until([&] { return sending->done; }));
        CHECK(longest < 100ms);
    }
    SECTION("it is silent") {
        at.all.world.run_for(2s);
        at.all.world.net().partition("boat", "shore");
        CHECK(at.all.run_until([&] { return sending->done; }));
        CHECK(longest > 500ms);
        CHECK(longest <= 1100ms);
    }
    SECTION("it is only slow") {
        auto slow = std::make_shared<reading>();
        at.all.run(at.shore, hold(at.there, position, slow, ise::subscribe_options::lossless(4)));
        at.all.world.run_for(10s);
        CHECK_FALSE(slow->stream->ended());
        CHECK_FALSE(sending->done);
        while (!sending->done) {
            drain(*slow);
            at.all.world.run_for(50ms);
        }
        for (int i = 0; i < 4; ++i) {
            at.settle();
            drain(*slow);
        }
        CHECK(slow->packets == range(static_cast<int>(slow->packets.front()), 1000));
    }
    at.settle();
    CHECK(healthy->packets == range(1, 1000));
    at.all.world.net().heal_all();
    at.all.world.run_for(10s);
    check_every_packet_or_the_end(*got, 1000);
}

TEST_CASE(
    "a lossless subscription gets every packet over a lost session, or ends with the number of those that are lost") {
    fixture at;
    auto depth = GENERATE(1000u, 100u, 4u);
    auto got = at.read(ise::subscribe_options::lossless(depth));
    auto cut = GENERATE(false, true);
    INFO("depth " << depth << (cut ? ", cut" : ", silent"));
    int published = 0;
    auto publish_for = [&](int count) {
        for (int i = 0; i < count; ++i) {
            ++published;
            at.publish(published, published);
            at.all.world.run_for(10ms);
        }
    };
    publish_for(20);
    at.all.world.net().partition("boat", "shore");
    publish_for(1);
    if (cut)
        for (auto& [raw, held] : at.boat.services->sessions())
            held->wire().close(ise::failure(errc::peer_lost, "pulled"));
    publish_for(500);
    at.all.world.net().heal_all();
    at.all.world.run_for(10s);
    if (depth == 1000) CHECK_FALSE(got->end);
    if (depth == 4) {
        REQUIRE(got->end);
        CHECK(got->end->code() == (cut ? errc::overloaded : errc::peer_lost));
        CHECK_THAT(got->end->message(), Contains(std::to_string(got->stream->counts().lost_at_provider)));
        CHECK(at.fixes.subscribers() == 0);
    }
    if (!got->end) publish_for(20);
    at.settle();
    check_every_packet_or_the_end(*got, static_cast<std::uint64_t>(published));
}

TEST_CASE("whatever was under way when its session broke, a lossless subscription gets it once") {
    fixture at;
    auto got = at.read(ise::subscribe_options::lossless(200));
    at.all.world.net().between("boat", "shore").bandwidth_bytes_per_second = 2000;
    ise::duration longest{};
    auto sending = start(at.boat.on, send_steadily(at.fixes, at.boat.on, 300, longest));
    for (int cuts = 0; cuts < 20 && !sending->done; ++cuts) {
        at.all.world.run_for(700ms + std::chrono::milliseconds(13 * cuts));
        for (auto& [raw, held] : at.shore.services->sessions())
            held->wire().close(ise::failure(errc::peer_lost, "pulled"));
    }
    CHECK(at.all.run_until([&] { return sending->done; }));
    at.all.world.run_for(60s);
    REQUIRE_FALSE(got->packets.empty());
    CHECK(got->stream->counts().resumed > 0);
    check_every_packet_or_the_end(*got, 300);
}

TEST_CASE("a lossless subscription does not go on with a gap: beyond the linger and after a restart of the provider it "
          "ends") {
    ise::service_options options;
    options.linger = 10s;
    fixture at(options);
    auto got = at.read(ise::subscribe_options::lossless(100));
    at.publish(1, 3);
    at.settle();
    at.all.world.net().partition("boat", "shore");
    SECTION("beyond the linger the number is known") {
        at.all.run_until([&] { return at.fixes.subscribers() == 0; });
        at.publish(4, 9);
        at.all.world.net().heal_all();
        at.all.run_until([&] { return got->end.has_value(); });
        CHECK(got->end->code() == errc::peer_lost);
        CHECK_THAT(got->end->message(), Contains("6 packets are lost"));
        CHECK(got->stream->counts().lost_at_provider == 6);
    }
    SECTION("of another life it is not") {
        at.boat.services->stop(100ms);
        at.boat.scope.stop();
        at.all.world.run_for(5s);
        auto& second = at.all.add("boat");
        auto again = second.publish(position);
        second.listen("tcp://0.0.0.0:7400");
        at.all.world.net().heal_all();
        at.all.run_until([&] { return got->end.has_value(); });
        CHECK(got->end->code() == errc::peer_lost);
        CHECK_THAT(got->end->message(), Contains("unknown number"));
        CHECK(got->stream->counts().restarts == 1);
        CHECK(again.subscribers() == 0);
    }
    CHECK(got->packets == range(1, 3));
}

TEST_CASE("what the rate limit leaves out is counted apart from what was lost") {
    fixture at;
    ise::subscribe_options slow;
    slow.min_interval = 10s;
    auto got = at.read(slow);
    for (int i = 0; i < 50; ++i) {
        at.publish(i, i);
        at.all.world.run_for(1s);
    }
    CHECK(got->packets == std::vector<double>{0, 10, 20, 30, 40});
    CHECK(got->stream->counts().skipped == 36);
    CHECK(got->stream->counts().lost_at_provider == 0);
    CHECK(std::count(got->gaps.begin(), got->gaps.end(), 0u) == 5);
}

namespace {

struct heard_runs {
    std::string name;
    ise::subscribe_options options;
    shared_reading got = std::make_shared<reading>();
    std::uint64_t first = 0;  // of those published since it subscribed
    std::uint64_t passed = 0; // that were for others only
};

// Each number once and in order, and each that is missing is counted.
void check_run(const heard_runs& one, std::uint64_t published) {
    INFO(one.name);
    const auto& got = *one.got;
    REQUIRE(got.packets.size() == got.gaps.size());
    std::uint64_t lost = 0;
    for (const auto& gap : got.gaps) lost += gap.value();
    const auto& counts = got.stream->counts();
    CHECK(got.packets.size() + lost + counts.skipped == published - one.first);
    CHECK(counts.skipped == one.passed);
    CHECK(std::is_sorted(got.packets.begin(), got.packets.end(), std::less_equal<>()));
    if (!got.packets.empty()) CHECK(got.packets.back() == static_cast<double>(published));
    if (one.options.policy != ise::overflow::lossless) return;
    INFO((got.stream->ended() ? got.stream->cause().message() : std::string()));
    CHECK_FALSE(got.stream->ended());
    CHECK(lost == 0);
}

constexpr ise::subscription<fix> ports[] = {ise::subscription<fix>("north"), ise::subscription<fix>("south")};

// Two publications of one session, with little memory for it where the seed is even.
void play_bursts(unsigned seed) {
    INFO("seed " << seed);
    std::mt19937 random(seed);
    auto draw = [&](unsigned below) { return random() % below; };
    ise::service_options options;
    if (seed % 2 == 0) options.session_bytes = 1024; // four times as much may wait
    sim_parties all(seed);
    party& boat = all.add("boat", options);
    party& shore = all.add("shore");
    ise::publication<ise::subscription<fix>> out[] = {boat.publish(ports[0]), boat.publish(ports[1])};
    boat.listen("tcp://0.0.0.0:7400");
    std::vector<heard_runs> hearers[2];
    const ise::subscribe_options policies[] = {
        ise::subscribe_options::lossless(200), ise::subscribe_options::keep_last(300),
        ise::subscribe_options::keep_last(5), ise::subscribe_options::keep_latest()};
    auto subscribe = [&](unsigned port) {
        heard_runs made{fmt::format("{} of {}", hearers[port].size(), port), policies[draw(4)]};
        if (seed % 2 == 0 && draw(2)) made.options = policies[0];
        made.options.last_value = false;
        all.run(shore, hold(shore.at("tcp://boat:7400"), ports[port], made.got, made.options));
        made.first = out[port].published();
        hearers[port].push_back(std::move(made));
    };
    for (unsigned port : {0u, 1u, 0u, 1u}) subscribe(port);
    for (int round = 0; round < 30; ++round) {
        {
            ise::loop::turn in(boat.on);
            for (auto bursts = draw(6); bursts > 0; --bursts) {
                const auto port = draw(2);
                auto& to = out[port];
                const auto whom = 1 + draw(2);
                const bool for_some =
                    draw(2) && hearers[port][whom - 1].options.policy != ise::overflow::lossless; // it may overflow
                for (auto packets = draw(60); packets > 0; --packets) {
                    auto packet = at_latitude(static_cast<double>(to.published() + 1));
                    if (!to.try_send(packet)) break;
                    if (!for_some || draw(8) != 0) continue;
                    to.publish_if(at_latitude(static_cast<double>(to.published() + 1)),
                                  [&](const ise::subscriber_info& who) { return who.number == whom; });
                    for (std::size_t place = 0; place < hearers[port].size(); ++place)
                        if (place + 1 != whom) ++hearers[port][place].passed;
                }
            }
        }
        if (draw(3) == 0) all.world.run_for(std::chrono::milliseconds(1 + draw(50)));
        if (draw(3) == 0)
            for (auto& port : hearers)
                for (auto& one : port) drain(*one.got);
        if (draw(10) == 0) subscribe(static_cast<unsigned>(draw(2)));
    }
    for (unsigned port : {0u, 1u}) {
        while (true) { // one that everybody gets
            all.world.run_for(100ms);
            for (auto& one : hearers[port]) drain(*one.got);
            ise::loop::turn in(boat.on);
            if (out[port].try_send(at_latitude(static_cast<double>(out[port].published() + 1)))) break;
        }
        for (int times = 0; times < 3; ++times) {
            all.world.run_for(100ms);
            for (auto& one : hearers[port]) drain(*one.got);
        }
        for (const auto& one : hearers[port]) check_run(one, out[port].published());
    }
    for (auto& port : hearers) port.clear();
    all.stop();
}

} // namespace

TEST_CASE("bursts reach each subscriber by its policy, whatever comes between their packets and however little memory "
          "there is") {
    for (unsigned seed = 1; seed <= 60; ++seed) play_bursts(seed);
}

namespace {

struct note {
    std::string text;
};
constexpr ise::subscription<note> notes("notes");
using note_stream = ise::subscriber<ise::subscription<note>>;

std::size_t take_all(note_stream& from) {
    std::size_t packets = 0;
    while (from.try_next()) ++packets;
    return packets;
}

// 40,000 bytes may wait for one session, so some 38 packets.
struct little_memory {
    static ise::service_options options() {
        ise::service_options made;
        made.session_bytes = 10'000;
        return made;
    }
    sim_parties all;
    party& boat = all.add("boat", options());
    ise::publication<ise::subscription<note>> out = boat.publish(notes);
    const note thousand{std::string(1000, 'x')};

    little_memory() { boat.listen("tcp://0.0.0.0:7400"); }
    note_stream subscribe(party& by, ise::subscribe_options options) {
        options.last_value = false;
        return all.run(by, by.at("tcp://boat:7400").subscribe(notes, options));
    }
};

} // namespace

TEST_CASE("what a publisher asks room for reaches a lossless subscriber, whoever takes the last bytes of its session") {
    little_memory at;
    auto& shore = at.all.add("shore");
    auto latest = at.subscribe(shore, ise::subscribe_options::keep_latest());
    auto lossless = at.subscribe(shore, ise::subscribe_options::lossless(30));
    std::size_t sent = 0;
    for (bool room = true; room && sent < 100; at.all.world.run_for(10ms)) {
        ise::loop::turn in(at.boat.on);
        room = at.out.try_send(at.thousand);
        sent += room;
    }
    CHECK(sent > 30);
    CHECK(sent < 45);
    std::size_t got = 0;
    for (int i = 0; i < 5; ++i) {
        got += take_all(lossless);
        at.all.world.run_for(1s);
    }
    CHECK(got == sent);
    CHECK_FALSE(lossless.ended());
}

TEST_CASE("lossless subscribers of other sessions do not take a session beyond its bytes") {
    little_memory at;
    auto& slow = at.all.add("slow");
    auto held = at.subscribe(slow, ise::subscribe_options::lossless(30));
    auto& fast = at.all.add("fast");
    std::vector<note_stream> others;
    for (int i = 0; i < 20; ++i) others.push_back(at.subscribe(fast, ise::subscribe_options::lossless(30)));
    while (!held.ended()) { // by a publisher that does not wait
        {
            ise::loop::turn in(at.boat.on);
            at.out(at.thousand);
        }
        at.all.world.run_for(10ms);
        for (auto& one : others) take_all(one);
        REQUIRE(at.out.published() < 100);
    }
    CHECK(at.out.published() < 45);
    CHECK(at.out.subscribers() == 20);
}

TEST_CASE("a slow subscriber does not slow another") {
    fixture at;
    auto& far = at.all.add("far");
    at.all.world.net().between("boat", "far").bandwidth_bytes_per_second = 120;
    auto slow = std::make_shared<reading>();
    auto slowly = start(far.on, follow(far.at("tcp://boat:7400"), slow, ise::subscribe_options::keep_last(4)));
    at.all.run_until([&] { return at.fixes.subscribers() == 1; });
    auto quick = at.read(ise::subscribe_options::keep_last(4));
    for (int i = 1; i <= 3000; ++i) {
        at.publish(i, i);
        at.all.world.run_for(10ms);
    }
    CHECK(quick->packets == range(1, 3000));
    CHECK(slow->packets.size() < 100);
    CHECK(at.boat.services->counts().packets_dropped > 0);
    at.all.world.net().between("boat", "far").bandwidth_bytes_per_second = 0;
    at.all.world.run_for(1h);
    CHECK(slow->packets.back() == 3000);
    std::uint64_t lost = 0;
    for (auto gap : slow->gaps) lost += gap.value();
    CHECK(lost + slow->packets.size() == 3000); // exact to the packet
    CHECK(slow->stream->counts().lost_at_provider == at.boat.services->counts().packets_dropped);
}

TEST_CASE("a subscription goes on after a cut and knows the gap exactly") {
    fixture at;
    auto got = at.read(ise::subscribe_options::keep_last(5));
    at.publish(1, 2);
    at.settle();
    at.all.world.net().partition("boat", "shore");
    for (int i = 3; i <= 30; ++i) {
        at.publish(i, i);
        at.all.world.run_for(500ms);
    }
    CHECK_FALSE(got->stream->connected());
    at.all.world.net().heal_all();
    at.all.world.run_for(20s);
    at.publish(31, 31);
    at.settle();
    REQUIRE_FALSE(got->packets.empty());
    CHECK(got->packets.back() == 31);
    std::uint64_t lost = 0;
    for (auto gap : got->gaps) lost += gap.value();
    CHECK(lost + got->packets.size() == 31);
    CHECK(std::is_sorted(got->packets.begin(), got->packets.end()));
    CHECK(got->stream->counts().resumed == 1);
    CHECK(got->stream->counts().restarts == 0);
    CHECK(at.fixes.subscribers() == 1);
}

namespace {

ise::task<> connect_and_drain(ise::remote to, reading& at) {
    [[maybe_unused]] auto connected = co_await to.connect(30s);
    drain(at);
}

} // namespace

TEST_CASE("packets that are taken in the turn of the new session count as credit there") {
    fixture at;
    auto got = at.sit(ise::subscribe_options::lossless(4));
    at.publish(1, 4); // as many as the subscriber has room for
    at.settle();
    at.cut();
    at.all.run_until([&] { return !got->stream->connected(); });
    at.all.run(at.shore, connect_and_drain(at.there, *got));
    at.publish(5, 7);
    at.settle();
    drain(*got);
    CHECK(got->packets == range(1, 7));
    CHECK_FALSE(got->stream->ended());
}

TEST_CASE("a resumed subscription does not get again a last value that had arrived before packets for some only") {
    fixture at;
    auto got = at.read(GENERATE(ise::subscribe_options(), ise::subscribe_options::keep_latest(),
                                ise::subscribe_options::lossless(10)));
    const auto publish_for = [&](int latitude, bool wanted) {
        at.fixes.publish_if(at_latitude(latitude), [&](const ise::subscriber_info&) { return wanted; });
        at.settle();
    };
    at.publish(1, 1);
    at.settle();
    publish_for(2, true);
    publish_for(3, false);
    at.cut();
    at.all.world.run_for(10s);
    CHECK(got->stream->counts().resumed == 1);
    CHECK(got->packets == range(1, 2));
}

TEST_CASE("packets for others are not lost ones, also where the packet behind them was lost with its session") {
    fixture at;
    auto got = at.read(ise::subscribe_options::keep_last(10));
    at.publish(1, 1);
    at.settle();
    at.all.world.net().partition("boat", "shore");
    for (int latitude : {2, 3})
        at.fixes.publish_if(at_latitude(latitude), [](const ise::subscriber_info&) { return false; });
    at.publish(4, 4);
    at.all.world.run_for(10s);
    at.all.world.net().heal_all();
    at.all.world.run_for(20s);
    at.publish(5, 5);
    at.settle();
    REQUIRE(got->stream->counts().resumed == 1);
    CHECK(got->packets == std::vector<double>{1, 4, 5});
    CHECK(got->gaps == std::vector<std::optional<std::uint64_t>>(3, 0));
    CHECK(got->stream->counts().skipped == 2);
}

TEST_CASE("a predicate may publish and end subscribers and throw, and its packet comes behind that") {
    fixture at;
    auto all = at.read(ise::subscribe_options::keep_last(100));
    auto impatient = at.sit(ise::subscribe_options::disconnect(1));
    {
        ise::loop::turn in(at.boat.on);
        at.fixes.publish_if(at_latitude(5), [&](const ise::subscriber_info& who) {
            if (who.number == 1)
                for (int first = 1; first <= 4; ++first) at.fixes(at_latitude(first));
            return true;
        });
        const auto thrower = [](const ise::subscriber_info&) -> bool { throw std::runtime_error("undecided"); };
        CHECK_THROWS_AS(at.fixes.publish_if(at_latitude(0), thrower), std::runtime_error);
        at.fixes(at_latitude(6));
    }
    at.settle();
    CHECK(all->packets == range(1, 6));
    CHECK(all->gaps == std::vector<std::optional<std::uint64_t>>(6, 0));
    CHECK(impatient->stream->ended());
    CHECK(at.fixes.published() == 6);
}

TEST_CASE("a subscriber that does not come back within the linger is forgotten, and told so when it does") {
    ise::service_options options;
    options.linger = 10s;
    fixture at(options);
    auto got = at.read();
    at.publish(1, 1);
    at.settle();
    at.all.world.net().partition("boat", "shore");
    at.all.run_until([&] { return at.fixes.subscribers() == 0; });
    at.publish(2, 5);
    at.all.world.net().heal_all();
    at.all.run_until([&] { return at.fixes.subscribers() == 1; });
    at.settle();
    CHECK(got->packets.back() == 5);
    CHECK(!got->gaps.back());
    CHECK(got->stream->counts().restarts == 1);
}

TEST_CASE("a restarted provider is a gap of unknown length") {
    sim_parties all;
    auto& shore = all.add("shore");
    auto& first = all.add("boat");
    auto fixes = first.publish(position);
    first.listen("tcp://0.0.0.0:7400");
    auto got = std::make_shared<reading>();
    auto following = start(shore.on, follow(shore.at("tcp://boat:7400"), got, ise::subscribe_options()));
    all.run_until([&] { return fixes.subscribers() == 1; });
    fixes(at_latitude(1));
    all.world.run_for(1s);
    first.services->stop(1s);
    first.scope.stop();
    all.world.run_for(1s);
    auto& second = all.add("boat");
    auto again = second.publish(position);
    again(at_latitude(7));
    second.listen("tcp://0.0.0.0:7400");
    all.world.run_for(20s);
    again(at_latitude(8));
    all.world.run_for(1s);
    CHECK(got->packets == std::vector<double>{1, 7, 8});
    CHECK(got->gaps == std::vector<std::optional<std::uint64_t>>{0, std::nullopt, 0});
    CHECK(got->stream->counts().restarts == 1);
    CHECK_FALSE(got->end);
}

TEST_CASE("a packet is encoded once, however many subscribe") {
    fixture at;
    auto out = at.boat.publish(watch);
    auto subscribing = [&]() -> ise::task<ise::subscriber<ise::subscription<watchful>>> {
        auto stream = co_await at.there.subscribe(watch);
        co_return stream;
    };
    std::vector<ise::subscriber<ise::subscription<watchful>>> all;
    for (int i = 0; i < 8; ++i) all.push_back(at.all.run(at.shore, subscribing()));
    watchful::written = 0;
    out(watchful{5});
    at.settle();
    CHECK(watchful::written == 1);
    for (auto& one : all) {
        auto packet = one.try_next();
        REQUIRE(packet);
        CHECK(packet->number == 5);
    }
}

TEST_CASE("order holds within a subscription although big packets go in pieces and small ones do not") {
    fixture at;
    at.all.world.net().between("boat", "shore").bandwidth_bytes_per_second = 10 << 20;
    auto out = at.boat.publish(pictures);
    auto take = [](ise::remote from, std::vector<std::size_t>& sizes, std::size_t count) -> ise::task<> {
        auto stream = co_await from.subscribe(pictures, ise::subscribe_options::keep_last(100));
        while (sizes.size() < count) {
            auto packet = co_await stream.next();
            if (!packet) break;
            sizes.push_back(packet->content.size());
        }
    };
    std::vector<std::size_t> sizes;
    auto taking = start(at.shore.on, take(at.there, sizes, 40));
    at.all.run_until([&] { return out.subscribers() == 1; });
    std::vector<std::size_t> sent;
    for (std::size_t i = 0; i < 40; ++i) {
        blob picture;
        picture.content.resize(i % 3 == 0 ? 300'000 + i : i);
        sent.push_back(picture.content.size());
        out(picture);
        at.all.world.run_for(5ms);
    }
    REQUIRE(at.all.run_until([&] { return taking->done; }));
    CHECK(sizes == sent);
}

TEST_CASE("a packet that was partly sent when its subscription ended counts as lost") {
    sim_parties all;
    auto& boat = all.add("boat");
    auto& shore = all.add("shore");
    auto out = boat.publish(notes);
    boat.listen("tcp://0.0.0.0:7400");
    std::optional<note_stream> stream;
    auto subscribe = [](ise::remote to, std::optional<note_stream>& into) -> ise::task<> {
        into.emplace(co_await to.subscribe(notes, ise::subscribe_options::lossless(3)));
    };
    all.run(shore, subscribe(shore.at("tcp://boat:7400"), stream));
    all.world.net().between("boat", "shore").bandwidth_bytes_per_second = 500'000;
    const note large{std::string(2'000'000, 'x')};
    std::size_t taken = 0;
    for (int published = 0; published < 6; ++published) {
        out(large);
        all.world.run_for(1s);
        taken += take_all(*stream);
    }
    all.world.run_for(60s);
    taken += take_all(*stream);
    REQUIRE(stream->ended());
    CHECK(taken + stream->counts().lost_at_provider == 6);
    stream.reset();
}

TEST_CASE("leaving in the middle of a big packet leaves the session whole") {
    fixture at;
    at.all.world.net().between("boat", "shore").bandwidth_bytes_per_second = 1 << 20;
    auto out = at.boat.publish(pictures);
    auto take = [](ise::remote from, ise::loop& on) -> ise::task<> {
        auto stream = co_await from.subscribe(pictures);
        co_await ise::sleep_for(on, 2s);
    };
    auto taking = start(at.shore.on, take(at.there, at.shore.on));
    at.all.run_until([&] { return out.subscribers() == 1; });
    blob picture;
    picture.content.resize(8 << 20);
    out(picture);
    at.all.run_until([&] { return taking->done; });
    auto got = at.read();
    at.publish(1, 3);
    at.all.world.run_for(20s);
    CHECK(got->packets == range(1, 3));
    CHECK(out.subscribers() == 0);
    CHECK(at.boat.services->counts().sessions_accepted == 1);
}

TEST_CASE("dropping the stream unsubscribes, and one that waits ends with its component") {
    fixture at;
    auto got = at.read();
    got->stream->unsubscribe();
    at.settle();
    CHECK(at.fixes.subscribers() == 0);
    REQUIRE(got->end);
    CHECK(got->end->code() == errc::cancelled);

    auto again = at.read();
    at.boat.services->services().remove("position");
    at.settle();
    REQUIRE(again->end);
    CHECK(again->end->code() == errc::no_such_service);
}

namespace {

struct goodbye {
    std::string ticket;
};
struct receipt {
    std::string text = "default";
};
constexpr ise::subscription<fix, area, granted, goodbye, receipt> rented("rented");

template <class Stream, class Request>
ise::task<receipt> leave_with(Stream& stream, Request request) {
    auto answer = co_await stream.unsubscribe(std::move(request), 2s);
    co_return answer;
}

} // namespace

TEST_CASE("who leaves may say something, and gets the provider's answer") {
    std::vector<std::string> heard; // also from who leaves at the end
    fixture at;
    ise::publication_callbacks<ise::subscription<fix, area, granted, goodbye, receipt>> callbacks;
    callbacks.on_unsubscribe = [&](const goodbye& said, const ise::subscriber_info&) {
        heard.push_back(said.ticket);
        if (said.ticket == "forged") throw std::runtime_error("no such ticket");
        return receipt{"paid " + said.ticket};
    };
    auto out = at.boat.publish(rented, std::move(callbacks));
    auto subscribe = [&]() -> ise::task<ise::subscriber<ise::subscription<fix, area, granted, goodbye, receipt>>> {
        auto stream = co_await at.there.subscribe(rented);
        co_return stream;
    };
    auto stream = at.all.run(at.shore, subscribe());
    SECTION("it is answered") {
        CHECK(at.all.run(at.shore, leave_with(stream, goodbye{"42"})).text == "paid 42");
        CHECK(heard == std::vector<std::string>{"42"});
        CHECK(stream.ended());
        CHECK(stream.cause().code() == errc::cancelled);
        auto again = start(at.shore.on, leave_with(stream, goodbye{"43"}));
        at.all.run_until([&] { return again->done; });
        CHECK(again->code() == errc::cancelled);
        CHECK(heard.size() == 1);
    }
    SECTION("dropping it says the default") {
        stream = {};
        at.settle();
        CHECK(heard == std::vector<std::string>{""});
    }
    SECTION("a callback that throws answers nothing") {
        auto leaving = start(at.shore.on, leave_with(stream, goodbye{"forged"}));
        at.all.run_until([&] { return leaving->done; });
        CHECK(leaving->code() == errc::handler_failed);
    }
    SECTION("a session that breaks meanwhile is told") {
        at.all.world.net().partition("boat", "shore");
        auto leaving = start(at.shore.on, leave_with(stream, goodbye{"42"}));
        at.all.world.run_for(1s);
        for (auto& [raw, held] : at.shore.services->sessions())
            held->wire().close(ise::failure(errc::peer_lost, "pulled"));
        at.all.run_until([&] { return leaving->done; });
        CHECK(leaving->code() == errc::peer_lost);
    }
    SECTION("out of reach it is left without a word") {
        at.all.world.net().partition("boat", "shore");
        at.all.run_until([&] { return !stream.connected(); });
        auto leaving = start(at.shore.on, leave_with(stream, goodbye{"42"}));
        at.all.run_until([&] { return leaving->done; });
        CHECK(leaving->code() == errc::peer_lost);
        CHECK(stream.ended());
    }
    SECTION("who gives up waiting leaves nothing behind") {
        at.all.world.net().partition("boat", "shore");
        auto leaving = start(at.shore.on, leave_with(stream, goodbye{"42"}));
        at.all.world.run_for(100ms);
        leaving->cancel.emit(asio::cancellation_type::terminal);
        at.all.run_until([&] { return leaving->done; });
        at.all.world.net().heal_all();
        at.settle();
        CHECK(heard == std::vector<std::string>{"42"});
    }
    at.all.world.net().heal_all();
}

TEST_CASE("a subscribe or unsubscribe packet beyond what its receiver accepts is refused, and the session stays") {
    ise::service_options modest;
    modest.accepts.max_message_bytes = 100'000;
    const bool at_provider = GENERATE(true, false); // who accepts little
    sim_parties all;
    auto& boat = all.add("boat", at_provider ? modest : ise::service_options());
    auto& shore = all.add("shore", at_provider ? ise::service_options() : modest);
    using contract = ise::subscription<fix, area, receipt, goodbye, receipt>;
    constexpr contract parcels("parcels");
    const std::string large(200'000, 'x');
    std::vector<std::size_t> heard;
    ise::publication_callbacks<contract> callbacks;
    callbacks.on_subscribe = [&](const area& where, const ise::subscriber_info&) -> ise::result<receipt> {
        return receipt{where.name == "far" ? large : where.name};
    };
    callbacks.on_unsubscribe = [&](const goodbye& said, const ise::subscriber_info&) {
        heard.push_back(said.ticket.size());
        return receipt{said.ticket == "all" ? large : "paid"};
    };
    auto out = boat.publish(parcels, std::move(callbacks));
    boat.listen("tcp://0.0.0.0:7400");
    auto there = shore.at("tcp://boat:7400");
    auto subscribe = [](ise::remote to, contract what, std::string name) -> ise::task<ise::subscriber<contract>> {
        area where{std::move(name)};
        auto stream = co_await to.subscribe(what, where, ise::subscribe_options());
        co_return stream;
    };
    auto leave = [](ise::subscriber<contract>& stream, std::string ticket) -> ise::task<receipt> {
        goodbye said{std::move(ticket)};
        auto answer = co_await stream.unsubscribe(said);
        co_return answer;
    };
    auto refused = [&](const auto& what) {
        const auto began = all.world.now();
        REQUIRE(all.run_until([&] { return what->done; }));
        CHECK(all.world.now() - began < 100ms);
        CHECK_THROWS_WITH(what->get(), Contains("accepts 100000 (max_message_bytes)"));
        CHECK(what->code() == errc::too_large);
    };
    auto stream = all.run(shore, subscribe(there, parcels, "near"));
    CHECK(stream.response().text == "near");
    if (at_provider) {
        refused(start(shore.on, subscribe(there, parcels, large)));
        CHECK(out.subscribers() == 1);
        refused(start(shore.on, leave(stream, large)));
        all.world.run_for(1s);
        CHECK(heard == std::vector<std::size_t>{0}); // it has left, by the default
    } else {
        refused(start(shore.on, subscribe(there, parcels, "far")));
        CHECK(heard == std::vector<std::size_t>{0});
        CHECK(out.subscribers() == 1);
        auto leaving = start(shore.on, leave(stream, "all"));
        REQUIRE(all.run_until([&] { return leaving->done; }));
        CHECK(leaving->code() == errc::handler_failed); // it has left, without an answer
        CHECK(heard == std::vector<std::size_t>{0, 3});
    }
    CHECK(out.subscribers() == 0);
    CHECK(boat.services->counts().sessions_accepted == 1);
}

TEST_CASE("a subscription that ends other than by its user's wish is logged with its reason, and known until it is "
          "made again") {
    fixture at;
    auto got = at.sit(ise::subscribe_options::lossless(4));
    at.publish(1, 4);
    at.settle();
    at.publish(5, 9);
    at.settle();
    REQUIRE(got->stream->ended());
    REQUIRE(at.shore.warnings.size() == 1);
    CHECK_THAT(at.shore.warnings.front(), Contains("'position'") && Contains("5 are lost"));
    const auto& known = at.shore.services->ended_subscriptions();
    REQUIRE(known.size() == 1);
    CHECK(known.front().service == "position");
    CHECK(known.front().provider == "tcp://boat:7400");
    auto next = at.sit(ise::subscribe_options::lossless(4));
    CHECK(known.empty());
    next->stream->unsubscribe();
    at.settle();
    CHECK(known.empty());
    CHECK(at.shore.warnings.size() == 1);
}

TEST_CASE("a subscription over the peer's own session ends with it") {
    sim_parties all;
    auto& boat = all.add("boat");
    auto& shore = all.add("shore"); // listens nowhere, and publishes
    auto fixes = shore.publish(position);
    boat.provide(helm, [](set_mode) { return mode_set{}; });
    boat.listen("tcp://0.0.0.0:7400");
    auto there = shore.at("tcp://boat:7400"); // the session lives as long as somebody may talk over it
    all.run(shore, there.connect(5s)).value();
    auto back = ise::remote(boat.services->link_back(boat.services->sessions().begin()->second));
    auto got = std::make_shared<reading>();
    auto following = start(boat.on, follow(back, got, ise::subscribe_options()));
    all.run_until([&] { return fixes.subscribers() == 1; });
    fixes(at_latitude(1));
    all.world.run_for(1s);
    CHECK(got->packets == range(1, 1));
    shore.services->sessions().begin()->second->wire().close(ise::failure(errc::peer_lost, "pulled"));
    all.run_until([&] { return following->done; });
    REQUIRE(got->end);
    CHECK(got->end->code() == errc::peer_lost);
}

TEST_CASE("packets that cannot be decoded are a gap before the next one") {
    fixture at;
    auto out = at.boat.publish(numbers);
    auto subscribing = [&]() -> ise::task<ise::subscriber<ise::subscription<picky>>> {
        auto stream = co_await at.there.subscribe(numbers);
        co_return stream;
    };
    auto taken = at.all.run(at.shore, subscribing());
    for (int number : {1, 13, 13, 2, 13}) out(picky{number});
    at.settle();
    auto first = taken.try_next();
    auto second = taken.try_next();
    REQUIRE(first);
    REQUIRE(second);
    CHECK(first->number == 1);
    CHECK(first.lost_before() == 0);
    CHECK(second->number == 2);
    CHECK(second.lost_before() == 2);
    CHECK_FALSE(taken.try_next());
    CHECK(taken.counts().undecodable == 3);
    CHECK(taken.counts().received == 2);
    REQUIRE(at.shore.warnings.size() == 1); // one is enough
    CHECK_THAT(at.shore.warnings.front(), Contains("bad luck"));
    out(picky{3});
    at.settle();
    auto third = taken.try_next();
    REQUIRE(third);
    CHECK(third.lost_before() == 1);
}

TEST_CASE("a packet that is kept stays as it was while others come") {
    fixture at;
    auto got = at.sit(ise::subscribe_options::keep_last(8));
    at.publish(1, 5);
    at.settle();
    std::vector<ise::received<fix>> kept;
    while (auto packet = got->stream->try_next()) kept.push_back(packet);
    auto shared = kept.at(1).share();
    kept.erase(kept.begin() + 1);
    at.publish(6, 8);
    at.settle();
    while (auto packet = got->stream->try_next()) kept.push_back(packet);
    std::vector<double> latitudes;
    for (const auto& packet : kept) latitudes.push_back(packet->latitude_deg);
    CHECK(latitudes == std::vector<double>{1, 3, 4, 5, 6, 7, 8});
    CHECK(shared->latitude_deg == 2);
}

} // namespace subscriptions_test
