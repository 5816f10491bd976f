// A recording of a system on the virtual world, replayed into one component of it.
#include <ise/bag/recorder.hpp>
#include <ise/component/served_calls.hpp>
#include <ise/replay/replay_world.hpp>

#include <support/catch.hpp>
#include <unit/name_server/system.hpp>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace ise;
using namespace names_test;

struct fix {
    std::int64_t number = 0;
    wall_time seen_at{};
    std::uint64_t token = 0;
};
inline constexpr subscription<fix> fixes{"fixes"};
inline constexpr request_response<number, number> sum{"sum"};

// A folder that goes with the test.
class folder {
public:
    folder() {
        std::string name = (std::filesystem::temp_directory_path() / "ise_replay_XXXXXX").string();
        path_ = ::mkdtemp(name.data());
    }
    ~folder() { std::filesystem::remove_all(path_); }
    std::string file(const std::string& name) const { return path_ + "/" + name; }

private:
    std::string path_;
};

enum class restarted { nobody, boat, navigator };
enum class fault { none, other_number, one_call_too_few, other_question, other_answer, random_token };

/// Follows the boat, asks the pilot about every number, publishes what it answers, and provides the sum of all.
class navigator final : public component {
public:
    explicit navigator(fault what) : fault_(what) {}

private:
    task<> run() override {
        provide(sum, [this](number ask) {
            number answer{sum_ + ask.value + (fault_ == fault::other_answer && sum_ > 300 ? 1 : 0)};
            return answer;
        });
        auto out = publish(fixes);
        for (;;) {
            auto boat = co_await find("atirma/boat");
            auto pilot = co_await find("atirma/pilot");
            auto packets = co_await boat.subscribe(count, subscribe_options::keep_last(64));
            for (;;) {
                auto packet = co_await packets.next();
                if (!packet) break;
                if (fault_ == fault::one_call_too_few && packet->value == 20) continue;
                number request{packet->value + (fault_ == fault::other_question && packet->value == 20 ? 1000 : 0)};
                auto answered = co_await pilot.try_call(twice, request);
                if (!answered) continue;
                sum_ += answered->value;
                fix made{answered->value + (fault_ == fault::other_number && packet->value == 20 ? 1 : 0), wall(),
                         fault_ == fault::random_token ? env().random() : 0};
                out(made);
            }
        }
    }

    fault fault_;
    std::int64_t sum_ = 0;
};

/// The boat that is followed, the pilot, somebody who asks for sums, and a recorder; one may be away for a while.
void record_voyage(const std::string& file, fault what = fault::none, restarted who = restarted::nobody,
                   duration detour = duration()) {
    names_test::system in;
    node* recording = nullptr;
    auto begin = [&](const std::string& host, std::function<void(node&)> run) -> sim::process& {
        auto start = [run](sim::process& env) {
            auto made = std::make_shared<program>(env, names_test::node_options());
            run(made->node);
            return made;
        };
        return in.world.host(host).start_process(
            host, start,
            {{"ISE_NAME_SERVER", "tcp://" + in.world.host("ns").address() + ":7400"}, {record_calls_variable, "1"}});
    };
    begin("log", [&](node& on) {
        recording = &on;
        bag::recorder_options options;
        options.files.file = file;
        on.start<bag::recorder>("log/recorder", everywhere(), options);
    });
    in.world.run_for(1s);
    begin("pilot", [](node& on) { on.start<doubler>("atirma/pilot", everywhere()); });
    in.world.run_for(1s);
    auto& shore = begin("shore", [what](node& on) { on.start<navigator>("atirma/navigator", everywhere(), what); });
    in.world.run_for(1s);
    auto& boat = begin("boat", [](node& on) { on.start<doubler>("atirma/boat", everywhere()); });
    begin("desk", [](node& on) {
        on.start(
            "atirma/console",
            [](component& self) -> task<> {
                auto navigator_there = co_await self.find("atirma/navigator");
                for (std::int64_t n = 0;; ++n) {
                    co_await self.sleep(700ms);
                    number ask{n};
                    [[maybe_unused]] auto answered = co_await navigator_there.try_call(sum, ask);
                }
            },
            everywhere());
    });
    in.world.run_for(3s);
    in.world.net().between("boat", "log").latency += detour; // not before the recorder has subscribed
    in.world.net().between("desk", "shore").latency += 3 * detour;
    if (who != restarted::nobody) {
        auto& process = who == restarted::boat ? boat : shore;
        process.crash();
        in.world.run_for(4s);
        process.restart();
    }
    in.world.run_for(5s);
    recording->stop();
    REQUIRE(in.world.run_until([&] { return recording->all_stopped(); }));
}

