// record, bag and play: a running system into a file, parts, unions and repairs of it, and into another system.
#include "folder.hpp"
#include "port.hpp"

#include <support/catch.hpp>
#include <support/program.hpp>

#include <nlohmann/json.hpp>

#include <csignal>
#include <cstdint>
#include <filesystem>
#include <string>
#include <test_folders.hpp>
#include <utility>
#include <vector>

namespace recordings_test {
namespace {

using cli_test::folder;
using cli_test::port;
using ise_test::Contains;
using nlohmann::json;

ise_test::ran bag(std::vector<std::string> words) {
    words.insert(words.begin(), {"ise", "bag"});
    return ise_test::run_program(std::move(words));
}

json answer_of(std::vector<std::string> words) {
    words.push_back("--json");
    auto ran = bag(std::move(words));
    INFO(ran.err);
    REQUIRE(ran.exit_code == 0);
    return json::parse(ran.out);
}

/// The packets of `atirma/boat/position` of two seconds, in a file.
struct recording {
    recording() : path(in.file("voyage.mcap")) {
        port there;
        auto made = there.ise({"record", "atirma/boat", "--only", "position", "--for", "2s", "--out", path});
        INFO(made.err);
        REQUIRE(made.exit_code == 0);
    }
    folder in;
    std::string path;
};

} // namespace

TEST_CASE("bag cuts a recording into parts, which make it again when they are merged") {
    recording whole;
    auto about = answer_of({"info", whole.path});
    const auto all = about["messages"].get<std::uint64_t>();
    CHECK(all > 100);
    auto early = whole.in.file("early.mcap"), late = whole.in.file("late.mcap"), both = whole.in.file("both.mcap");
    auto first = answer_of({"cut", whole.path, "--until", "300ms", "--out", early});
    auto second = answer_of({"cut", whole.path, "--from", "300ms", "--out", late});
    CHECK(first["messages"] > 0);
    CHECK(second["messages"] > 0);
    CHECK(first["messages"].get<std::uint64_t>() + second["messages"].get<std::uint64_t>() == all);
    CHECK(answer_of({"merge", late, early, "--out", both})["messages"] == all);
    CHECK(answer_of({"check", both})["topics"] == about["topics"]);
    auto shown = bag({"cat", both, "--only", "atirma/boat/position"});
    auto same = bag({"cat", whole.path, "--only", "atirma/boat/position"});
    CHECK(shown.out == same.out);
    CHECK_THAT(shown.out, Contains(R"({"topic":"atirma/boat/position","packet":{"number":)"));
}

TEST_CASE("a part of a recording that has no message is refused, with the times that the recording has") {
    recording whole;
    auto part = whole.in.file("part.mcap");
    const auto begin = answer_of({"info", whole.path})["start"].get<std::string>().substr(0, 16);
    for (const auto& [times, text] : std::vector<std::pair<std::vector<std::string>, std::string>>{
             {{"--from", "3h"}, "has no message from 3 h 00 min after its first one on: it lasts "},
             {{"--from", "3h", "--until", "4h"},
              "has no message between 3 h 00 min and 4 h 00 min after its first one: it lasts "}}) {
        for (bool cut : {true, false}) {
            std::vector<std::string> words{cut ? "cut" : "cat", whole.path};
            words.insert(words.end(), times.begin(), times.end());
            if (cut) words.insert(words.end(), {"--out", part});
            auto ran = bag(words);
            CHECK(ran.exit_code == 2);
            CHECK(ran.out.empty());
            CHECK_THAT(ran.err, Contains(whole.path + " " + text) && Contains(", from " + begin) &&
                                    Contains("ise bag info shows its topics and times"));
        }
        CHECK_FALSE(std::filesystem::exists(part));
    }
    // One that begins before the end and ends after it has what there is.
    CHECK(answer_of({"cut", whole.path, "--from", "1ms", "--until", "3h", "--out", part})["messages"] > 0);
}

TEST_CASE("a recording that was cut is told by its name and byte, and recovered into a whole one") {
    recording whole;
    const auto all = answer_of({"info", whole.path})["messages"].get<std::uint64_t>();
    auto bytes = cli_test::text_of(whole.path);
    auto cut = whole.in.write("cut.mcap", bytes.substr(0, bytes.size() / 2)), mended = whole.in.file("mended.mcap");
    auto checked = bag({"check", cut});
    CHECK(checked.exit_code == 1);
    CHECK_THAT(checked.err, Contains(cut + ": at byte ") && Contains("ise bag recover FILE --out FILE"));
    auto got = answer_of({"recover", cut, "--out", mended});
    CHECK(got["messages"] > 0);
    CHECK(got["messages"] < all);
    CHECK(got["was_complete"] == false);
    CHECK_THAT(bag({"check", mended}).out, Contains("every byte was read: nothing is damaged"));
}

TEST_CASE("what bag cannot do is refused with the file and what to do") {
    recording whole;
    auto text = whole.in.write("notes.txt", "wind from the north-east");
    auto refused = [](std::vector<std::string> words) {
        auto ran = bag(std::move(words));
        CHECK(ran.exit_code != 0);
        CHECK(ran.out.empty());
        return ran.err;
    };
    CHECK_THAT(refused({"info", text}), Contains(text + ": at byte 0: it is not an MCAP file"));
    CHECK_THAT(refused({"info", whole.in.file("none.mcap")}), Contains(whole.in.file("none.mcap")));
    CHECK_THAT(refused({"cat", whole.path, "--only", "atirma/boat/positon"}),
               Contains(whole.path + " has no topic 'atirma/boat/positon', did you mean 'atirma/boat/position'?"));
    CHECK_THAT(refused({"cut", whole.path, "--until", "1s", "--out", text}), Contains(text + " exists already"));
    CHECK(cli_test::text_of(text) == "wind from the north-east");
    CHECK_THAT(refused({"cut", whole.path, "--until", "1s"}), Contains("'bag cut' requires --out"));
    CHECK_THAT(refused({"play", text}), Contains("'play' is none of"));
}

TEST_CASE("the component recorder writes what it is told to, with attached files") {
    port there;
    folder in;
    auto plan = in.write("sea.toml", "[components.boat]\n"), file = in.file("voyage.mcap");
    ise_test::start_options to_names;
    to_names.variables = {{"ISE_NAME_SERVER", there.at.text()}};
    ise_test::program recorder(
        {"ise_recorder", "run", "recorder", "--file", file, "--only", "position", "--attach", plan}, to_names);
    auto written = in.file("voyage_0001.mcap");
    for (std::uint64_t messages = 0; messages < 100;) {
        auto status = there.ise({"--timeout", "20s", "call", "ise/recorder", "status", "{}"});
        if (status.exit_code == 0) messages = json::parse(status.out)["messages"].get<std::uint64_t>();
    }
    auto refused = there.ise({"call", "ise/recorder", "trigger", R"({"reason":"a test"})"});
    CHECK(refused.exit_code == 1);
    CHECK_THAT(refused.err, Contains("this recorder has no ring"));
    recorder.signal(SIGINT);
    CHECK(recorder.wait().exit_code == 0);
    auto about = answer_of({"check", written});
    CHECK(about["complete"] == true);
    CHECK(about["attachments"][0]["name"] == "sea.toml");
    // Launch rules restrict what remote starts may write and read.
    auto type = json::parse(ise_test::run_program({"ise_recorder", "--describe"}).out)["types"][0];
    std::vector<std::string> paths;
    for (const auto& one : type["parameters"])
        if (one["kind"] == "path") paths.push_back(one["name"]);
    CHECK(paths == std::vector<std::string>{"file", "attach"});
}

TEST_CASE("a recording is played under another name") {
    recording whole;
    port there;
    ise_test::program plays(
        {"ise", "--name-server", there.at.text(), "play", whole.path, "--rename", "atirma/boat=replay/boat", "--loop"});
    CHECK_THAT(plays.read_error_line(), Contains("playing " + whole.path + " as replay/boat"));
    auto seen =
        there.ise({"--timeout", "20s", "echo", "replay/boat", "position", "-n", "3", "--field", "latitude_deg"});
    CHECK(seen.out == "28.15\n28.15\n28.15\n");
    plays.signal(SIGINT);
    CHECK(plays.wait().exit_code == 0);
    for (const char* option : {"--only", "--test"}) { // nothing of it is in the recording
        auto none = there.ise({"play", whole.path, option, "atirma/bota"});
        CHECK(none.exit_code != 0);
        CHECK_THAT(none.err, Contains(whole.path) && Contains("ise bag info lists its topics"));
    }
    auto text = whole.in.write("notes.txt", "wind from the north-east");
    auto refused = there.ise({"play", text});
    CHECK(refused.exit_code == 4);
    CHECK_THAT(refused.err, Contains(text + ": at byte 0: it is not an MCAP file"));
}

TEST_CASE("a recording is not played in the place of a component that runs") {
    recording whole;
    port there;
    auto held = there.ise({"play", whole.path, "--loop"});
    CHECK(held.exit_code == 1);
    CHECK_THAT(held.err, Contains("atirma/boat is not played: 'atirma/boat' is held by process") &&
                             Contains("--rename atirma/boat=OTHER plays it under another name"));
}

TEST_CASE("SIGTERM ends a recording and a replay as Ctrl-C does") {
    recording whole;
    port there;
    ise_test::program plays(
        {"ise", "--name-server", there.at.text(), "play", whole.path, "--rename", "atirma/boat=replay/boat", "--loop"});
    CHECK_THAT(plays.read_error_line(), Contains("playing " + whole.path));
    plays.signal(SIGTERM);
    auto played = plays.wait();
    CHECK(played.exit_code == 0);
    CHECK_THAT(played.out, Contains("played "));
    auto file = whole.in.file("ended.mcap");
    ise_test::program records({"ise", "--name-server", there.at.text(), "record", "--out", file});
    CHECK_THAT(records.read_error_line(), Contains("recording to " + file));
    records.signal(SIGTERM);
    CHECK(records.wait().exit_code == 0);
    CHECK(bag({"check", file}).exit_code == 0);
}

TEST_CASE("record says which of its paths nobody has, and records them when they come") {
    folder in;
    port there;
    auto ran = there.ise({"record", "atirma/bota", "atirma/shore", "--for", "300ms", "--out", in.file("none.mcap")});
    CHECK(ran.exit_code == 0);
    CHECK_THAT(ran.err, Contains("no component is registered under 'atirma/bota'; did you mean 'atirma/boat'") &&
                            !Contains("'atirma/shore'"));
}

TEST_CASE("a disk that is full ends a recording with what is left to do, and a union without a trace") {
    recording whole;
    port there;
    auto with_room = [](const char* blocks, std::vector<std::string> words) { // of 512 bytes, for each file
        words.insert(words.begin(),
                     {"/bin/sh", "-c", R"(trap '' XFSZ; ulimit -f $0; exec "$@")", blocks, ISE_BINARY_DIR "/bin/ise"});
        return ise_test::run_program(std::move(words));
    };
    auto file = whole.in.file("full.mcap"), both = whole.in.file("both.mcap");
    auto full = with_room("40", {"--name-server", there.at.text(), "record", "--compression", "none", "--out", file});
    CHECK(full.exit_code != 0);
    CHECK_THAT(full.err, Contains("cannot write " + file) && Contains("make room") &&
                             Contains("ise bag recover " + file + " --out FILE"));
    CHECK(bag({"recover", file, "--out", whole.in.file("recovered.mcap")}).exit_code == 0);
    auto none = whole.in.file("none.mcap");
    auto empty = with_room("0", {"--name-server", there.at.text(), "record", "--out", none});
    CHECK(empty.exit_code != 0);
    CHECK_THAT(empty.err, Contains("cannot write " + none) && !Contains("recover"));
    CHECK_FALSE(std::filesystem::exists(none));
    auto merged = with_room("0", {"bag", "merge", whole.path, "--out", both});
    CHECK(merged.exit_code != 0);
    CHECK_THAT(merged.err, Contains("cannot write " + both));
    CHECK_FALSE(std::filesystem::exists(both));
}

} // namespace recordings_test
