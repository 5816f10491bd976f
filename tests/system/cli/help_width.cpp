// The help of every program, command and component type fits a terminal of 80 columns.
#include <support/catch.hpp>
#include <support/program.hpp>

#include <ise/core/readable.hpp>

#include <cctype>
#include <set>
#include <sstream>

namespace help_width_test {

using words = std::vector<std::string>;

// The help of a command, and of the commands and types that it lists: how many there were.
std::size_t look_at(const words& command) {
    auto asked = command;
    asked.push_back("--help");
    auto ran = ise_test::run_program(asked);
    INFO(ran.out << ran.err);
    CHECK(ran.exit_code == 0);
    std::size_t count = 1;
    bool lists = false;
    std::istringstream text(ran.out);
    for (std::string line; std::getline(text, line);) {
        CHECK(ise::columns(line) <= ise::help_width);
        if (line.empty()) continue;
        if (line.front() != ' ')
            lists = command.size() < 3 && line.ends_with(':') && !line.starts_with("Option") &&
                    !line.starts_with("Argument") && !line.starts_with("Exit") && !line.starts_with("Example");
        bool names_one = lists && line.starts_with("  ") && std::islower(static_cast<unsigned char>(line[2]));
        if (!names_one) continue;
        auto inner = command;
        if (line.find("(path: ") != line.npos) inner.push_back("run"); // of a program on ise::main: a type
        inner.push_back(line.substr(2, line.find(' ', 2) - 2));
        count += look_at(inner);
    }
    return count;
}

TEST_CASE("no help has a line of more than 80 columns") {
    CHECK(look_at({"ise"}) >= 29);
    CHECK(look_at({"ise_name_server"}) == 1);
    CHECK(look_at({"ise_instantiation_server"}) == 1);
    CHECK(look_at({"atirma"}) >= 16);
    CHECK(look_at({"ise_trouble"}) == 2);
    CHECK(look_at({"atirma_stress"}) == 1);
    CHECK(look_at({"atirma_mission"}) == 1);
}

} // namespace help_width_test
