// The gateway on the virtual world: a viewer, components that come and go, outages at either side.
#include <components/foxglove_gateway/foxglove_gateway.hpp>

#include <ise/bag/protobuf.hpp>
#include <ise/component/live_parameters.hpp>
#include <ise/component/served_calls.hpp>
#include <ise/component/served_runs.hpp>
#include <ise/core/little_endian.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/service/action.hpp>
#include <ise/service/action_run.hpp>
#include <ise/service/action_runs.hpp>
#include <ise/service/dynamic.hpp>

#include <support/catch.hpp>
#include <unit/http/web_socket_client.hpp>
#include <unit/name_server/odd_service.hpp>
#include <unit/name_server/system.hpp>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstring>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace foxglove_test {
namespace {

using namespace ise::foxglove;
using namespace names_test;
using nlohmann::json;
using opcode = ise::web_socket_opcode;

std::uint32_t u32_of(std::string_view from, std::size_t at) {
    return ise::detail::load_little<std::uint32_t>(reinterpret_cast<const std::byte*>(from.data()) + at);
}
ise::wall_time time_in(std::string_view message, std::size_t at) {
    auto count = ise::detail::load_little<std::uint64_t>(reinterpret_cast<const std::byte*>(message.data()) + at);
    return ise::wall_time(std::chrono::nanoseconds(static_cast<std::int64_t>(count)));
}

/// What a viewer has been told.
struct watching {
    explicit watching(ise::sim::world& world, const std::string& host, std::string protocols = "foxglove.sdk.v1",
                      std::string headers = "")
        : line(world, host, "shore", 8765, std::move(protocols), std::move(headers)) {}

    void say(const json& what) { line.send(opcode::text, what.dump()); }
    void read() {
        for (; texts < line.texts.size(); ++texts) {
            auto parsed = json::parse(line.texts[texts]);
            auto op = parsed["op"].get<std::string>();
            if (op == "advertise")
                for (const auto& one : parsed["channels"]) channels[one["topic"]] = one;
            if (op == "unadvertise")
                for (const auto& id : parsed["channelIds"])
                    std::erase_if(channels, [&](const auto& one) { return one.second["id"] == id; });
            if (op == "advertiseServices")
                for (const auto& one : parsed["services"]) services[one["name"]] = one;
            all.push_back(std::move(parsed));
        }
    }
    bool has_channel(const std::string& topic) {
        read();
        return channels.contains(topic);
    }
    void subscribe(std::uint32_t id, const std::string& topic) {
        say({{"op", "subscribe"}, {"subscriptions", {{{"id", id}, {"channelId", channels.at(topic)["id"]}}}}});
    }
    std::optional<json> find(const std::string& op) {
        read();
        for (const auto& one : all)
            if (one["op"] == op) return one;
        return std::nullopt;
    }
    std::vector<web_socket_test::client::message> data() const {
        std::vector<web_socket_test::client::message> made;
        for (const auto& one : line.binaries)
            if (one.payload[0] == 1) made.push_back(one);
        return made;
    }
    static ise::duration age(const web_socket_test::client::message& one) { return one.came - time_in(one.payload, 5); }

    web_socket_test::client line;
    std::size_t texts = 0;
    std::vector<json> all;
    std::map<std::string, json> channels, services;
};

struct coast {
    explicit coast(gateway_options options = {}) {
        options.address = "0.0.0.0";
        in.start("shore", "gateway", [this, options](ise::node& node) {
            gateway = &node.start<foxglove_gateway>("atirma/foxglove", everywhere(), options);
        });
        boat = &in.start_doubler("boat", "atirma/boat");
    }
    watching& watch(const std::string& host = "office", std::string headers = "") {
        viewers.push_back(std::make_unique<watching>(in.world, host, "foxglove.sdk.v1", std::move(headers)));
        return *viewers.back();
    }
    bool until(const std::function<bool()>& done, ise::duration within = 1min) {
        return in.world.run_until(done, within);
    }
    void subscribe(watching& who, std::uint32_t id = 7) {
        REQUIRE(until([&] { return who.has_channel("atirma/boat/count"); }));
        who.subscribe(id, "atirma/boat/count");
        REQUIRE(until([&] { return who.data().size() > 5; }));
    }
    gateway_status status() {
        std::optional<gateway_status> result;
        in.start_body("office", "asks" + std::to_string(++asked), [&](ise::component& self) -> ise::task<> {
            auto gate = co_await self.find("atirma/foxglove");
            status_request request;
            result = co_await gate.call(status_service, request);
        });
        REQUIRE(until([&] { return result.has_value(); }));
        return *result;
    }

