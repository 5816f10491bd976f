#include <ise/core/real/environment.hpp>

#include <ise/core/real/ownership.hpp>

#include <fmt/format.h>

#include <cerrno>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace ise {

result<std::string> real_environment::read_secret(const std::string& path, std::size_t max_bytes) {
    auto refuse = [&](std::string_view why) {
        return failure(errc::io_failed, fmt::format("cannot read {}: {}", path, why));
    };
    int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK); // a pipe must not block
    if (file < 0) return refuse(std::error_code(errno, std::system_category()).message());
    struct closing {
        int file;
        ~closing() { ::close(file); }
    } guard{file};
    struct stat about {};
    if (::fstat(file, &about) != 0 || !S_ISREG(about.st_mode)) return refuse("it is not a plain file");
    if ((about.st_mode & (S_IRWXO | S_IWGRP)) != 0)
        return failure(errc::unauthorized,
                       fmt::format("{} holds a secret, and others than its owner may use it (mode {:o}): chmod 600 {}",
                                   path, about.st_mode & 0777, path));
    if (auto own = check_own_file(path, "read"); !own) return own.error();
    std::string content;
    char piece[4096];
    for (;;) {
        auto count = ::read(file, piece, sizeof piece);
        if (count < 0 && errno == EINTR) continue;
        if (count < 0) return refuse(std::error_code(errno, std::system_category()).message());
        if (count == 0) return content;
        content.append(piece, static_cast<std::size_t>(count));
        if (content.size() > max_bytes)
            return failure(errc::too_large, fmt::format("{} has more than {} bytes", path, max_bytes));
    }
}

} // namespace ise
