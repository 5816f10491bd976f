#include <ise/core/real/line_file.hpp>

#include <fmt/format.h>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace ise {
namespace {

failure line_file_failure(std::string_view what, const std::string& path) {
    return io_failure(fmt::format("{} {}", what, path), std::error_code(errno, std::system_category()));
}

} // namespace

result<std::shared_ptr<line_file>> line_file::open(const std::string& path) {
    int descriptor = ::open(path.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NOCTTY | O_NONBLOCK, 0600);
    if (descriptor < 0) return line_file_failure("cannot write to", path);
    std::shared_ptr<line_file> made(new line_file(descriptor, path));
    struct stat is {};
    if (::fstat(descriptor, &is) != 0) return line_file_failure("cannot look at", path);
    if (!S_ISREG(is.st_mode)) return failure(errc::invalid_argument, fmt::format("{} is no file", path));
    return made;
}

line_file::~line_file() { ::close(descriptor_); }

result<void> line_file::append(std::string_view line) {
    std::string whole(line);
    whole += '\n';
    for (;;) {
        auto written = ::write(descriptor_, whole.data(), whole.size());
        if (written == static_cast<ssize_t>(whole.size())) return {};
        if (written < 0 && errno == EINTR) continue;
        if (written >= 0) errno = ENOSPC;
        return line_file_failure("cannot write to", path_);
    }
}

} // namespace ise
