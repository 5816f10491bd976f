#include "../output.hpp"

#include "../exit_code.hpp"

#include <fmt/format.h>

#include <windows.h>

#include <fcntl.h>
#include <io.h>

#include <algorithm>
#include <atomic>
#include <memory>

namespace ise::cli {
namespace {

HANDLE standard_output() { return ::GetStdHandle(STD_OUTPUT_HANDLE); }

struct outgoing {
    std::string text;
    DWORD problem = 0;
    std::atomic<bool> abandoned{false};

    void write() {
        constexpr std::size_t piece = 4096;
        for (std::size_t at = 0; at < text.size() && problem == 0 && !abandoned;) {
            DWORD moved = 0;
            const auto size = static_cast<DWORD>(std::min(text.size() - at, piece));
            if (!::WriteFile(standard_output(), text.data() + at, size, &moved, nullptr)) problem = ::GetLastError();
            at += moved;
        }
    }
};

// Whichever way the writing coroutine ends, nobody goes on writing, nor waits for a reader.
struct giving_up {
    std::shared_ptr<outgoing> what;
    ~giving_up() {
        what->abandoned = true;
        ::CancelIoEx(standard_output(), nullptr);
    }
};

} // namespace

// Whether a pipe has room cannot be asked: all is written where waiting holds up nobody.
task<> output::write(component& self, std::string text) {
    auto going = std::make_shared<outgoing>();
    going->text = std::move(text);
    giving_up guard{going};
    auto all = [going] { going->write(); };
    co_await self.offload(std::move(all));
    if (going->problem == ERROR_BROKEN_PIPE || going->problem == ERROR_NO_DATA) throw reader_gone();
    if (going->problem != 0)
        throw problem(exit_code::no_output, "no_output",
                      fmt::format("standard output cannot be written: {}",
                                  std::error_code(static_cast<int>(going->problem), std::system_category()).message()));
}

bool output::is_terminal() const {
    DWORD mode = 0;
    return ::GetConsoleMode(standard_output(), &mode) != 0;
}

std::size_t output::width() const {
    CONSOLE_SCREEN_BUFFER_INFO about{};
    if (!::GetConsoleScreenBufferInfo(standard_output(), &about)) return 0;
    return static_cast<std::size_t>(about.srWindow.Right - about.srWindow.Left + 1);
}

// Lines end as they do elsewhere; texts are UTF-8, with colours as of a terminal.
void prepare_standard_streams() {
    for (int number : {0, 1, 2}) ::_setmode(number, _O_BINARY);
    ::SetConsoleOutputCP(CP_UTF8);
    DWORD mode = 0;
    if (::GetConsoleMode(standard_output(), &mode))
        ::SetConsoleMode(standard_output(), mode | ENABLE_VIRTUAL_TERMINAL_PROCESSING);
}

void complain(const std::string& line) {
    DWORD moved = 0;
    ::WriteFile(::GetStdHandle(STD_ERROR_HANDLE), line.data(), static_cast<DWORD>(line.size()), &moved, nullptr);
}

} // namespace ise::cli
