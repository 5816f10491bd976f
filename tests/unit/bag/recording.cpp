// Recording and replay of a system on the virtual world.
#include <ise/bag/player.hpp>
#include <ise/bag/reader.hpp>
#include <ise/bag/recorder.hpp>
#include <ise/bag/recording.hpp>
#include <ise/component/discover.hpp>
#include <ise/component/served_calls.hpp>
#include <ise/packet/codec.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/service/action.hpp>
#include <ise/service/action_run.hpp>
#include <ise/service/action_runs.hpp>
#include <ise/service/dynamic.hpp>

#include <support/catch.hpp>
#include <unit/name_server/odd_service.hpp>
#include <unit/name_server/system.hpp>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace ise;
using namespace names_test;

// A folder that goes with the test.
class folder {
public:
    folder() {
        std::string name = (std::filesystem::temp_directory_path() / "ise_bag_XXXXXX").string();
        path_ = ::mkdtemp(name.data());
    }
    ~folder() { std::filesystem::remove_all(path_); }
    std::string file(const std::string& name) const { return path_ + "/" + name; }

private:
    std::string path_;
};

class tripler final : public component {
    task<> run() override {
        provide(twice, [](number rq) {
            number answer{rq.value * 3};
            return answer;
        });
        for (;;) co_await sleep(1h);
    }
};

/// A boat whose calls are shown, a caller, and a recorder.
struct voyage {
    explicit voyage(bag::recorder_options options) {
        begin("boat", [](node& boat) { boat.start<doubler>("atirma/boat", everywhere()); });
        begin("log", [this, options](node& log) {
            recording = &log;
            log.start<bag::recorder>("atirma/recorder", everywhere(), options);
        });
        in.start_body("shore", "caller", [](component& self) -> task<> {
            co_await self.sleep(2s);
            auto boat = co_await self.find("atirma/boat");
            for (std::int64_t value : {21, 7, 21}) {
                number request{value};
                [[maybe_unused]] auto got = co_await boat.call(twice, request);
            }
            for (;;) co_await self.sleep(1h);
        });
    }
    void begin(const std::string& host, std::function<void(node&)> what) {
        auto run = [what](sim::process& env) {
            auto made = std::make_shared<program>(env, names_test::node_options());
            what(made->node);
            return made;
        };
        in.world.host(host).start_process(
            host, run,
            {{"ISE_NAME_SERVER", "tcp://" + in.world.host("ns").address() + ":7400"}, {record_calls_variable, "1"}});
    }
    void sail(duration length = 5s) {
        in.world.run_for(length);
        recording->stop();
        REQUIRE(in.world.run_until([&] { return recording->all_stopped(); }));
    }

    names_test::system in;
    node* recording = nullptr;
};

bag::recorder_options recording_to(const std::string& file) {
    bag::recorder_options made;
    made.paths = {"atirma/boat"};
    made.files.file = file;
    return made;
}

std::string whole_file(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
}

struct read_back {
    explicit read_back(const std::string& path) : file(bag::open_file(path).value()) {
        about = bag::read_summary(*file, bag::depth::whole).value();
        for (const auto& [id, channel] : about.channels) topics.emplace(id, bag::topic::of(channel).value());
        bag::message_reader in(*file, about);
        for (auto got = in.next().value(); got; got = in.next().value()) {
            const auto& topic = topics.at(got->channel_id);
            all[topic.name()].push_back(topic.packet().decode(got->data).value());
        }
    }
    const bag::topic& topic(const std::string& name) const {
        for (const auto& [id, one] : topics)
            if (one.name() == name) return one;
        throw std::out_of_range(name);
    }

    std::unique_ptr<bag::source> file;
    bag::summary about;
    std::map<std::uint16_t, bag::topic> topics;
    std::map<std::string, std::vector<bytes>> all;
};

} // namespace

TEST_CASE("a recorder writes packets, calls and names, and closes its file when it stops", "[bag]") {
    folder tmp;
    voyage sea(recording_to(tmp.file("a.mcap")));
    sea.sail();
    read_back got(tmp.file("a.mcap"));
    CHECK(got.about.complete);
    CHECK(!got.about.damage);
    const auto& counts = got.all["atirma/boat/count"];
    REQUIRE(counts.size() > 30);
    auto first = decode<number>(counts[0]).value;
    for (std::size_t i = 0; i < counts.size(); ++i)
        CHECK(decode<number>(counts[i]).value == first + static_cast<std::int64_t>(i));
    CHECK(got.all["ise/gaps"].empty());
    REQUIRE(!got.all["ise/names"].empty());
    CHECK(decode<bag::name_event>(got.all["ise/names"][0]).path == "atirma/boat");
    const auto& calls = got.all["atirma/boat/twice"];
    REQUIRE(calls.size() == 3);
    auto call = bag::decode_call(*got.topic("atirma/boat/twice").contract(), calls[1]).value();
    CHECK(call.outcome == "ok");
    CHECK(call.caller.starts_with("test/caller ("));
    CHECK(decode<number>(call.request).value == 7);
    REQUIRE(call.response);
    CHECK(decode<number>(*call.response).value == 14);
}

