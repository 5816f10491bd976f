// The bridge on the virtual world: a broker that goes away for minutes, forgets, is cut off in between, and refuses.
#include <components/mqtt_bridge/mqtt_bridge.hpp>

#include <ise/database/database.hpp>

#include <support/catch.hpp>
#include <unit/name_server/odd_service.hpp>
#include <unit/name_server/system.hpp>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace mqtt_test {
namespace {

using namespace ise::mqtt;
using namespace names_test;
using namespace std::chrono_literals;
using nlohmann::json;

/// A broker with one client and a subscriber to everything. It takes 20 ms for each message, in order.
struct model_broker {
    struct delivered {
        message what;
        ise::time_point at;
        std::string property(const std::string& name) const {
            for (const auto& [key, value] : what.user)
                if (key == name) return value;
            return {};
        }
        std::int64_t value() const { return json::parse(what.payload).at("value").get<std::int64_t>(); }
    };
    struct line {
        session_events events;
        bool open = true;
    };

    const std::vector<delivered>& of(const std::string& topic) { return by_topic[topic]; }
    void cut() {
        if (auto was = std::exchange(present, nullptr)) {
            was->open = false;
            was->events.closed(ise::failure(ise::errc::peer_lost, "cut"));
        }
    }

    bool away = false;
    bool deaf = false; ///< messages come, and are not confirmed
    std::function<std::optional<ise::failure>(const message&, bool& later)> refuses;
    std::shared_ptr<line> present;
    std::map<std::string, std::vector<delivered>> by_topic;
    std::size_t messages = 0;
    int connections = 0;
};

class model_session final : public broker_session {
public:
    model_session(ise::component& self, std::shared_ptr<model_broker> to, std::shared_ptr<model_broker::line> over)
        : self_(self), to_(std::move(to)), over_(std::move(over)) {}
    ~model_session() override {
        over_->open = false;
        if (to_->present == over_) to_->present = nullptr;
    }
    ise::result<int> publish(const message& what) override {
        if (!over_->open) return ise::failure(ise::errc::peer_lost, "cut");
        self_.spawn("message", carry(self_, to_, over_, what, ++last_));
        return last_;
    }
    ise::result<void> subscribe(const std::string&) override { return {}; }

private:
    static ise::task<> carry(ise::component& self, std::shared_ptr<model_broker> to,
                             std::shared_ptr<model_broker::line> over, message what, int token) {
        co_await self.sleep(20ms);
        if (!over->open) co_return;
        bool later = false;
        std::optional<ise::failure> why;
        if (to->refuses) why = to->refuses(what, later);
        if (!why) {
            ++to->messages;
            auto& made = to->by_topic[what.topic].emplace_back();
            made.what = std::move(what);
            made.at = self.now();
        }
        if (!to->deaf) over->events.confirmed(token, why, later);
    }

    ise::component& self_;
    std::shared_ptr<model_broker> to_;
    std::shared_ptr<model_broker::line> over_;
    int last_ = 0;
};

broker_connector connector_to(std::shared_ptr<model_broker> to) {
    return [to](ise::component& self, broker_options,
                session_events events) -> ise::task<ise::result<std::unique_ptr<broker_session>>> {
        co_await self.sleep(50ms);
        if (to->away) co_return ise::failure(ise::errc::unreachable, "nobody is there");
        ++to->connections;
        auto over = std::make_shared<model_broker::line>();
        over->events = std::move(events);
        to->present = over;
        std::unique_ptr<broker_session> made = std::make_unique<model_session>(self, to, over);
        co_return made;
    };
}

struct words {
    std::string value;
};
inline constexpr ise::subscription<words> text{"text"};

struct coast {
    explicit coast(std::uint64_t seed = 1, std::vector<std::string> queued = {"count"}) : in(true, seed) {
        options.connect = connector_to(broker);
        options.queued = std::move(queued);
        options.store = "memory:mqtt-coast-" + std::to_string(seed);
        disk.emplace(ise::database::open(options.store, bridge_schema).value());
        bridge = &in.start("shore", "bridge",
                           [this](ise::node& node) { node.start<mqtt_bridge>("ise/mqtt", everywhere(), options); });
        in.start_doubler("boat", "atirma/boat");
    }
    void run(ise::duration time) { in.world.run_for(time); }
    bool until(const std::function<bool()>& done, ise::duration within = 1min) {
        return in.world.run_until(done, within);
    }
    static constexpr const char* topic = "ise/out/atirma/boat/count";
    std::int64_t last() const {
        const auto& got = broker->of(topic);
        return got.empty() ? 0 : got.back().value();
    }

