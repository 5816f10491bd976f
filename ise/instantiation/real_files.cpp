// environment-boundary: what an instantiation server does to its host is done here
#include <ise/core/real/own_file.hpp>
#include <ise/core/real/ownership.hpp>
#include <ise/instantiation/process_table.hpp>
#include <ise/instantiation/real_machine.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace ise::instantiation {
namespace {

failure refused(std::string_view what, const std::string& path) {
    return io_failure(fmt::format("cannot {} {}", what, path), std::error_code(errno, std::system_category()));
}

// Less than `most` only at the end of the file.
result<std::string> read_some(int from, std::uint64_t offset, std::size_t most, const std::string& path) {
    std::string text(most, '\0');
    std::size_t have = 0;
    while (have < most) {
        auto got = ::pread(from, text.data() + have, most - have, static_cast<off_t>(offset + have));
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) return refused("read", path);
        if (got == 0) break;
        have += static_cast<std::size_t>(got);
    }
    text.resize(have);
    return text;
}

bool is_program_name(std::string_view name) {
    return !name.empty() && name.front() != '.' && name.front() != '-' &&
           std::ranges::all_of(name, [](unsigned char letter) {
               return (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') ||
                      (letter >= '0' && letter <= '9') || letter == '_' || letter == '-' || letter == '.';
           });
}

} // namespace

std::string real_machine::boot() const {
    auto id = read_file("/proc/sys/kernel/random/boot_id", 64);
    struct stat numbers {};
    ::stat("/proc/self/ns/pid", &numbers); // numbers of processes mean something only within it
    return fmt::format("{}.{}", id ? id->substr(0, id->find('\n')) : "unknown", numbers.st_ino);
}

result<std::vector<program_file>> real_machine::programs(const std::string& folder) const {
    auto* open = ::opendir(folder.c_str());
    if (!open) return refused("read the folder", folder);
    auto own = check_own_path(folder);
    if (!own) {
        ::closedir(open);
        return own.error();
    }
    std::vector<program_file> found;
    while (const auto* entry = ::readdir(open)) {
        auto path = folder + "/" + entry->d_name;
        struct stat about {};
        if (!is_program_name(entry->d_name) || ::stat(path.c_str(), &about) != 0 || !S_ISREG(about.st_mode) ||
            ::access(path.c_str(), X_OK) != 0)
            continue;
        auto safe = check_own_path(path);
        found.push_back({entry->d_name, version_of(path), safe ? "" : safe.error().message()});
    }
    ::closedir(open);
    std::ranges::sort(found, {}, &program_file::name);
    return found;
}

result<std::string> real_machine::read_file(const std::string& path, std::size_t max_bytes) const {
    file_handle file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (!file && errno == ENOENT) return failure(errc::no_such_name, fmt::format("there is no file {}", path));
    if (!file) return refused("read", path);
    std::string text;
    for (;;) {
        auto piece = read_some(file.get(), text.size(), 65536, path);
        if (!piece) return piece.error();
        text += *piece;
        if (text.size() > max_bytes)
            return failure(errc::too_large, fmt::format("{} has more than {} bytes", path, max_bytes));
        if (piece->empty()) return text;
    }
}

result<void> real_machine::replace_file(const std::string& path, const std::string& content) {
    return replace_own_file(path, content);
}

result<void> real_machine::rename(const std::string& from, const std::string& to) {
    if (::rename(from.c_str(), to.c_str()) != 0) return refused("rename", from);
    return {};
}

std::uint64_t real_machine::size_of(const std::string& path) const {
    struct stat about {};
    return ::stat(path.c_str(), &about) == 0 ? static_cast<std::uint64_t>(about.st_size) : 0;
}

std::string real_machine::read_part(const std::string& path, std::uint64_t offset, std::size_t max_bytes) const {
    file_handle file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (!file) return {};
    auto piece = read_some(file.get(), offset, max_bytes, path);
    return piece ? std::move(*piece) : std::string();
}

void real_machine::remove(const std::string& path) { ::unlink(path.c_str()); }

} // namespace ise::instantiation