    names_test::system in;
    foxglove_gateway* gateway = nullptr;
    ise::sim::process* boat = nullptr;
    std::vector<std::unique_ptr<watching>> viewers;
    int asked = 0;
};

gateway_options everything() {
    gateway_options made;
    made.allow_calls = made.allow_parameters = made.allow_publish = true;
    return made;
}

} // namespace

TEST_CASE("a viewer sees the channels of components, and packets with the time of their publication") {
    coast here;
    auto& viewer = here.watch();
    REQUIRE(here.until([&] { return viewer.find("serverInfo").has_value(); }));
    auto info = *viewer.find("serverInfo");
    CHECK(info["capabilities"] == json::array({"parameters", "parametersSubscribe", "connectionGraph", "time"}));
    here.subscribe(viewer);
    CHECK(viewer.channels.at("atirma/boat/count")["encoding"] == "protobuf");
    CHECK(viewer.channels.at("atirma/boat/count")["schemaName"] == "ise.number");
    CHECK(viewer.services.empty());
    for (const auto& one : viewer.data()) {
        CHECK(u32_of(one.payload, 1) == 7);
        CHECK(watching::age(one) >= 0s);
        CHECK(watching::age(one) < 200ms);
    }
    // The virtual time is told.
    auto times = std::ranges::count_if(viewer.line.binaries, [](const auto& one) { return one.payload[0] == 2; });
    CHECK(times > 5);
    CHECK(here.status().viewers == 1);
    viewer.line.leave();
    REQUIRE(here.until([&] { return here.status().viewers == 0; }));
    here.in.world.run_for(10s);
    CHECK(here.status().subscriptions == 0); // nobody looks
    here.in.world.run_for(60s);
    auto& next = here.watch();
    REQUIRE(here.until([&] { return next.has_channel("atirma/boat/count"); }));
    next.subscribe(1, "atirma/boat/count");
    REQUIRE(here.until([&] { return !next.data().empty(); }));
    CHECK(watching::age(next.data()[0]) < 200ms); // nothing was kept of what was shown before
}

TEST_CASE("a component that goes takes its channels along, and brings them back under the same number") {
    coast here;
    auto& viewer = here.watch();
    here.subscribe(viewer);
    auto id = viewer.channels.at("atirma/boat/count")["id"];
    here.boat->crash();
    REQUIRE(here.until([&] { return !viewer.has_channel("atirma/boat/count"); }));
    here.boat->restart();
    REQUIRE(here.until([&] { return viewer.has_channel("atirma/boat/count"); }));
    CHECK(viewer.channels.at("atirma/boat/count")["id"] == id);
    auto before = viewer.data().size();
    viewer.subscribe(7, "atirma/boat/count"); // the number of the subscription is free
    REQUIRE(here.until([&] { return viewer.data().size() > before + 5; }));
}

TEST_CASE("services that nobody can subscribe to, or whose packets are endless, do not end the gateway") {
    const std::string nothing = "struct p{}";
    const std::string huge = "struct p{a:array<array<struct e{},65536>,65536>}"; // a packet of 0 bytes
    auto odd = GENERATE_COPY(std::pair(std::string("u8"), nothing), std::pair(nothing, huge));
    CAPTURE(odd.first, odd.second);
    coast here;
    start_odd_service(here.in, "strange", "atirma/odd", odd.first, odd.second);
    auto& viewer = here.watch();
    here.subscribe(viewer);
    REQUIRE(here.until([&] { return viewer.has_channel("atirma/odd/odd"); }));
    viewer.subscribe(8, "atirma/odd/odd");
    auto told = [&] {
        return std::ranges::any_of(here.in.warnings,
                                   [](const auto& one) { return one.find("atirma/odd/odd") != one.npos; });
    };
    REQUIRE(here.until(told));
    auto before = viewer.data().size();
    REQUIRE(here.until([&] { return viewer.data().size() > before + 20; }));
}

