// An operator at the console's real window, worked by mouse and keyboard, while a node and its own telecommands fail.
#include "deployment.hpp"

#include <apps/window_view.hpp>

#include <ise/packet/json.hpp>

#include <fstream>
#include <iterator>

using ise_test::Contains;

namespace {

std::string text_of(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

std::size_t count_in(const std::string& text, const std::string& what) {
    std::size_t found = 0;
    for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++found;
    return found;
}

} // namespace

TEST_CASE("processes: what an operator gives at the console's window ends in its list, and is on record, although the "
          "node is killed") {
    deployment it;
    it.run_atirma("air", "xbee-link", {"--shore-port", it.file("shore"), "--boat-port", it.file("boat")});
    it.run_atirma("boat", "boat-simulator", {"--serial", it.file("boat")});
    it.run_atirma("xbee", "xbee-proxy", {"--serial", it.file("shore")});
    it.run_atirma("one", "communication-node",
                  {"--path", "atirma/shore/one", "--file", it.file("one.db"), "--proxy", "xbee=atirma/shore/xbee"});
    it.run("window", {"atirma_window_operator", "--name", "carla", "--seed", "5", "--for", "60", "--out",
                      it.file("carla.json"), "--picture", it.file("carla.png")});
    auto record = [&] { return it.call("atirma/communication", "telecommand_record", "{}").out; };
    auto given = [&] { return count_in(record(), R"("asked_by":"atirma/console/carla")"); };
    REQUIRE(it.until([&] { return given() >= 2; }));
    it.kill("one");
    it.run_again("one");
    REQUIRE(it.until([&] { return given() >= 4; }));
    auto ended = it.end("window");
    INFO(ended.err);
    CHECK(ended.exit_code == 0);

    auto seen = ise::from_json<atirma::window_view>(text_of(it.file("carla.json")));
    CHECK(seen.left);
    CHECK(seen.fix);
    CHECK_THAT(seen.place, Contains("The boat at "));
    CHECK(seen.track > 0);
    CHECK(seen.packets > 0);
    CHECK(seen.clicks > 10);
    CHECK(seen.keys > 10);
    CHECK(seen.given >= 4);
    CHECK(seen.commands.size() >= seen.given);
    auto known = record();
    for (const auto& one : seen.commands) {
        INFO(one.id << " " << one.what << ": " << one.phase << " " << one.words);
        CHECK(one.has_ended());
        if (one.accepted) CHECK_THAT(known, Contains(fmt::format(R"("id":{},)", one.id)));
    }
    CHECK(text_of(it.file("carla.png")).size() > 10'000);
}