    bridge_options options;
    std::shared_ptr<model_broker> broker = std::make_shared<model_broker>();
    std::optional<ise::database> disk; // outlives a bridge that is killed
    names_test::system in;
    ise::sim::process* bridge = nullptr;
};

/// In order, each once, whatever was sent again; those that came again are marked.
std::vector<std::int64_t> once(const std::vector<model_broker::delivered>& all) {
    std::vector<std::int64_t> made;
    std::set<std::string> numbers;
    for (const auto& one : all) {
        if (numbers.insert(one.property("number")).second) made.push_back(one.value());
        else CHECK(one.property("resent") == "true");
    }
    return made;
}

void check_whole(const std::vector<std::int64_t>& values) {
    REQUIRE_FALSE(values.empty());
    for (std::size_t at = 1; at < values.size(); ++at) {
        if (values[at] == values[at - 1] + 1) continue;
        FAIL("after " << values[at - 1] << " comes " << values[at]);
    }
}

} // namespace

TEST_CASE("an outage of ten minutes: every packet of a queued service comes, once and in order, as history") {
    for (std::uint64_t seed : {1u, 2u, 3u}) {
        coast here(seed);
        REQUIRE(here.until([&] { return here.last() > 20; }));
        here.broker->deaf = true; // some arrive, and nobody knows
        here.run(3s);
        here.broker->away = true;
        here.broker->cut();
        const auto before = here.broker->messages;
        here.run(10min);
        CHECK(here.broker->messages == before);
        here.broker->deaf = here.broker->away = false;
        const auto back = here.broker->connections;
        REQUIRE(here.until([&] { return here.broker->connections > back; }));
        const auto connected = here.in.world.now();
        REQUIRE(here.until([&] {
            const auto& got = here.broker->of(coast::topic);
            return !got.empty() && got.back().property("history").empty() && got.size() > 6000;
        }));
        auto got = here.broker->of(coast::topic);
        auto values = once(got);
        check_whole(values);
        CHECK(values.size() > 6000);
        std::size_t old = 0;
        std::set<std::string> times;
        for (const auto& one : got) {
            times.insert(one.property("published"));
            if (one.property("history").empty()) continue;
            ++old;
            CHECK(one.at >= connected);
        }
        CHECK(old > 5900);
        CHECK(times.size() > 5900); // each its own
    }
}

TEST_CASE("a broker that is cut off again and again: nothing is lost, what may come twice is marked") {
    for (std::uint64_t seed : {11u, 12u, 13u, 14u}) {
        coast here(seed);
        REQUIRE(here.until([&] { return here.last() > 5; }));
        for (int n = 0; n < 30; ++n) {
            here.run(std::chrono::milliseconds(37 * static_cast<int>(seed) + 211 * n));
            here.broker->deaf = n % 3 == 0;
            here.broker->cut();
        }
        here.broker->deaf = false;
        const auto last = here.last();
        REQUIRE(here.until([&] { return here.last() > last + 200; }));
        check_whole(once(here.broker->of(coast::topic)));
    }
}

TEST_CASE("a bridge that is killed during the outage sends what was on disk, and numbers are not used again") {
    coast here;
    REQUIRE(here.until([&] { return here.last() > 5; }));
    here.broker->away = true;
    here.broker->cut();
    here.run(1min);
    here.bridge = &here.bridge->restart();
    here.run(1min);
    here.broker->away = false;
    REQUIRE(here.until([&] { return here.last() > 1150; }));
    auto got = here.broker->of(coast::topic);
    auto values = once(got);
    CHECK(std::is_sorted(values.begin(), values.end()));
    // The last moment before it was killed, and the time until it is back.
    const auto missing =
        static_cast<std::int64_t>(values.back() - values.front()) + 1 - static_cast<std::int64_t>(values.size());
    CHECK(missing >= 0);
    CHECK(missing < 100);
    CHECK(std::adjacent_find(values.begin(), values.end()) == values.end());
}

TEST_CASE("of other services the latest counts: after an outage it is there at once, and no flood before it") {
    coast here(1, {});
    REQUIRE(here.until([&] { return here.last() > 20; }));
    here.broker->away = true;
    here.broker->cut();
    here.run(10min);
    const auto before = here.broker->of(coast::topic).size();
    const auto was = here.last();
    here.broker->away = false;
    REQUIRE(here.until([&] { return here.broker->of(coast::topic).size() > before; }));
    CHECK(here.last() - was > 5900);
    here.run(1s);
    auto got = here.broker->of(coast::topic);
    CHECK(got.size() - before <= 12); // ten a second
    CHECK(got[before].property("history") == "true");
    CHECK(got.back().property("history").empty());
    CHECK(got.back().what.retain);
    const auto status = here.broker->of("ise/status");
    CHECK(status.back().what.payload == "online");
}