TEST_CASE("after an outage between boat and gateway the first packet is of now") {
    coast here;
    auto& viewer = here.watch();
    here.subscribe(viewer);
    here.in.world.net().partition("boat", "shore"); // the name server still sees both
    here.in.world.run_for(60s);
    here.in.world.net().heal("boat", "shore");
    auto before = viewer.data().size();
    REQUIRE(here.until([&] {
        viewer.read();
        if (viewer.channels.contains("atirma/boat/count") && viewer.data().size() == before) return false;
        return viewer.data().size() > before + 3;
    }));
    for (auto all = viewer.data(); before < all.size(); ++before) CHECK(watching::age(all[before]) <= 1s);
}

TEST_CASE("after an outage between gateway and viewer no flood of old messages follows") {
    coast here;
    auto& viewer = here.watch();
    here.subscribe(viewer);
    here.in.world.run_for(5s);
    here.in.world.net().partition("office", "shore");
    auto before = viewer.data().size();
    here.in.world.run_for(25s);
    here.in.world.net().heal("office", "shore");
    auto healed = here.in.world.now();
    REQUIRE(here.until([&] { return viewer.data().size() > before + 40; }));
    CHECK(here.in.world.now() - healed < 10s);
    // Old are only those that were under way: of the second before the ping was missed, and of the one before that.
    auto all = viewer.data();
    auto old = std::count_if(all.begin() + static_cast<std::ptrdiff_t>(before), all.end(),
                             [](const auto& one) { return watching::age(one) > 1s; });
    CHECK(old <= 21);
    auto first_new = std::find_if(all.begin() + static_cast<std::ptrdiff_t>(before), all.end(),
                                  [](const auto& one) { return watching::age(one) <= 1s; });
    REQUIRE(first_new != all.end());
    CHECK(first_new - all.begin() - static_cast<std::ptrdiff_t>(before) == old); // and they come first
    CHECK(here.status().skipped > 200);
    REQUIRE(here.until([&] {
        auto info = viewer.find("status");
        return info && (*info)["message"].get<std::string>().find("skipped") != std::string::npos;
    }));
}

TEST_CASE("a viewer that reads nothing slows nobody, and is disconnected") {
    coast here;
    auto& deaf = here.watch("island");
    auto& viewer = here.watch();
    here.subscribe(viewer);
    REQUIRE(here.until([&] { return deaf.has_channel("atirma/boat/count"); }));
    deaf.subscribe(1, "atirma/boat/count");
    here.in.world.run_for(1s);
    here.in.world.net().partition("island", "shore");
    auto before = viewer.data().size();
    here.in.world.run_for(60s);
    CHECK(viewer.data().size() - before > 590);
    CHECK(here.status().viewers == 1);
}

TEST_CASE("viewers call services, with protobuf and with JSON") {
    coast here(everything());
    auto& viewer = here.watch();
    REQUIRE(here.until([&] { return viewer.read(), viewer.services.contains("atirma/boat/twice"); }));
    const auto id = viewer.services.at("atirma/boat/twice")["id"].get<std::uint32_t>();
    auto call = [&](std::uint32_t number, const std::string& encoding, const std::string& payload) {
        std::string made("\2");
        for (std::uint32_t value : {id, number, static_cast<std::uint32_t>(encoding.size())})
            for (int shift = 0; shift < 32; shift += 8) made += static_cast<char>(value >> shift & 0xff);
        viewer.line.send(opcode::binary, made + encoding + payload);
    };
    auto answered = [&](std::uint32_t number) {
        for (const auto& one : viewer.line.binaries)
            if (one.payload[0] == 3 && u32_of(one.payload, 5) == number) return one.payload.substr(13);
        return std::string();
    };
    call(1, "json", R"({"value":21})");
    REQUIRE(here.until([&] { return !answered(1).empty(); }));
    CHECK(answered(1) == R"(json{"value":42})");
    call(2, "protobuf", std::string("\x08\x2a", 2)); // 21, in zigzag
    REQUIRE(here.until([&] { return !answered(2).empty(); }));
    CHECK(answered(2) == "protobuf\x08\x54");
    for (const auto& [encoding, payload] : {std::pair("json", "{"), std::pair("json", R"({"valu":1})"),
                                            std::pair("protobuf", "\xff"), std::pair("cbor", "")}) {
        const auto failures =
            std::ranges::count_if(viewer.all, [](const auto& one) { return one["op"] == "serviceCallFailure"; });
        call(3, encoding, payload);
        REQUIRE(here.until([&] {
            viewer.read();
            return std::ranges::count_if(viewer.all,
                                         [](const auto& one) { return one["op"] == "serviceCallFailure"; }) > failures;
        }));
        CHECK_FALSE(viewer.all.back()["message"].get<std::string>().empty());
    }
    here.boat->pause();
    call(4, "json", R"({"value":21})");
    auto late = [&] {
        viewer.read();
        return std::ranges::any_of(
            viewer.all, [](const auto& one) { return one["op"] == "serviceCallFailure" && one["callId"] == 4; });
    };
    REQUIRE(here.until(late, 20s));
    CHECK(here.status().calls == 3 + 3);
}