namespace {

inline constexpr ise::action<number, number, number> climb{"climb"};

// Of "test/climbs (tcp://10.0.0.4:49159)" the path.
std::string without_address(std::string text) {
    auto begin = text.find(" (");
    if (begin != text.npos) text.erase(begin, text.find(')', begin) + 1 - begin);
    return text;
}

/// Climbs to the goal by reports of each step; to none above 100.
class climber final : public component {
    task<> run() override {
        provide(climb, [this](number goal, progress<number> tell) { return up(goal, tell); });
        for (;;) co_await sleep(1h);
    }
    task<number> up(number goal, progress<number> tell) {
        if (goal.value > 100) throw error(errc::refused, "too high");
        for (number step{1}; step.value <= goal.value; ++step.value) {
            co_await sleep(100ms);
            co_await tell(step);
        }
        co_return goal;
    }
};

} // namespace

TEST_CASE("the runs of actions are recorded, and a replay leaves them out", "[bag]") {
    folder tmp;
    voyage sea(recording_to(tmp.file("a.mcap")));
    sea.begin("mast", [](node& in) { in.start<climber>("atirma/boat/mast", everywhere()); });
    sea.in.start_body("shore", "climbs", [](component& self) -> task<> {
        co_await self.sleep(2s);
        auto mast = co_await self.find("atirma/boat/mast");
        for (std::int64_t height : {2, 101}) {
            number goal{height};
            auto run = co_await mast.start(climb, goal);
            [[maybe_unused]] auto outcome = co_await run.try_result();
        }
    });
    sea.sail();
    read_back got(tmp.file("a.mcap"));
    const auto& topic = got.topic("atirma/boat/mast/climb");
    CHECK(topic.what() == bag::content::runs);
    std::vector<std::string> events;
    for (const auto& one : got.all["atirma/boat/mast/climb"])
        events.push_back(without_address(dynamic_packet(topic.packet().of(), one).to_json()));
    auto event = [](int run, const std::string& parts) {
        return R"({"run":)" + std::to_string(run) + R"(,"requester":"test/climbs",)" + parts + "}";
    };
    CHECK(
        events ==
        std::vector<std::string>{
            event(1, R"("goal":{"value":2},"feedback":null,"result":null,"failure":null)"),
            event(1, R"("goal":null,"feedback":{"value":1},"result":null,"failure":null)"),
            event(1, R"("goal":null,"feedback":{"value":2},"result":null,"failure":null)"),
            event(1, R"("goal":null,"feedback":null,"result":{"value":2},"failure":null)"),
            event(2, R"("goal":{"value":101},"feedback":null,"result":null,"failure":null)"),
            event(
                2,
                R"("goal":null,"feedback":null,"result":null,"failure":{"code":1,"execution":0,"reason":"too high"})"),
        });
    // The recording is played all the same: others of it.
    names_test::system again;
    again.start("theatre", "player", [&](node& in) {
        bag::player_options how;
        how.file = tmp.file("a.mcap");
        auto play = std::make_shared<bag::player>(in, how);
        CHECK(play->paths() == std::vector<std::string>{"atirma/boat"}); // not the mast, which has runs only
    });
}

TEST_CASE("the same voyage is recorded byte for byte the same", "[bag]") {
    folder tmp;
    for (std::string name : {"a.mcap", "b.mcap"}) {
        voyage sea(recording_to(tmp.file(name)));
        sea.sail();
    }
    CHECK(whole_file(tmp.file("a.mcap")).size() > 1000);
    CHECK(whole_file(tmp.file("a.mcap")) == whole_file(tmp.file("b.mcap")));
}

