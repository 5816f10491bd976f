// ise: lists, describes, calls and listens to running components, without their headers.
#include "command.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string_view>

namespace {

using namespace ise::cli;

exit_code print(std::string_view text) {
    while (!text.empty()) {
        const auto piece = static_cast<unsigned>(std::min<std::size_t>(text.size(), 1u << 20)); // as Windows counts
        auto moved = ::write(STDOUT_FILENO, text.data(), piece);
        if (moved < 0 && errno == EINTR) continue;
        if (moved < 0 && errno == EPIPE) return exit_code::ok; // whoever read it has seen enough
        if (moved < 0)
            throw problem(exit_code::no_output, "no_output",
                          std::string("standard output cannot be written: ") + std::strerror(errno));
        text.remove_prefix(static_cast<std::size_t>(moved));
    }
    return exit_code::ok;
}

} // namespace

int main(int count, char** arguments) {
    prepare_standard_streams();
    // The command line may be unreadable; whether a program reads the errors is to be known all the same.
    bool json =
        std::any_of(arguments, arguments + count, [](const char* one) { return std::string_view(one) == "--json"; });
    try {
        auto wanted = read_command_line(count, arguments);
        return static_cast<int>(wanted.work ? run(wanted) : print(wanted.text));
    } catch (const problem& why) {
        report(why, json);
        return static_cast<int>(why.code());
    } catch (const std::exception& thrown) {
        report(problem(exit_code::failed, "unexpected", thrown.what()), json);
        return static_cast<int>(exit_code::failed);
    }
}
