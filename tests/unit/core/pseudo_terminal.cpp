#include <ise/asio.hpp>
#include <ise/core/real/environment.hpp>

#include <support/catch.hpp>

#include <asio/buffer.hpp>
#include <asio/detached.hpp>
#include <asio/io_context.hpp>

#include <filesystem>
#include <fstream>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>

namespace pseudo_terminal_test {

namespace {

struct terminal_room {
    terminal_room() : folder(std::filesystem::temp_directory_path() / ("ise-pty-" + std::to_string(env.random()))) {
        std::filesystem::create_directory(folder);
    }
    ~terminal_room() { std::filesystem::remove_all(folder); }
    std::string link() const { return (folder / "modem").string(); }

    ise::real_environment env;
    asio::io_context context{1};
    std::unique_ptr<ise::loop_host> host = env.adopt(context.get_executor(), true);
    std::filesystem::path folder;
};

std::string carry(terminal_room& room, ise::stream& from, ise::stream& to, std::string text) {
    asio::const_buffer piece(text.data(), text.size());
    REQUIRE(from.try_write(std::span(&piece, 1)).bytes == text.size());
    std::string got;
    auto read = [](ise::stream& at, std::string& into, std::size_t size) -> ise::task<> {
        while (into.size() < size) {
            std::array<char, 64> buffer;
            auto moved = co_await at.read_some(asio::buffer(buffer));
            if (moved.problem) co_return;
            into.append(buffer.data(), moved.bytes);
        }
    };
    ise::async_run(room.context.get_executor(), read(to, got, text.size()), asio::detached);
    room.context.restart();
    room.context.run();
    return got;
}

ise::serial_options device(const std::string& path) {
    ise::serial_options made;
    made.device = path;
    return made;
}

} // namespace

TEST_CASE("pseudo-terminal: what is opened as a serial port carries every byte both ways, unchanged") {
    terminal_room room;
    auto made = room.env.open_pseudo_terminal(room.host->loop(), room.link());
    REQUIRE(made);
    CHECK(made->device == room.link());
    auto port = room.env.open_serial(room.host->loop(), device(made->device));
    REQUIRE(port);
    std::string all;
    for (int byte = 0; byte < 256; ++byte) all += static_cast<char>(byte);
    CHECK(carry(room, *made->far_end, **port, all) == all);
    CHECK(carry(room, **port, *made->far_end, all) == all);
}

TEST_CASE("pseudo-terminal: programs that are started do not get the port") {
    terminal_room room;
    auto made = room.env.open_pseudo_terminal(room.host->loop(), room.link());
    REQUIRE(made);
    auto port = room.env.open_serial(room.host->loop(), device(room.link()));
    REQUIRE(port);
    int inherited = 0;
    for (const auto& one : std::filesystem::directory_iterator("/proc/self/fd")) {
        std::error_code gone;
        if (!std::filesystem::read_symlink(one, gone).string().starts_with("/dev/pts/")) continue;
        const int fd = std::stoi(one.path().filename().string());
        if (fd > 2) inherited += (::fcntl(fd, F_GETFD) & FD_CLOEXEC) == 0;
    }
    CHECK(inherited == 0);
}

TEST_CASE("pseudo-terminal: its link goes with it, and the port's reader learns that it is gone") {
    terminal_room room;
    auto made = room.env.open_pseudo_terminal(room.host->loop(), room.link());
    REQUIRE(made);
    auto port = room.env.open_serial(room.host->loop(), device(made->device));
    REQUIRE(port);
    made->far_end.reset();
    CHECK_FALSE(std::filesystem::is_symlink(room.link()));
    bool gone = false;
    auto read = [](ise::stream& at, bool& result) -> ise::task<> {
        std::array<char, 64> buffer;
        auto moved = co_await at.read_some(asio::buffer(buffer));
        result = static_cast<bool>(moved.problem);
    };
    ise::async_run(room.context.get_executor(), read(**port, gone), asio::detached);
    room.context.run();
    CHECK(gone);
    CHECK_FALSE(room.env.open_serial(room.host->loop(), device(room.link())));
}

TEST_CASE("pseudo-terminal: a link that a dead program left is replaced, anything else is refused") {
    terminal_room room;
    std::filesystem::create_symlink("/dev/pts/no-such-terminal", room.link());
    auto made = room.env.open_pseudo_terminal(room.host->loop(), room.link());
    REQUIRE(made);
    auto second = room.env.open_pseudo_terminal(room.host->loop(), room.link());
    REQUIRE_FALSE(second);
    CHECK(second.error().code() == ise::errc::address_in_use);
    made->far_end.reset();
    std::ofstream(room.link()) << "a file";
    auto third = room.env.open_pseudo_terminal(room.host->loop(), room.link());
    REQUIRE_FALSE(third);
    CHECK(std::filesystem::is_regular_file(room.link()));
    auto nowhere = room.env.open_pseudo_terminal(room.host->loop(), (room.folder / "none" / "modem").string());
    REQUIRE_FALSE(nowhere);
    CHECK(nowhere.error().code() == ise::errc::io_failed);
}

TEST_CASE(
    "pseudo-terminal: a link that a dead program left is replaced although its terminal's number was given again") {
    terminal_room room;
    auto& loop = room.host->loop();
    auto first = room.env.open_pseudo_terminal(loop, room.link());
    REQUIRE(first);
    auto number = std::filesystem::read_symlink(room.link());
    first->far_end.reset();
    std::filesystem::create_symlink(number, room.link()); // as after kill -9, a while ago
    const timespec long_ago[2]{};
    REQUIRE(::utimensat(AT_FDCWD, room.link().c_str(), long_ago, AT_SYMLINK_NOFOLLOW) == 0);
    std::vector<ise::pseudo_terminal> others;
    do { // another one gets the number, if nobody else on this machine was faster
        auto other = room.env.open_pseudo_terminal(loop, "");
        REQUIRE(other);
        others.push_back(std::move(*other));
    } while (!std::filesystem::exists(number));
    auto again = room.env.open_pseudo_terminal(loop, room.link());
    REQUIRE(again);
    CHECK(std::filesystem::read_symlink(room.link()) != number);
}

} // namespace pseudo_terminal_test