TEST_CASE("a recording is split by time, and each file is whole", "[bag]") {
    folder tmp;
    auto options = recording_to(tmp.file("a.mcap"));
    options.files.split_time = 2s;
    voyage sea(options);
    sea.sail();
    std::int64_t next = 0;
    for (std::string name : {"a_0001.mcap", "a_0002.mcap"}) {
        read_back got(tmp.file(name));
        CHECK(got.about.complete);
        for (const auto& one : got.all["atirma/boat/count"]) {
            auto value = decode<number>(one).value;
            CHECK((next == 0 || value == next));
            next = value + 1;
        }
    }
    CHECK(next > 30);
}

TEST_CASE("what does not find room on the way to the disk is counted in the file", "[bag]") {
    folder tmp;
    auto options = recording_to(tmp.file("a.mcap"));
    options.queue_bytes = 1; // nothing has room
    voyage sea(options);
    sea.sail();
    read_back got(tmp.file("a.mcap"));
    CHECK(got.all["atirma/boat/count"].empty());
    std::uint64_t lost = 0;
    for (const auto& one : got.all["ise/gaps"]) {
        auto event = decode<bag::gap_event>(one);
        if (event.service != "count") continue;
        REQUIRE(event.lost);
        lost += *event.lost;
        CHECK(event.reason.find("queue_bytes") != std::string::npos);
    }
    CHECK(lost > 30);
}

TEST_CASE("services that nobody can subscribe to, or whose packets no file can have, do not end a recording", "[bag]") {
    const std::string nothing = "struct p{}";
    const std::string huge = "struct p{a:array<array<struct e{},65536>,65536>}"; // a packet of 0 bytes
    auto odd = GENERATE_COPY(std::pair(std::string("u8"), nothing), std::pair(std::string("vector<u8>"), nothing),
                             std::pair(nothing, huge));
    CAPTURE(odd.first, odd.second);
    folder tmp;
    voyage sea(recording_to(tmp.file("a.mcap")));
    start_odd_service(sea.in, "strange", "atirma/boat/odd", odd.first, odd.second);
    sea.sail();
    for (const auto& report : sea.recording->reports()) CHECK(report.failure.empty());
    read_back got(tmp.file("a.mcap"));
    CHECK(got.about.complete);
    CHECK(got.all["atirma/boat/count"].size() > 30);
    if (odd.second == nothing) {
        auto gap = decode<bag::gap_event>(got.all["ise/gaps"].at(0));
        CHECK(gap.component == "atirma/boat/odd");
        CHECK(gap.reason.starts_with("no subscription: "));
    } else {
        CHECK(got.all["atirma/boat/odd/odd"].empty());
    }
}

TEST_CASE("a ring is written with what came before its trigger", "[bag]") {
    folder tmp;
    auto options = recording_to(tmp.file("a.mcap"));
    options.ring = 1s;
    options.after = 500ms;
    options.triggers = {"atirma/boat/twice"}; // called after two seconds
    voyage sea(options);
    sea.sail(6s);
    CHECK(!std::filesystem::exists(tmp.file("a_0002.mcap")));
    read_back got(tmp.file("a_0001.mcap"));
    CHECK(got.about.complete);
    const auto& counts = got.all["atirma/boat/count"];
    CHECK(counts.size() >= 13);
    CHECK(counts.size() <= 17);
    CHECK(got.all["atirma/boat/twice"].size() == 3);
    REQUIRE(got.about.metadata.size() == 2);
    auto why = bag::read_metadata(*got.file, got.about.metadata[1]).value();
    CHECK(why.name == "ise.trigger");
    REQUIRE(why.metadata.size() == 1); // by its time
    CHECK(why.metadata.begin()->second == "atirma/boat/twice");
}

TEST_CASE("what follows a trigger is recorded, however large the ring before it was", "[bag]") {
    folder tmp;
    auto options = recording_to(tmp.file("a.mcap"));
    options.ring = 10s;
    options.after = 3s;
    options.queue_bytes = 1000; // less than the ring has
    options.triggers = {"atirma/boat/twice"};
    voyage sea(options);
    sea.sail(8s);
    read_back got(tmp.file("a_0001.mcap"));
    CHECK(got.all["atirma/boat/count"].size() >= 45);
    CHECK(got.all["ise/gaps"].empty());
}

