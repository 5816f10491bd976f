#include "../output.hpp"

#include "../exit_code.hpp"

#include <fmt/format.h>

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <climits>
#include <csignal>
#include <memory>

namespace ise::cli {
namespace {

// Bytes on their way out. Never more at once than a pipe takes without blocking once it is writable.
struct outgoing {
    std::string text;
    std::size_t written = 0;
    int problem = 0;
    std::atomic<bool> abandoned{false};

    bool done() const noexcept { return problem != 0 || written == text.size(); }

    // Writes as long as it can without waiting longer than `patience_ms` for room; false if there was none.
    bool push(int patience_ms) {
        while (!done()) {
            pollfd out{STDOUT_FILENO, POLLOUT, 0};
            int ready = ::poll(&out, 1, patience_ms);
            if (ready == 0 || (ready < 0 && errno == EINTR)) return false;
            auto size = std::min<std::size_t>(text.size() - written, PIPE_BUF);
            auto moved = ::write(STDOUT_FILENO, text.data() + written, size);
            if (moved >= 0) {
                written += static_cast<std::size_t>(moved);
            } else if (errno == EAGAIN || errno == EINTR) {
                return false;
            } else {
                problem = errno;
            }
        }
        return true;
    }
};

// Whichever way the writing coroutine ends, nobody goes on writing.
struct giving_up {
    std::shared_ptr<outgoing> what;
    ~giving_up() { what->abandoned = true; }
};

} // namespace

task<> output::write(component& self, std::string text) {
    auto going = std::make_shared<outgoing>();
    going->text = std::move(text);
    giving_up guard{going};
    if (!going->push(0)) {
        constexpr int look_up_ms = 50;
        auto rest = [going] {
            while (!going->abandoned && !going->done()) going->push(look_up_ms);
        };
        co_await self.offload(std::move(rest));
    }
    if (going->problem == EPIPE) throw reader_gone();
    if (going->problem != 0)
        throw problem(exit_code::no_output, "no_output",
                      fmt::format("standard output cannot be written: {}",
                                  std::error_code(going->problem, std::generic_category()).message()));
}

bool output::is_terminal() const { return ::isatty(STDOUT_FILENO) == 1; }

std::size_t output::width() const {
    winsize size{};
    if (!is_terminal() || ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0) return 0;
    return size.ws_col;
}

void prepare_standard_streams() {
    std::signal(SIGPIPE, SIG_IGN);
    for (int number : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
        if (::fcntl(number, F_GETFD) != -1 || errno != EBADF) continue;
        // The lowest free number is this one. Opened the wrong way round: reading and writing still fail.
        [[maybe_unused]] int opened = ::open("/dev/null", number == STDIN_FILENO ? O_WRONLY : O_RDONLY);
    }
}

void complain(const std::string& line) {
    std::string_view left = line;
    while (!left.empty()) {
        auto moved = ::write(STDERR_FILENO, left.data(), left.size());
        if (moved < 0 && errno == EINTR) continue;
        if (moved <= 0) return; // nobody to tell
        left.remove_prefix(static_cast<std::size_t>(moved));
    }
}

} // namespace ise::cli