replay_options with(fault what) {
    replay_options made;
    replayed_component one;
    one.path = "atirma/navigator";
    one.make = [what] { return std::make_unique<navigator>(what); };
    made.components.push_back(std::move(one));
    if (std::getenv("ISE_TEST_LOG")) made.log = log_to_stderr(log_level::debug);
    return made;
}

replay_report replay(const std::string& file, const replay_options& options) {
    replay_world world;
    return world.play(file, options);
}

std::string whole_file(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
}

} // namespace

TEST_CASE("a component does in a replay what it did in the recording, to the nanosecond", "[replay]") {
    folder tmp;
    record_voyage(tmp.file("a.mcap"));
    auto report = replay(tmp.file("a.mcap"), with(fault::none));
    INFO((report.first_difference ? report.first_difference->text() : std::string()));
    CHECK(!report.first_difference);
    CHECK(report.counts.unknown == 0);
    CHECK(report.counts.packets > 50);
    CHECK(report.counts.answered > 40);
    CHECK(report.counts.called > 10);
    CHECK(report.counts.compared > 50);
    CHECK(report.length > 10s);
}

namespace {

/// What a recording has of a topic: when, and what.
struct kept_message {
    bag::message_record message;
    bytes packet;
};

std::vector<kept_message> messages_of(const std::string& file, const std::string& topic) {
    auto opened = bag::open_file(file).value();
    auto about = bag::read_summary(*opened).value();
    bag::message_filter filter;
    filter.wanted = [&](const bag::channel_record& channel) { return channel.topic == topic; };
    bag::message_reader all(*opened, about, filter);
    std::vector<kept_message> made;
    for (;;) {
        auto next = all.next().value();
        if (!next) return made;
        auto of = bag::topic::of(about.channels.at(next->channel_id)).value();
        auto packet = of.packet().decode(next->data).value();
        made.push_back({std::move(*next), std::move(packet)});
    }
}

} // namespace

TEST_CASE("packets come in a replay when the recorder had them, and calls when the component had them", "[replay]") {
    folder tmp;
    constexpr auto detour = 137ms; // the recorder hears of the boat so much later than the navigator does
    record_voyage(tmp.file("a.mcap"), fault::none, restarted::nobody, detour);
    CHECK(replay(tmp.file("a.mcap"), with(fault::none)).first_difference);
    auto options = with(fault::none);
    options.ignored = {"seen_at", "sum/*"}; // a call may come before a packet behind which it had come
    options.out = tmp.file("b.mcap");
    auto report = replay(tmp.file("a.mcap"), options);
    INFO((report.first_difference ? report.first_difference->text() : std::string()));
    CHECK(report.counts.unknown == 0);

    auto before = messages_of(tmp.file("a.mcap"), "atirma/navigator/fixes");
    auto now = messages_of(tmp.file("b.mcap"), "atirma/navigator/fixes");
    const auto both = std::min(before.size(), now.size()); // the last packets had not come to the recorder
    REQUIRE(both + 2 >= before.size());
    if (report.first_difference) CHECK(report.first_difference->number >= both);
    std::size_t later = 0;
    for (std::size_t i = 0; i < both; ++i) {
        const auto by = decode<fix>(now[i].packet).seen_at - decode<fix>(before[i].packet).seen_at;
        CHECK(by == (later > 0 || by != 0s ? detour : 0s));
        later += by != 0s;
    }
    CHECK(later > 40);
    CHECK(later < both);

    // The times of calls are those of the component itself.
    auto asked = messages_of(tmp.file("a.mcap"), "atirma/navigator/sum");
    auto asked_again = messages_of(tmp.file("b.mcap"), "atirma/navigator/sum");
    REQUIRE(asked.size() > 5);
    REQUIRE(asked_again.size() == asked.size());
    for (std::size_t i = 0; i < asked.size(); ++i)
        CHECK(asked_again[i].message.publish_time == asked[i].message.publish_time);
}

TEST_CASE("a component that goes and comes back in a recording does so in the replay", "[replay]") {
    folder tmp;
    record_voyage(tmp.file("a.mcap"), fault::none, restarted::boat);
    auto options = with(fault::none);
    std::string log;
    options.log = [&](const log_record& record) { log += format_line(record) + "\n"; };
    auto report = replay(tmp.file("a.mcap"), options);
    using ise_test::Contains;
    CHECK_THAT(log, Contains("atirma/navigator: was lost; its subscriptions go on when it is back"));
    CHECK_THAT(log, Contains("atirma/navigator: is reached again provider=atirma/boat"));
    CHECK(report.counts.answered > 60); // also after it
    // When a connection is tried again is drawn anew.
    if (report.first_difference) CHECK_THAT(report.first_difference->text(), Contains("T08:00:1"));
}