TEST_CASE("files are attached when a recording begins, and again when it ends if they have changed", "[bag]") {
    folder tmp;
    std::ofstream(tmp.file("sea.toml")) << "[components.boat]";
    std::ofstream(tmp.file("boat.log")) << "left the quay";
    auto options = recording_to(tmp.file("a.mcap"));
    options.files.attached = {tmp.file("sea.toml"), tmp.file("boat.log")};
    voyage sea(options);
    sea.in.world.run_for(2s);
    std::ofstream(tmp.file("boat.log"), std::ios::app) << ", sails";
    sea.sail();
    read_back got(tmp.file("a.mcap"));
    std::vector<std::string> seen;
    for (const auto& where : got.about.attachments) {
        auto one = bag::read_attachment(*got.file, where).value();
        seen.push_back(one.name + " (" + one.media_type + "): " + std::string(as_text(one.data)));
    }
    CHECK(seen == std::vector<std::string>{"sea.toml (application/toml): [components.boat]",
                                           "boat.log (text/plain): left the quay",
                                           "boat.log (text/plain): left the quay, sails"});
}

TEST_CASE("a file that cannot be attached ends a recording at its beginning, and later is told in it", "[bag]") {
    folder tmp;
    bag::recording_options options;
    options.file = tmp.file("a.mcap");
    options.attached = {tmp.file("boat.log")};
    bag::recording_file file(options);
    auto begun = file.begin(1);
    REQUIRE_FALSE(begun);
    CHECK(begun.error().message().find(tmp.file("boat.log")) != std::string::npos);
    CHECK_FALSE(std::filesystem::exists(options.file));
    file.note("ise.trigger", {{"now", "a test"}}, 1).value(); // begins a file all the same, as a ring does
    file.close().value();
    read_back got(options.file);
    std::map<std::string, bag::string_map> seen;
    for (const auto& where : got.about.metadata) {
        auto one = bag::read_metadata(*got.file, where).value();
        seen[one.name].merge(one.metadata);
    }
    CHECK(seen["ise.trigger"]["now"] == "a test");
    CHECK(seen["ise.not_attached"].contains(tmp.file("boat.log")));
}

TEST_CASE("a recording is played: its packets at their times, its calls as they were answered", "[bag]") {
    folder tmp;
    {
        voyage sea(recording_to(tmp.file("a.mcap")));
        sea.sail();
    }
    names_test::system in;
    std::unique_ptr<bag::player> play;
    std::vector<std::pair<time_point, std::int64_t>> came;
    std::vector<std::string> answers;
    in.start("replay", "player", [&](node& on) {
        bag::player_options options;
        options.file = tmp.file("a.mcap");
        options.as["atirma"] = "replay";
        options.delay = 3s;
        play = std::make_unique<bag::player>(on, options);
        on.start("test/viewer", [&](component& self) -> task<> {
            auto boat = co_await self.find("replay/boat");
            self.listen(boat, count, [&](const number& one) { came.emplace_back(self.now(), one.value); });
            for (std::int64_t value : {21, 7, 7, 5}) {
                number request{value};
                auto got = co_await boat.try_call(twice, request);
                answers.push_back(got ? std::to_string(got->value) : std::string(name_of(got.error().code())));
            }
            for (;;) co_await self.sleep(1h);
        });
    });
    REQUIRE(play);
    CHECK(play->paths() == std::vector<std::string>{"replay/boat"});
    REQUIRE(in.world.run_until([&] { return play->done(); }));
    in.world.run_for(1s);
    CHECK(!play->trouble());
    CHECK(answers == std::vector<std::string>{"42", "14", "14", "refused"});
    read_back recorded(tmp.file("a.mcap"));
    const auto& counts = recorded.all["atirma/boat/count"];
    REQUIRE(came.size() == counts.size());
    for (std::size_t i = 0; i < came.size(); ++i) CHECK(came[i].second == decode<number>(counts[i]).value);
    for (std::size_t i = 2; i < came.size(); ++i) { // the first may be a last value
        CHECK(came[i].first - came[i - 1].first > 90ms);
        CHECK(came[i].first - came[i - 1].first < 110ms);
    }
}

TEST_CASE("recorded calls are made to a component under test, and the first other answer is shown", "[bag]") {
    folder tmp;
    {
        voyage sea(recording_to(tmp.file("a.mcap")));
        sea.sail();
    }
    for (bool right : {true, false}) {
        names_test::system in;
        std::unique_ptr<bag::player> play;
        in.start("host", "tested", [&](node& on) {
            if (right) on.start<doubler>("atirma/boat");
            else on.start<tripler>("atirma/boat");
            bag::player_options options;
            options.file = tmp.file("a.mcap");
            options.only = {"atirma/boat/twice"};
            options.tested = {"atirma/boat"};
            play = std::make_unique<bag::player>(on, options);
        });
        REQUIRE(in.world.run_until([&] { return play->done(); }));
        CHECK(play->counts().called == 3);
        CHECK(play->counts().compared == 3);
        auto first = play->first_difference();
        CHECK(first.has_value() == !right);
        if (first)
            CHECK_THAT(first->text(),
                       ise_test::Contains("atirma/boat: call 0 of 'twice', field value: 42 in the recording, 63 now"));
    }
}

