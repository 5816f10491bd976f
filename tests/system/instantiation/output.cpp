// What components print is kept within bounds, and says what became of them.
#include "host.hpp"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <sys/mount.h>
#include <unistd.h>

using namespace host_test;
using ise_test::Contains;

namespace {

/// A file system of one megabyte, as a state folder.
class small_disk {
public:
    explicit small_disk(std::filesystem::path where) : where_(std::move(where)) {
        std::filesystem::create_directories(where_);
        if (::mount("small", where_.c_str(), "tmpfs", 0, "size=1m,mode=700") != 0)
            throw std::runtime_error(std::strerror(errno));
    }
    ~small_disk() { ::umount2(where_.c_str(), MNT_DETACH); }
    small_disk(const small_disk&) = delete;
    small_disk& operator=(const small_disk&) = delete;

    void fill() {
        int file = ::open(filler().c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
        std::string piece(4096, 'f');
        while (::write(file, piece.data(), piece.size()) > 0) {}
        ::close(file);
    }
    void make_room() { std::filesystem::remove(filler()); }

private:
    std::filesystem::path filler() const { return where_ / "filler"; }
    std::filesystem::path where_;
};

std::uintmax_t printed_bytes(const host& of) {
    std::uintmax_t bytes = 0;
    for (const char* name : {"sea+one.log", "sea+one.log.1"}) {
        std::error_code gone; // while it is being replaced
        auto size = std::filesystem::file_size(of.state_folder() / name, gone);
        if (!gone) bytes += size;
    }
    return bytes;
}

} // namespace

TEST_CASE("what is printed takes no more than its bound at any moment, however fast it comes") {
    host here;
    here.open();
    here.start("sea/one");
    constexpr std::uintmax_t bound = 2 * (256 << 10);
    ise_test::program flood({"ise", "--name-server", here.name_server(), "call", "sea/one", "say",
                             R"({"text": ")" + std::string(1000, 'x') + R"(", "times": 20000})", "--timeout", "300s"});
    std::uintmax_t most = 0;
    bool over = false;
    while (!over) {
        most = std::max(most, printed_bytes(here));
        over = here.ise({"logs", "sea/one", "-n", "1"}).out.starts_with("done") ||
               here.ise({"call", "sea/one", "say", R"({"text": "done"})", "--timeout", "300s"}).exit_code != 0;
    }
    CHECK(flood.wait().exit_code == 0);
    CHECK(most > (256 << 10));
    CHECK(most <= bound);
    CHECK(here.state("sea/one")["output_dropped"] == 0);
}

TEST_CASE("a full disk costs output, and nothing else") {
    if (::geteuid() != 0 || !std::getenv("ISE_IN_PID_NAMESPACE"))
        return ise_test::skip("takes root, to mount a small file system");
    host here;
    small_disk disk(here.state_folder());
    here.open();
    int first = here.start("sea/one", {"--restart", "on-failure"})["process_id"];
    disk.fill();
    CHECK(here.start("sea/other")["state"] == "ready"); // there is room for the state
    here.json_of({"stop", "sea/other"});
    here.ise({"call", "sea/one", "say", R"({"text": ")" + std::string(1000, 'x') + R"(", "times": 2000})", "--timeout",
              "300s"});
    wait_until([&] { return here.state("sea/one")["output_dropped"] > 0; });
    CHECK(here.state("sea/one")["output_trouble"] == "No space left on device");
    CHECK_THAT(here.ise({"ps"}).out, Contains("of its output were dropped: No space left on device"));
    CHECK_THAT(here.ise({"doctor"}).out, Contains("make room on the disk"));

    send_signal(first, SIGKILL); // it is started again while nothing can be written
    wait_until([&] {
        auto now = here.state("sea/one");
        return now["state"] == "ready" && now["process_id"] != first;
    });
    int second = here.state("sea/one")["process_id"];
    here.crash();
    here.open();
    auto found = here.state("sea/one");
    CHECK(found["process_id"] == second);
    CHECK(found["adopted"] == true);
    CHECK(found["restarts"] == 1);

    disk.make_room();
    wait_until([&] {
        here.ise({"call", "sea/one", "say", R"({"text": "there is room again"})"});
        return here.ise({"logs", "sea/one"}).out.find("there is room again\n") != std::string::npos;
    });
    CHECK_THAT(here.ise({"logs", "sea/one"}).out, Contains("bytes of output were dropped: No space left on device\n"));
    wait_until([&] { return here.state("sea/one")["output_trouble"] == ""; });
    CHECK(here.json_of({"stop", "sea/one"})["state"] == "stopped");
    CHECK_FALSE(lives(second));
    CHECK(marked().empty());
}

TEST_CASE("the log has the last words before a crash, and how each life ended") {
    host here;
    here.open();
    here.start("sea/one", {"--restart", "on-failure"});
    here.ise({"call", "sea/one", "crash", R"({"text": "last words"})"});
    wait_until([&] {
        auto now = here.state("sea/one");
        return now["state"] == "ready" && now["restarts"] == 1;
    });
    auto log = here.ise({"logs", "sea/one"}).out;
    CHECK_THAT(log, Contains("last words\n") &&
                        Contains("\n--- life 1: ended by signal 6 (Aborted)\n--- life 2: started again after "));
    here.json_of({"stop", "sea/one"});
    CHECK_THAT(here.ise({"logs", "sea/one", "-n", "1"}).out,
               ise_test::StartsWith("--- life 2: ended with exit code 0"));
}
