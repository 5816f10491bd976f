// record and bag: a running system into a file, and parts and unions of it.
#include "folder.hpp"
#include "port.hpp"

#include <support/catch.hpp>
#include <support/program.hpp>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace recordings_test {
namespace {

using Catch::Contains;
using cli_test::folder;
using cli_test::port;
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

/// The packets of `atirma/boat/position` of a second, in a file.
struct recording {
    recording() : path(in.file("voyage.mcap")) {
        port there;
        auto made = there.ise({"record", "atirma/boat", "--only", "position", "--for", "1s", "--out", path});
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

} // namespace recordings_test
