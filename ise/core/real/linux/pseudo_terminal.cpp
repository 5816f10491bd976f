#include <ise/core/real/linux/descriptor_stream.hpp>
#include <ise/core/real/sockets.hpp>

#include <asio/buffer.hpp>
#include <asio/posix/stream_descriptor.hpp>

#include <fmt/format.h>

#include <array>
#include <cstdlib>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

namespace ise::real {
namespace {

using terminal_end = asio::posix::stream_descriptor;

/// The master, which takes its link along.
class master_stream final : public stream {
public:
    master_stream(terminal_end master, std::string device, std::string link)
        : inner_(std::move(master), device), device_(std::move(device)), link_(std::move(link)) {}
    ~master_stream() override { unlink(); }

    task<transfer> read_some(asio::mutable_buffer into) override { return inner_.read_some(into); }
    transfer try_write(std::span<const asio::const_buffer> from) override { return inner_.try_write(from); }
    task<std::error_code> wait_writable() override { return inner_.wait_writable(); }
    void shutdown_write() override {}
    void close() override {
        unlink();
        inner_.close();
    }
    std::string peer() const override { return device_; }

private:
    // Only while it is ours: another program may have taken the name meanwhile.
    void unlink() {
        std::array<char, 256> target{};
        if (link_.empty()) return;
        auto size = ::readlink(link_.c_str(), target.data(), target.size());
        if (size > 0 && std::string_view(target.data(), static_cast<std::size_t>(size)) == device_)
            ::unlink(link_.c_str());
        link_.clear();
    }

    descriptor_stream<terminal_end> inner_;
    std::string device_, link_;
};

std::error_code last_error() { return {errno, std::system_category()}; }

// A link that a dead program left: the terminal is gone, or is another one that was given the same number since.
bool stale(const std::string& link) {
    struct stat itself {
    }, behind{};
    if (::lstat(link.c_str(), &itself) != 0 || !S_ISLNK(itself.st_mode)) return false;
    if (::stat(link.c_str(), &behind) != 0) return true;
    return S_ISCHR(behind.st_mode) && std::pair(itself.st_mtim.tv_sec, itself.st_mtim.tv_nsec) <
                                          std::pair(behind.st_ctim.tv_sec, behind.st_ctim.tv_nsec);
}

result<void> make_link(const std::string& device, const std::string& link) {
    if (::symlink(device.c_str(), link.c_str()) == 0) return {};
    auto problem = last_error();
    if (problem != std::errc::file_exists) return io_failure(fmt::format("cannot make the link {}", link), problem);
    if (!stale(link))
        return failure(
            errc::address_in_use,
            fmt::format("cannot make the link {}: something is there and in use; choose another name or remove it",
                        link));
    ::unlink(link.c_str());
    if (::symlink(device.c_str(), link.c_str()) != 0)
        return io_failure(fmt::format("cannot make the link {}", link), last_error());
    return {};
}

} // namespace

result<pseudo_terminal> open_pseudo_terminal(loop& on, const std::string& link) {
    int raw = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
    if (raw < 0) return io_failure("cannot make a pseudo-terminal", last_error());
    terminal_end master(on.get_executor(), raw);
    std::array<char, 128> name{};
    // Raw from the start: nothing is echoed before a program opens it. Set through the master, so that the device
    // was never opened and a read waits for whoever opens it first.
    termios settings{};
    if (::grantpt(raw) != 0 || ::unlockpt(raw) != 0 || ::tcgetattr(raw, &settings) != 0)
        return io_failure("cannot prepare a pseudo-terminal", last_error());
    ::cfmakeraw(&settings);
    if (::tcsetattr(raw, TCSANOW, &settings) != 0) return io_failure("cannot prepare a pseudo-terminal", last_error());
    if (int problem = ::ptsname_r(raw, name.data(), name.size()); problem != 0)
        return io_failure("cannot name a pseudo-terminal", std::error_code(problem, std::system_category()));
    std::string device(name.data());
    if (!link.empty()) {
        auto linked = make_link(device, link);
        if (!linked) return linked.error();
    }
    return pseudo_terminal{std::make_unique<master_stream>(std::move(master), device, link),
                           link.empty() ? device : link};
}

} // namespace ise::real