TEST_CASE("a component under test that was started anew in a recording is started anew in the replay", "[replay]") {
    folder tmp;
    record_voyage(tmp.file("a.mcap"), fault::none, restarted::navigator);
    int made = 0;
    auto options = with(fault::none);
    auto make = options.components[0].make;
    options.components[0].make = [&] {
        ++made;
        return make();
    };
    auto report = replay(tmp.file("a.mcap"), options);
    CHECK(made == 2);
    // It crashed at 08:00:06; its name went two seconds later.
    if (report.first_difference) CHECK(report.first_difference->text() > "2017-09-04T08:00:06");
}

TEST_CASE("the first thing that a component does otherwise in a replay is shown", "[replay]") {
    folder tmp;
    record_voyage(tmp.file("a.mcap"));
    auto first = [&](fault what) {
        auto report = replay(tmp.file("a.mcap"), with(what));
        REQUIRE(report.first_difference);
        return *report.first_difference;
    };
    auto other = first(fault::other_number);
    CHECK(other.component == "atirma/navigator");
    CHECK(other.service == "fixes");
    CHECK(other.field == "number");
    CHECK(other.recorded == "40");
    CHECK(other.now == "41");
    CHECK_THAT(other.text(),
               ise_test::Contains("atirma/navigator: packet 19 of 'fixes', field number: 40 in the recording, "
                                  "41 now"));
    CHECK_THAT(other.text(), ise_test::StartsWith("2017-09-04T08:00:05."));

    auto few = first(fault::one_call_too_few);
    CHECK(few.component == "atirma/pilot");
    CHECK(few.service == "twice");
    CHECK(few.what == "request");
    CHECK(few.recorded == R"({"value":20})");
    CHECK(few.now.empty());

    auto asked = first(fault::other_question);
    CHECK(asked.component == "atirma/pilot");
    CHECK(asked.what == "request");

    auto answer = first(fault::other_answer);
    CHECK(answer.service == "sum");
    CHECK(answer.what == "call");
    CHECK(answer.field == "value");
}

TEST_CASE("fields that differ from run to run are not compared if the test says so", "[replay]") {
    folder tmp;
    record_voyage(tmp.file("a.mcap"), fault::random_token);
    auto options = with(fault::random_token);
    auto strict = replay(tmp.file("a.mcap"), options);
    REQUIRE(strict.first_difference);
    CHECK(strict.first_difference->field == "token");
    for (const char* ignored : {"token", "fixes/token", "fixes/*"}) {
        options.ignored = {ignored};
        CHECK(!replay(tmp.file("a.mcap"), options).first_difference);
    }
    options.ignored = {"sum/token"};
    CHECK(replay(tmp.file("a.mcap"), options).first_difference);
}

TEST_CASE("two replays are the same, byte for byte", "[replay]") {
    folder tmp;
    record_voyage(tmp.file("a.mcap"));
    std::vector<std::uint64_t> hashes;
    for (const char* out : {"b.mcap", "c.mcap"}) {
        auto options = with(fault::none);
        options.out = tmp.file(out);
        hashes.push_back(replay(tmp.file("a.mcap"), options).hash);
    }
    CHECK(hashes[0] == hashes[1]);
    auto once = whole_file(tmp.file("b.mcap"));
    CHECK(once.size() > 1000);
    CHECK((once == whole_file(tmp.file("c.mcap"))));
}

TEST_CASE("what cannot be replayed is refused with its reason", "[replay]") {
    folder tmp;
    record_voyage(tmp.file("a.mcap"));
    auto why = [](const std::string& file, const replay_options& options) {
        try {
            replay(file, options);
        } catch (const error& thrown) {
            return std::string(thrown.what());
        }
        return std::string("nothing");
    };
    using ise_test::Contains;
    CHECK_THAT(why(tmp.file("none.mcap"), with(fault::none)), Contains("none.mcap"));
    CHECK_THAT(why(tmp.file("a.mcap"), replay_options()), Contains("needs the components"));
    auto other = with(fault::none);
    other.components[0].path = "atirma/other";
    CHECK_THAT(why(tmp.file("a.mcap"), other), Contains("nothing of atirma/other"));
    replay_world world;
    auto options = with(fault::none);
    world.play(tmp.file("a.mcap"), options);
    CHECK_THROWS_WITH(world.play(tmp.file("a.mcap"), options), Contains("another world"));
}