namespace {

// Version 1 of "count" has numbers, version 2 has texts in their place; so have the calls of "twice".
void record_an_update(const std::string& file) {
    const auto contract = [](const std::string& name, service_kind kind, const std::string& packet) {
        const std::string none = "struct nothing{}";
        const std::vector<std::string> packets = kind == service_kind::subscription
                                                     ? std::vector{none, none, packet, none, none}
                                                     : std::vector{packet, packet};
        return dynamic_contract::parse(name, kind, packets).value();
    };
    bag::recording_options options;
    options.file = file;
    bag::recording_file out(options);
    std::uint64_t at = 1'000'000'000;
    for (const std::string packet : {"struct number{value:i64}", "struct number{value:string}"}) {
        auto published =
            std::make_shared<const bag::topic>("atirma/boat", contract("count", service_kind::subscription, packet));
        auto called = std::make_shared<const bag::topic>("atirma/boat",
                                                         contract("twice", service_kind::request_response, packet));
        const bool text = packet.find("string") != std::string::npos;
        auto value = [text](std::uint8_t of) {
            struct words {
                std::string value;
            };
            return text ? encode(words{std::string(of, 'a')}) : encode(number{of});
        };
        for (std::uint8_t i = 1; i <= 3; ++i) {
            bag::recorded_message made;
            made.of = published;
            made.log_time = made.publish_time = at;
            made.packet = value(i);
            out.write(made).value();
            bag::recorded_call call;
            call.caller = "atirma/shore";
            call.outcome = "ok";
            call.request = value(i);
            call.response = value(static_cast<std::uint8_t>(2 * i));
            made.of = called;
            made.packet = bag::encode_call(call);
            out.write(made).value();
            at += 100'000'000;
        }
        at += 2'000'000'000;
    }
    out.close().value();
}

// Everything that a component publishes as "count", under whatever contract, and a call of "twice" after each packet.
task<> follow(component& self, std::vector<std::string>& seen) {
    auto boat = co_await self.find("atirma/boat");
    for (;;) {
        auto service = co_await discover(boat, "count");
        if (service) {
            auto terms = subscribe_options::lossless(64);
            terms.last_value = false;
            auto stream = co_await subscribe_dynamic(boat, *service, terms);
            while (stream) {
                auto packet = co_await stream->next();
                if (!packet) break;
                auto calls = co_await discover(boat, "twice");
                const auto raw = packet->encoded();
                dynamic_packet request(calls.value().packet(role::request), bytes(raw.begin(), raw.end()));
                auto doubled = co_await call_dynamic(boat, *calls, std::move(request), 1s);
                seen.push_back(packet->to_json() + " " + (doubled ? doubled->to_json() : doubled.error().message()));
            }
        }
        co_await self.sleep(10ms);
    }
}

} // namespace

TEST_CASE("a component that was updated in a recording is played, and compared, with its packets of each time",
          "[bag]") {
    folder tmp;
    record_an_update(tmp.file("a.mcap"));
    names_test::system in;
    std::unique_ptr<bag::player> play, compared;
    std::vector<std::string> seen;
    in.start("replay", "player", [&](node& on) {
        bag::player_options options;
        options.file = tmp.file("a.mcap");
        options.delay = 3s;
        play = std::make_unique<bag::player>(on, options);
        options.only = {"atirma/boat/count"};
        options.tested = {"atirma/boat"};
        compared = std::make_unique<bag::player>(on, options);
        on.start("test/viewer", [&](component& self) { return follow(self, seen); });
    });
    REQUIRE(in.world.run_until([&] { return play->done() && compared->done(); }));
    in.world.run_for(1s);
    CHECK_FALSE(play->trouble());
    CHECK(seen == std::vector<std::string>{R"({"value":1} {"value":2})", R"({"value":2} {"value":4})",
                                           R"({"value":3} {"value":6})", R"({"value":"a"} {"value":"aa"})",
                                           R"({"value":"aa"} {"value":"aaaa"})",
                                           R"({"value":"aaa"} {"value":"aaaaaa"})"});
    CHECK(compared->counts().compared == 6);
    const auto first = compared->first_difference();
    INFO((first ? first->text() : std::string()));
    CHECK_FALSE(first);
}