namespace {

inline constexpr ise::action<number, number, number> climb{"climb"};

class climber final : public ise::component {
public:
    explicit climber(std::shared_ptr<int> runs) : runs_(std::move(runs)) {}

private:
    ise::task<> run() override {
        provide(climb, [this](number goal, ise::progress<number> tell) { return up(goal, tell); });
        for (;;) co_await sleep(1h);
    }
    ise::task<number> up(number goal, ise::progress<number> tell) {
        ++*runs_;
        number half{goal.value / 2};
        co_await tell(half);
        co_return goal;
    }
    std::shared_ptr<int> runs_;
};

} // namespace

TEST_CASE("viewers see the runs of actions whose components show them, and start none") {
    coast here; // of state it keeps the newest message only
    auto runs = std::make_shared<int>(0);
    for (std::string host : {"mast", "tree"}) {
        auto begin = [host, runs](ise::sim::process& env) {
            auto made = std::make_shared<program>(env, names_test::node_options());
            made->node.start<climber>("atirma/" + host, everywhere(), runs);
            return made;
        };
        here.in.world.host(host).start_process(
            host, begin,
            {{"ISE_NAME_SERVER", "tcp://" + here.in.world.host("ns").address() + ":7400"},
             {ise::record_calls_variable, host == "mast" ? "1" : "0"}});
    }
    auto& viewer = here.watch();
    REQUIRE(here.until([&] { return viewer.has_channel("atirma/mast/climb"); }));
    CHECK(viewer.channels.at("atirma/mast/climb")["schemaName"] == "ise.run_event");
    viewer.subscribe(3, "atirma/mast/climb");
    here.in.world.run_for(10s);
    CHECK(viewer.data().empty());
    CHECK(*runs == 0);
    CHECK_FALSE(viewer.has_channel("atirma/tree/climb")); // shows none
    here.in.start_body("shore", "climbs", [](ise::component& self) -> ise::task<> {
        auto mast = co_await self.find("atirma/mast");
        number goal{8};
        auto run = co_await mast.start(climb, goal);
        [[maybe_unused]] auto outcome = co_await run.try_result();
    });
    REQUIRE(here.until([&] { return viewer.data().size() == 3; }));
    ise::bag::protobuf_type type(ise::schema_of_runs(ise::dynamic_contract::of(climb)));
    std::vector<std::string> seen;
    for (const auto& one : viewer.data()) {
        CHECK(watching::age(one) < 200ms);
        auto fields = type.decode_fields(ise::as_bytes(std::string_view(one.payload).substr(13)), {}).value();
        auto text = ise::dynamic_packet(type.of(), std::move(fields)).to_json();
        auto address = text.find(" (");
        seen.push_back(text.substr(0, address) + text.substr(text.find(')', address) + 1));
    }
    CHECK(
        seen ==
        std::vector<std::string>{
            R"({"run":1,"requester":"test/climbs","goal":{"value":8},"feedback":null,"result":null,"failure":null})",
            R"({"run":1,"requester":"test/climbs","goal":null,"feedback":{"value":4},"result":null,"failure":null})",
            R"({"run":1,"requester":"test/climbs","goal":null,"feedback":null,"result":{"value":8},"failure":null})"});
    CHECK(*runs == 1);
}

