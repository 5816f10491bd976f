// A process that gets no more memory.
#include "harbour.hpp"

#include <ise/core/real/environment.hpp>

#include <support/party.hpp>
#include <support/sanitizer.hpp>

#include <exception>
#include <fstream>
#include <future>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

namespace memory_test {

using namespace hostile_test;

namespace {

// A peer on a socket of the system, which waits for each step.
class blocking_peer {
public:
    explicit blocking_peer(std::uint16_t port) : line_(::socket(AF_INET, SOCK_STREAM, 0)) {
        sockaddr_in at{};
        at.sin_family = AF_INET;
        at.sin_port = htons(port);
        at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        ::connect(line_, reinterpret_cast<sockaddr*>(&at), sizeof at);
    }
    ~blocking_peer() { ::close(line_); }
    blocking_peer(const blocking_peer&) = delete;
    blocking_peer& operator=(const blocking_peer&) = delete;

    // False where the other side has closed.
    bool say(frame_type type, std::uint64_t id, ise::bytes_view body) {
        ise::buffer out;
        ise::wire::put_frame(out, type, 0, id, [&](ise::buffer& to) { to.append(body); });
        for (std::size_t done = 0; done < out.size();) {
            const auto sent = ::send(line_, out.data() + done, out.size() - done, MSG_NOSIGNAL);
            if (sent <= 0) return false;
            done += static_cast<std::size_t>(sent);
        }
        return true;
    }
    // Whether it was answered.
    bool greet() {
        ise::wire::hello hello;
        hello.self.path = "raw";
        hello.self.incarnation = 1;
        const auto body = ise::encode(hello);
        char one = 0;
        return say(frame_type::hello, 0, body) && ::recv(line_, &one, 1, 0) == 1;
    }

private:
    int line_;
};

// False where the system does not keep to it, such as an emulator.
bool limit_memory_to(std::size_t more) {
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    const rlimit now{pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE)) + more, RLIM_INFINITY};
    if (::setrlimit(RLIMIT_AS, &now) != 0) return false;
    void* beyond = ::mmap(nullptr, 2 * more, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (beyond == MAP_FAILED) return true;
    ::munmap(beyond, 2 * more);
    return false;
}

constexpr int has_no_limit = 77;

// Ends with the exit code, without ending the loop.
[[noreturn]] void serve_with_little_memory() {
    ::alarm(60);
    std::set_terminate([] { ::_exit(3); });
    ise::real_environment env;
    auto host = env.make_loop("boat");
    auto& on = host->loop();
    std::unique_ptr<party> boat;
    std::promise<std::uint16_t> listening;
    on.gate()->post([&] {
        boat = std::make_unique<party>(env, std::move(host), "boat");
        boat->provide(echo, [](blob given) { return given; });
        listening.set_value(boat->listen("tcp://127.0.0.1:0").port);
    });
    const auto port = listening.get_future().get();
    blocking_peer greedy(port);
    if (!greedy.greet()) ::_exit(1);
    if (!limit_memory_to(100u << 20)) ::_exit(has_no_limit);
    const ise::bytes content(200'000);
    ise::buffer first;
    first.append(static_cast<std::uint8_t>(frame_type::request));
    first.append(std::uint8_t{0});
    first.append(std::uint64_t{1});
    first.append(std::uint64_t{256} << 20);
    first.append(ise::bytes_view(content));
    bool open = greedy.say(frame_type::piece, 1, first.view());
    for (int piece = 1; piece < 1300 && open; ++piece) open = greedy.say(frame_type::piece, 1, content);
    if (open) ::_exit(2);
    blocking_peer other(port);
    ::_exit(other.greet() ? 0 : 4);
}

} // namespace

TEST_CASE("hostile: a message for which there is no memory ends its session, and not the process") {
    if (TESTS_MEMORY_IS_SANITIZED) return ise_test::skip("the sanitizer reserves more memory than the limit");
    const auto child = ::fork();
    if (child == 0) serve_with_little_memory();
    REQUIRE(child > 1);
    int status = -1;
    REQUIRE(::waitpid(child, &status, 0) == child);
    REQUIRE(WIFEXITED(status));
    if (WEXITSTATUS(status) == has_no_limit) return ise_test::skip("the system does not limit this process's memory");
    CHECK(WEXITSTATUS(status) == 0);
}

} // namespace memory_test
