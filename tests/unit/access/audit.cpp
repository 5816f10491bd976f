// The audit log: lines of JSON, of which refusals cannot be made too many.
#include <ise/access/audit.hpp>
#include <support/catch.hpp>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace audit_test {

using namespace ise::access;
using namespace std::chrono_literals;
using ise_test::Contains;

namespace {

audit_entry entry_at(ise::wall_time at) {
    audit_entry made;
    made.at = at;
    made.who = "ise://atirma/web";
    made.serial = "0A";
    made.from = "tls://10.0.0.1:4711";
    made.component = "atirma/communication";
    made.what = "call atirma/communication:telecommand";
    return made;
}

} // namespace

TEST_CASE("access: a line of the audit log is JSON, whatever a peer wrote") {
    auto entry = entry_at(ise::wall_time(1234567890123ms));
    CHECK(json_of(entry, 3) ==
          R"({"at":"2009-02-13T23:31:30.123Z","who":"ise://atirma/web","serial":"0A","from":"tls://10.0.0.1:4711",)"
          R"("component":"atirma/communication","what":"call atirma/communication:telecommand","verdict":"denied",)"
          R"("rule":"","left_out":3})");
    entry.allowed = true;
    entry.rule = "access.toml:7";
    entry.what = "call a:\"b\\\n\xff";
    CHECK_THAT(json_of(entry, 0),
               Contains(R"("what":"call a:\"b\\\u000a\u00ff","verdict":"allowed","rule":"access.toml:7")"));
}

TEST_CASE("access: of refusals only so many a second are kept, and how many were left out") {
    std::vector<std::string> lines;
    audit_log log([&](const std::string& line) { lines.push_back(line); });
    ise::wall_time now(100s);
    for (int at = 0; at < 50; ++at) log.keep(entry_at(now));
    CHECK(lines.size() == audit_log::most_refusals);
    auto allowed = entry_at(now);
    allowed.allowed = true;
    log.keep(allowed); // never left out
    REQUIRE(lines.size() == audit_log::most_refusals + 1);
    CHECK_THAT(lines.back(), Contains("\"left_out\":30"));
    log.keep(entry_at(now + 1s));
    REQUIRE(lines.size() == audit_log::most_refusals + 2);
    CHECK_THAT(lines.back(), Contains("\"left_out\":0"));
}

TEST_CASE("access: who floods the audit log hides nobody else's refusals, and what was left out is told") {
    std::vector<std::string> lines;
    ise::wall_time now(100s);
    auto with = [&](const std::string& text) {
        return std::count_if(lines.begin(), lines.end(), [&](const auto& one) { return one.find(text) != one.npos; });
    };
    auto refusal_of = [&](const std::string& who, ise::wall_time at) {
        auto made = entry_at(at);
        made.who = who;
        return made;
    };
    {
        audit_log log([&](const std::string& line) { lines.push_back(line); });
        for (int at = 0; at < 1000; ++at) log.keep(entry_at(now));
        log.keep(refusal_of("ise://atirma/laptop", now));
        CHECK(with("ise://atirma/laptop") == 1);
        CHECK(with("ise://atirma/web") == audit_log::most_refusals);
        SECTION("by the next line of anybody in a later second") {
            log.keep(refusal_of("ise://atirma/laptop", now + 1s));
            CHECK(with("\"left_out\":979") == 1);
            CHECK(with("ise://atirma/web") == audit_log::most_refusals + 1);
            CHECK(with("ise://atirma/laptop") == 2);
        }
        SECTION("when the log closes") {}
        SECTION("with more identities than are told apart, all of them are bounded") {
            lines.clear();
            auto later = now + 2s;
            for (std::size_t at = 0; at < 4 * audit_log::most_identities; ++at)
                log.keep(refusal_of("unix:" + std::to_string(at), later));
            CHECK(with("\"who\":\"unix:") <= static_cast<long>(audit_log::most_identities + audit_log::most_refusals));
            CHECK(with("\"who\":\"unix:") >= static_cast<long>(audit_log::most_identities));
        }
    }
    CHECK(with("\"left_out\":979") == 1);
}

TEST_CASE("access: an audit log goes to a file of its owner's") {
    auto pattern = (std::filesystem::temp_directory_path() / "audit-XXXXXX").string();
    std::filesystem::path folder = ::mkdtemp(pattern.data());
    auto file = folder / "audit.jsonl";
    std::vector<std::string> complaints;
    auto complain = [&](const std::string& why) { complaints.push_back(why); };
    for (int life = 0; life < 2; ++life) {
        auto log = audit_log::open(file.string(), complain);
        REQUIRE(log);
        log->keep(entry_at(ise::wall_time(1s)));
    }
    std::ifstream in(file);
    std::vector<std::string> lines;
    for (std::string line; std::getline(in, line);) lines.push_back(line);
    REQUIRE(lines.size() == 2);
    CHECK(lines[0] == json_of(entry_at(ise::wall_time(1s)), 0));
    CHECK((std::filesystem::status(file).permissions() & std::filesystem::perms::others_read) ==
          std::filesystem::perms::none);
    auto none = audit_log::open((folder / "nowhere" / "audit.jsonl").string(), complain);
    REQUIRE_FALSE(none);
    CHECK_THAT(none.error().message(), Contains("nowhere/audit.jsonl"));
    CHECK_FALSE(audit_log::open(folder.string(), complain));
    CHECK(complaints.empty());
    std::filesystem::remove_all(folder);
}

} // namespace audit_test
