#include "../keys_files.hpp"

#include "../exit_code.hpp"

#include <ise/core/real/environment.hpp>
#include <ise/core/real/own_file.hpp>

#include <fmt/format.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string_view>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace ise::cli {
namespace {

constexpr std::size_t max_file = 1u << 20;

[[noreturn]] void fail(std::string_view doing, const std::string& file, int why, const std::string& advice = {}) {
    throw problem(exit_code::failed, "io_failed", fmt::format("cannot {} {}: {}", doing, file, std::strerror(why)),
                  advice);
}

// A file that is open, and removed again unless it was finished.
class draft {
public:
    draft(int handle, std::string name) : name_(std::move(name)), handle_(handle) {}
    draft(const draft&) = delete;
    draft& operator=(const draft&) = delete;
    ~draft() {
        if (handle_ >= 0) ::close(handle_);
        if (!finished_) ::unlink(name_.c_str());
    }
    const std::string& name() const { return name_; }

    void write(std::string_view text, unsigned mode) {
        if (::fchmod(handle_, mode) != 0) fail("protect", name_, errno);
        while (!text.empty()) {
            auto moved = ::write(handle_, text.data(), text.size());
            if (moved < 0 && errno == EINTR) continue;
            if (moved < 0) fail("write", name_, errno);
            text.remove_prefix(static_cast<std::size_t>(moved));
        }
        if (::fsync(handle_) != 0) fail("write", name_, errno);
        int handle = std::exchange(handle_, -1);
        if (::close(handle) != 0) fail("write", name_, errno);
    }
    void finish() { finished_ = true; }

private:
    std::string name_;
    int handle_;
    bool finished_ = false;
};

} // namespace

bool is_folder(const std::string& path) {
    std::error_code none;
    return std::filesystem::is_directory(path, none);
}

bool is_there(const std::string& path) {
    struct stat found {};
    return ::lstat(path.c_str(), &found) == 0;
}

void make_folder(const std::string& path) {
    if (is_folder(path)) return;
    if (::mkdir(path.c_str(), folder_mode) != 0) fail("make the folder", path, errno);
}

std::shared_ptr<const void> lock_folder(const std::string& path) {
    auto file = (std::filesystem::path(path) / "lock").string();
    int handle = ::open(file.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, secret_mode);
    if (handle < 0) fail("open", file, errno);
    std::shared_ptr<const void> held(nullptr, [handle](const void*) { ::close(handle); });
    struct flock whole {};
    whole.l_type = F_WRLCK;
    while (::fcntl(handle, F_OFD_SETLKW, &whole) != 0)
        if (errno != EINTR) fail("lock", file, errno);
    return held;
}

std::string read_public(const std::string& file) {
    real_environment env;
    auto text = env.read_trusted(file, max_file);
    if (!text) throw problem(exit_code::failed, std::string(name_of(text.error().code())), text.error().message());
    return std::move(*text);
}

std::string read_private(const std::string& file) {
    real_environment env;
    auto text = env.read_secret(file, max_file);
    if (!text) throw problem(exit_code::failed, std::string(name_of(text.error().code())), text.error().message());
    return std::move(*text);
}

void write_new(const std::string& file, const std::string& text, unsigned mode) {
    int handle = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, secret_mode);
    if (handle < 0 && errno == EEXIST)
        throw problem(exit_code::failed, "exists", fmt::format("{} is there already; it is not replaced", file),
                      "move it away, or choose another folder");
    if (handle < 0) fail("make", file, errno);
    draft made(handle, file);
    made.write(text, mode);
    made.finish();
    [[maybe_unused]] auto unsynced = sync_folder_of(file);
}

void replace(const std::string& file, const std::string& text, unsigned mode) {
    auto pattern = file + ".XXXXXX";
    int handle = ::mkostemp(pattern.data(), O_CLOEXEC);
    if (handle < 0) fail("make", pattern, errno);
    draft made(handle, pattern);
    made.write(text, mode);
    if (::rename(made.name().c_str(), file.c_str()) != 0) fail("replace", file, errno);
    made.finish();
    [[maybe_unused]] auto unsynced = sync_folder_of(file);
}

} // namespace ise::cli
