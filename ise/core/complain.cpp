#include <ise/core/complain.hpp>

#include <ise/core/readable.hpp>

#include <fmt/format.h>

#include <unistd.h>

namespace ise {

void complain(std::string_view program, std::string_view what) {
    auto line = fmt::format("{}: {}\n", readable(program), readable(what));
    [[maybe_unused]] auto written = ::write(STDERR_FILENO, line.data(), static_cast<unsigned>(line.size()));
}

} // namespace ise
