#include "sea.hpp"

#include <ise/core/log.hpp>

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>

namespace log_test {

using namespace sea;

namespace {

std::string line_of(std::string message, std::string value) {
    ise::log_record record;
    record.at = std::chrono::sys_days(std::chrono::year(2026) / 11 / 21) + 10h + 123ms;
    record.level = ise::log_level::warning;
    record.component = "atirma/xbee";
    record.message = message;
    std::initializer_list<ise::log_field> fields = {{"device", std::move(value)}};
    record.fields = fields;
    return ise::format_line(record);
}

} // namespace

TEST_CASE("a record is a line with time, level, component, message and fields") {
    CHECK(line_of("the port is gone", "/dev/ttyUSB0") ==
          "2026-11-21T10:00:00.123Z warning atirma/xbee: the port is gone device=/dev/ttyUSB0\n");
    CHECK(line_of("gone", "") == "2026-11-21T10:00:00.123Z warning atirma/xbee: gone device=\"\"\n");
    CHECK(line_of("gone", "a b") == "2026-11-21T10:00:00.123Z warning atirma/xbee: gone device=\"a b\"\n");
}

TEST_CASE("a value cannot pass for another field") {
    CHECK(line_of("gone", "x\" forged=\"y").ends_with("device=\"x\\\" forged=\\\"y\"\n"));
    CHECK(line_of("gone", "back\\").ends_with("device=\"back\\\\\"\n"));
}

TEST_CASE("a record is one line of bounded length, whatever a text holds") {
    auto text = GENERATE(std::string("two\nlines"), std::string("a\r\nb\x1b[31mred\x7f"),
                         std::string("nul\0inside", 10), std::string(1'000'000, 'x'), std::string(1'000'000, '"'), [] {
                             std::string all;
                             while (all.size() < 100'000) all += "\xc3\xa9";
                             return all;
                         }());
    for (const auto& line : {line_of(text, "short"), line_of("short", text)}) {
        CHECK(std::count(line.begin(), line.end(), '\n') == 1);
        CHECK(line.back() == '\n');
        CHECK(line.size() < 10'000);
        CHECK(std::none_of(line.begin(), line.end() - 1,
                           [](char letter) { return static_cast<unsigned char>(letter) < 0x20 || letter == 0x7f; }));
        // No letter is cut in two: every lead byte is followed by its continuation.
        for (std::size_t at = 0; at + 1 < line.size(); ++at)
            if (static_cast<unsigned char>(line[at]) == 0xc3) CHECK(static_cast<unsigned char>(line[at + 1]) == 0xa9);
    }
}

TEST_CASE("what is no UTF-8, and what a terminal obeys or does not show, is escaped") {
    auto shown = [](std::string value) {
        auto line = line_of("gone", std::move(value));
        auto at = line.find("device=");
        return line.substr(at + 7, line.size() - at - 8);
    };
    CHECK(shown("Gr\xc3\xbc\xc3\x9f"
                "e\xe2\x82\xac\xf0\x9f\x9a\xa2") == "Gr\xc3\xbc\xc3\x9f"
                                                    "e\xe2\x82\xac\xf0\x9f\x9a\xa2");
    CHECK(shown("a\x9b"
                "31m") == "a\\x9b31m"); // CSI in one byte
    CHECK(shown("a\xc2\x9b"
                "31m") == "a\\u{9b}31m"); // the same as UTF-8
    CHECK(shown("\xff\xfe") == "\\xff\\xfe");
    CHECK(shown("\xc0\xaf\xe0\x80\xaf") == "\\xc0\\xaf\\xe0\\x80\\xaf"); // overlong
    CHECK(shown("\xed\xa0\x80") == "\\xed\\xa0\\x80");                   // half a pair
    CHECK(shown("\xf4\x90\x80\x80") == "\\xf4\\x90\\x80\\x80");          // beyond Unicode
    CHECK(shown("txt.\xe2\x80\xae"
                "exe") == "txt.\\u{202e}exe"); // backwards from here on
    CHECK(shown("a\xe2\x80\xa8"
                "b") == "a\\u{2028}b");
    CHECK(shown("cut\xe2\x82") == "cut\\xe2\\x82");
}

TEST_CASE("a full disk under the log stops nothing") {
    auto full = ::open("/dev/full", O_WRONLY);
    REQUIRE(full >= 0);
    auto kept = ::dup(STDERR_FILENO);
    ::dup2(full, STDERR_FILENO);
    auto sink = ise::log_to_stderr();
    fleet all;
    int logged = 0;
    auto options = ise::node_options();
    options.use_names = false;
    options.log = sink;
    {
        ise::node node(all.process("boat"), options);
        node.start("boat", [&](ise::component& self) -> task<> {
            for (; logged < 100; ++logged) self.log().error("aground");
            co_return;
        });
        all.world.run_for(1s);
    }
    ::dup2(kept, STDERR_FILENO);
    ::close(kept);
    ::close(full);
    CHECK(logged == 100);
}

TEST_CASE("a sink that throws stops nothing") {
    fleet all;
    bool went_on = false;
    auto options = ise::node_options();
    options.use_names = false;
    options.log = [](const ise::log_record&) { throw std::runtime_error("no sink"); };
    ise::node node(all.process("boat"), options);
    node.start("boat", [&](ise::component& self) -> task<> {
        self.log().error("aground");
        went_on = true;
        co_return;
    });
    all.world.run_for(1s);
    CHECK(went_on);
}

} // namespace log_test
