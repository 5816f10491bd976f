#include <ise/core/real/own_file.hpp>

#include <fmt/format.h>

#include <cerrno>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace ise {
namespace {

struct open_file {
    int number;
    ~open_file() {
        if (number >= 0) ::close(number);
    }
};

bool write_all(int file, std::string_view text) {
    while (!text.empty()) {
        auto count = ::write(file, text.data(), text.size());
        if (count < 0 && errno == EINTR) continue;
        if (count < 0) return false;
        text.remove_prefix(static_cast<std::size_t>(count));
    }
    return ::fsync(file) == 0;
}

} // namespace

std::string folder_of(const std::string& path) {
    auto slash = path.rfind('/');
    return slash == path.npos ? "." : slash == 0 ? "/" : path.substr(0, slash);
}

result<void> make_own_folders(const std::string& folder) {
    if (::access(folder.c_str(), F_OK) == 0) return {};
    if (auto above = folder_of(folder); above != folder)
        if (auto made = make_own_folders(above); !made) return made;
    if (::mkdir(folder.c_str(), 0700) == 0 || errno == EEXIST) return {};
    return failure(errc::io_failed, fmt::format("cannot make the folder {}: {}", folder,
                                                std::error_code(errno, std::system_category()).message()));
}

std::error_code sync_folder_of(const std::string& path) {
    open_file folder{::open(folder_of(path).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)};
    if (folder.number >= 0 && ::fsync(folder.number) == 0) return {};
    return {errno, std::system_category()};
}

result<void> replace_own_file(const std::string& path, std::string_view content) {
    auto refuse = [&](std::error_code why = {errno, std::system_category()}) {
        return failure(errc::io_failed, fmt::format("cannot write {}: {}", path, why.message()));
    };
    auto replacement = path + ".new";
    ::unlink(replacement.c_str()); // of a process that was killed meanwhile
    open_file file{::open(replacement.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600)};
    if (file.number < 0 || !write_all(file.number, content)) return refuse();
    if (::rename(replacement.c_str(), path.c_str()) != 0) return refuse();
    if (auto unsynced = sync_folder_of(path)) return refuse(unsynced); // the new name is on the disk too
    return {};
}

} // namespace ise
