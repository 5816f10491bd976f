// A short mission on the real clock, with everything of it in processes, by the script that people start.
#include <support/catch.hpp>
#include <support/program.hpp>

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <unistd.h>

using Catch::Contains;

namespace {

struct folder {
    std::filesystem::path at =
        std::filesystem::temp_directory_path() / fmt::format("ise-mission-{}", static_cast<long>(::getpid()));
    folder() { std::filesystem::create_directory(at); }
    ~folder() { std::filesystem::remove_all(at); }
    std::string read(const std::string& name) const {
        std::ifstream in(at / name, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
};

ise_test::ran demo(std::vector<std::string> options) {
    std::vector<std::string> command{ISE_SOURCE_DIR "/apps/demo"};
    command.insert(command.end(), options.begin(), options.end());
    ise_test::start_options how;
    how.variables = {{"ATIRMA_BIN", ISE_BINARY_DIR "/bin"}};
    return ise_test::run_program(std::move(command), how);
}

} // namespace

TEST_CASE("demo: a minute's mission on the real clock, with links and processes failing, loses nothing") {
    folder out;
    auto told = demo({"--mission", "stress", "--for", "60s", "--seed", "3", "--speedup", "4", "--port", "0", "--out",
                      out.at.string()});
    INFO(told.out);
    INFO(told.err);
    INFO(out.read("report.md"));
    CHECK(told.exit_code == 0);
    CHECK_THAT(told.out, Contains("the proof holds"));
    CHECK_THAT(out.read("report.md"), Contains("on the real clock") && Contains("**The proof holds") &&
                                          Contains("the primary communication node is killed") &&
                                          Contains("the boat's computer loses its power"));
    CHECK_THAT(out.read("track.svg"), Contains("</svg>"));
    CHECK_THAT(out.read("track.gpx"), Contains("<trkpt"));
}

TEST_CASE("demo: a mission's arguments are refused with a word that says which") {
    CHECK(demo({"--mission", "picnic"}).exit_code == 2);
    CHECK_THAT(demo({"--mission", "stress", "--for", "20s"}).err, Contains("a minute at least"));
    CHECK_THAT(demo({"--seed", "3"}).err, Contains("belong to --mission"));
    CHECK_THAT(demo({"--help"}).out, Contains("--mission stress"));
}
