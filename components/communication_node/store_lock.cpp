// environment-boundary: SQLite opens the file of a store by itself; the lock beside it is of the operating system, too
#include <components/communication_node/store_lock.hpp>

#include <ise/core/real/ownership.hpp>

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <fcntl.h>
#include <string_view>
#include <system_error>
#include <unistd.h>

namespace atirma {
namespace {

struct open_file {
    explicit open_file(int of) : number(of) {}
    ~open_file() {
        if (number >= 0) ::close(number);
    }
    int number;
};

/// The process that wrote its id there.
std::string holder(int lock) {
    std::array<char, 32> text{};
    auto size = ::pread(lock, text.data(), text.size(), 0);
    if (size <= 0) return "another process";
    return fmt::format("pid {}", std::string_view(text.data(), static_cast<std::size_t>(size)));
}

} // namespace

ise::result<store_lock> store_lock::take(const std::string& file) {
    store_lock made;
    if (file.starts_with("memory:")) return made;
    auto own = ise::check_own_file(file, "open");
    if (!own) return own.error();
    auto path = file + "-lock";
    auto lock = std::make_shared<open_file>(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
    auto refused = [&] {
        return ise::failure(
            ise::errc::io_failed,
            fmt::format("cannot lock {}: {}", path, std::error_code(errno, std::system_category()).message()));
    };
    if (lock->number < 0) return refused();
    // Of the open file, not of the process: two stores of one process exclude each other as well.
    struct flock whole {};
    whole.l_type = F_WRLCK;
    if (::fcntl(lock->number, F_OFD_SETLK, &whole) != 0) {
        if (errno != EAGAIN && errno != EACCES) return refused();
        return ise::failure(ise::errc::io_failed,
                            fmt::format("cannot open {}: in use by {}; stop that, or give each node a file of its own "
                                        "(--file)",
                                        file, holder(lock->number)));
    }
    // For the message only: a full disk does not keep the store from being opened.
    auto id = std::to_string(::getpid());
    if (::ftruncate(lock->number, 0) == 0) (void)!::pwrite(lock->number, id.data(), id.size(), 0);
    made.held_ = std::move(lock);
    return made;
}

} // namespace atirma