TEST_CASE("what viewers publish is a subscription of the gateway") {
    coast here(everything());
    auto& viewer = here.watch();
    std::vector<viewer_message> got;
    here.in.start_body("boat", "listens", [&](ise::component& self) -> ise::task<> {
        auto gate = co_await self.find("atirma/foxglove");
        auto messages = co_await gate.subscribe(published_service);
        for (;;) {
            auto one = co_await messages.next();
            if (!one) break;
            got.push_back(*one);
        }
    });
    here.in.world.run_for(5s);
    viewer.say({{"op", "advertise"},
                {"channels", {{{"id", 3}, {"topic", "goal"}, {"encoding", "json"}, {"schemaName", "goal"}}}}});
    viewer.line.send(opcode::binary, std::string("\1\3\0\0\0{\"x\":1}", 12));
    REQUIRE(here.until([&] { return got.size() == 1; }));
    CHECK(got[0].topic == "goal");
    CHECK(got[0].data == "{\"x\":1}");
    viewer.say({{"op", "unadvertise"}, {"channelIds", {3}}});
    viewer.line.send(opcode::binary, std::string("\1\3\0\0\0{\"x\":1}", 12));
    REQUIRE(here.until([&] { return viewer.find("status").has_value(); }));
    CHECK((*viewer.find("status"))["message"] == "a message of channel 3, which was not advertised");
}

TEST_CASE("the connection graph is told, and what changes in it") {
    coast here;
    auto& viewer = here.watch();
    here.in.start_body("office", "listens", [](ise::component& self) -> ise::task<> {
        auto boat = co_await self.find("atirma/boat");
        auto numbers = co_await boat.subscribe(count);
        for (;;) {
            auto one = co_await numbers.next();
            if (!one) break;
        }
    });
    REQUIRE(here.until([&] { return viewer.has_channel("atirma/boat/count"); }));
    viewer.say({{"op", "subscribeConnectionGraph"}});
    auto result = [&](const json& wanted, const char* where) {
        viewer.read();
        return std::ranges::any_of(viewer.all, [&](const auto& one) {
            if (one["op"] != "connectionGraphUpdate") return false;
            const auto& list = one[where];
            return std::find(list.begin(), list.end(), wanted) != list.end();
        });
    };
    const json published = {{"name", "atirma/boat/count"}, {"publisherIds", {"atirma/boat"}}};
    const json subscribed = {{"name", "atirma/boat/count"}, {"subscriberIds", {"test/listens"}}};
    const json provided = {{"name", "atirma/boat/twice"}, {"providerIds", {"atirma/boat"}}};
    REQUIRE(here.until([&] {
        return result(published, "publishedTopics") && result(subscribed, "subscribedTopics") &&
               result(provided, "advertisedServices");
    }));
    here.boat->crash();
    REQUIRE(here.until([&] { return result("atirma/boat/count", "removedTopics"); }));
    CHECK(result("atirma/boat/twice", "removedServices"));
}

TEST_CASE("the number of viewers is bounded, and pages of others are refused") {
    gateway_options options;
    options.max_viewers = 2;
    coast here(options);
    auto& one = here.watch();
    auto& two = here.watch();
    REQUIRE(here.until([&] { return one.find("serverInfo") && two.find("serverInfo"); }));
    auto& three = here.watch();
    REQUIRE(here.until([&] { return !three.line.head.empty(); }));
    CHECK(three.line.head.starts_with("HTTP/1.1 503 "));
    one.line.leave();
    here.in.world.run_for(1s);
    auto& page = here.watch("office", "Origin: https://evil.example\r\n");
    REQUIRE(here.until([&] { return !page.line.head.empty(); }));
    CHECK(page.line.head.starts_with("HTTP/1.1 403 "));
    CHECK(here.status().refused == 2);
}

TEST_CASE("a port that is taken ends the gateway with a message that says so") {
    coast here;
    gateway_options options;
    options.address = "0.0.0.0";
    ise::node* second = nullptr;
    here.in.start("shore", "second", [&](ise::node& node) {
        second = &node;
        node.start<foxglove_gateway>("atirma/second", everywhere(), options);
    });
    REQUIRE(here.until([&] { return second->all_stopped(); }));
    REQUIRE(second->reports().size() == 1);
    CHECK(second->reports()[0].failure.find("--port 8765") != std::string::npos);
}

} // namespace foxglove_test
