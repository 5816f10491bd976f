// environment-boundary: what an instantiation server does to its host is done here
#include <ise/core/real/own_file.hpp>
#include <ise/instantiation/process_table.hpp>
#include <ise/instantiation/real_machine.hpp>

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace ise::instantiation {
namespace {

constexpr std::size_t reserved_step = 64 << 10;

// Errors are in errno. Blocks that the file has are overwritten, so that none must be found.
bool overwrite_reserved(int to, std::string_view text) {
    struct stat about {};
    if (::fstat(to, &about) != 0) return false;
    if (!S_ISREG(about.st_mode) || about.st_uid != ::geteuid() || about.st_nlink != 1) {
        errno = EPERM;
        return false;
    }
    auto size = static_cast<off_t>(text.size());
    if (about.st_size < size)
        if (int problem = ::posix_fallocate(to, 0, size); problem != 0) {
            errno = problem;
            return false;
        }
    for (off_t at = 0; at < size;) {
        auto moved = ::pwrite(to, text.data() + at, static_cast<std::size_t>(size - at), at);
        if (moved < 0 && errno == EINTR) continue;
        if (moved <= 0) return false;
        at += moved;
    }
    return ::ftruncate(to, size) == 0 && ::fsync(to) == 0;
}

} // namespace

result<void> real_machine::replace_reserved(const std::string& path, const std::string& content) {
    auto spare = spare_of(path);
    auto refused = [&] {
        return io_failure(fmt::format("cannot write {}", spare), std::error_code(errno, std::system_category()));
    };
    auto text = content;
    text.resize((content.size() + reserved_step - 1) / reserved_step * reserved_step, ' ');
    constexpr int own_file = O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW;
    file_handle to(::open(spare.c_str(), own_file, 0600));
    if (!to || !overwrite_reserved(to.get(), text)) return refused();
    bool exchanged = ::renameat2(AT_FDCWD, spare.c_str(), AT_FDCWD, path.c_str(), RENAME_EXCHANGE) == 0;
    if (!exchanged) { // the first time, or a file system that cannot do it
        if (::rename(spare.c_str(), path.c_str()) != 0) return refused();
        file_handle room(::open(spare.c_str(), own_file, 0600));
        if (room) [[maybe_unused]]
            auto kept = ::posix_fallocate(room.get(), 0, static_cast<off_t>(text.size()));
    }
    [[maybe_unused]] auto unsynced = sync_folder_of(path);
    return {};
}

} // namespace ise::instantiation