TEST_CASE("of the newest packets of all services only so many bytes wait, and the others are counted") {
    coast here(1, {});
    here.bridge->crash();
    here.options.queue.newest_bytes = 10'000;
    here.bridge = &here.bridge->restart();
    here.broker->away = true;
    std::vector<std::string> topics;
    for (int n = 0; n < 8; ++n) {
        auto name = "chart" + std::to_string(n);
        topics.push_back("ise/out/test/" + name + "/text");
        here.in.start_body("boat", name, [](ise::component& self) -> ise::task<> {
            auto out = self.publish(text);
            for (;;) {
                co_await self.sleep(1s);
                words packet{std::string(2'000, 'x')};
                out(packet);
            }
        });
    }
    here.run(1min);
    here.broker->away = false;
    REQUIRE(here.until([&] { return here.last() > 0; }));
    here.run(100ms);
    auto sent = std::ranges::count_if(topics, [&](const auto& one) { return !here.broker->of(one).empty(); });
    CHECK(sent == 4);
    CHECK(std::ranges::any_of(here.in.warnings, [](const auto& one) { return one.find("newest_bytes") != one.npos; }));
}

TEST_CASE("what the broker does not want now is sent again, what it never wants is counted and told") {
    coast here;
    here.broker->refuses = [n = 0](const message& what, bool& later) mutable -> std::optional<ise::failure> {
        if (what.topic != coast::topic || ++n % 10 != 0) return std::nullopt;
        later = n < 100;
        return ise::failure(ise::errc::refused, later ? "quota exceeded" : "not authorized");
    };
    REQUIRE(here.until([&] { return here.last() > 300; }, 5min));
    std::optional<bridge_status> result;
    here.in.start_body("office", "asks", [&](ise::component& self) -> ise::task<> {
        auto bridge = co_await self.find("ise/mqtt");
        status_request request;
        result = co_await bridge.call(status_service, request);
    });
    REQUIRE(here.until([&] { return result.has_value(); }));
    CHECK(result->connected);
    CHECK(result->refused > 5);
    CHECK(result->trouble.find("not authorized") != std::string::npos);
    auto got = here.broker->of(coast::topic);
    std::set<std::int64_t> values;
    for (const auto& one : got) values.insert(one.value());
    std::int64_t missing = 0;
    for (auto value = *values.begin(); value < *values.rbegin(); ++value) missing += !values.contains(value);
    CHECK(missing <= static_cast<std::int64_t>(result->refused));
}

TEST_CASE("a component that goes takes its retained packets with it") {
    coast here(1, {});
    REQUIRE(here.until([&] { return here.last() > 5; }));
    auto& other = here.in.start_doubler("island", "atirma/beacon");
    const std::string topic = "ise/out/atirma/beacon/count";
    REQUIRE(here.until([&] { return here.broker->of(topic).size() > 5; }));
    other.crash();
    REQUIRE(here.until([&] { return here.broker->of(topic).back().what.payload.empty(); }, 5min));
    CHECK(here.broker->of(topic).back().what.retain);
}

TEST_CASE(
    "services that nobody can subscribe to, or whose packets are endless in JSON and protobuf, do not end the bridge") {
    const std::string nothing = "struct p{}";
    const std::string huge = "struct p{a:array<array<struct e{},65536>,65536>}"; // a packet of 0 bytes
    auto odd = GENERATE_COPY(std::pair(std::string("u8"), nothing), std::pair(nothing, huge));
    auto protobuf = GENERATE(false, true);
    CAPTURE(odd.first, odd.second, protobuf);
    coast here;
    here.bridge->crash();
    here.options.protobuf = protobuf;
    here.bridge = &here.bridge->restart();
    start_odd_service(here.in, "strange", "atirma/odd", odd.first, odd.second);
    here.run(10s);
    auto told =
        std::ranges::any_of(here.in.warnings, [](const auto& one) { return one.find("atirma/odd/odd") != one.npos; });
    CHECK(told);
    CHECK(here.bridge->running());
    auto before = here.broker->of(here.topic).size();
    here.run(5s);
    CHECK(here.broker->of(here.topic).size() > before + 20);
    CHECK(here.broker->of("ise/out/atirma/odd/odd").empty());
}

TEST_CASE("wrong options end the bridge with a reason") {
    names_test::system in;
    auto start = [&](const std::string& process, bridge_options options) {
        in.start("shore", process,
                 [options](ise::node& node) { node.start<mqtt_bridge>("ise/mqtt", everywhere(), options); });
        in.world.run_for(2s);
    };
    auto result = [&](const std::string& what) {
        return std::ranges::any_of(in.warnings, [&](const auto& line) { return line.find(what) != std::string::npos; });
    };
    bridge_options wildcard;
    wildcard.prefix = "a/+";
    start("wildcard", wildcard);
    CHECK(result("--prefix"));
    bridge_options old;
    old.broker.version_5 = false;
    old.allow_calls = true;
    start("old", old);
    CHECK(result("calls need MQTT 5"));
    bridge_options real; // libmosquitto on a virtual loop
    start("real", real);
    CHECK(result("needs the real world"));
}

} // namespace mqtt_test
