// Connections through shared memory: honest peers, hostile ones, those that are killed, and a system that refuses.
#include <ise/transport/shm/memory.hpp>

#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/real_parties.hpp>

#include "system.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <linux/sockios.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

namespace shm_connections_test {

namespace {

using namespace boat_services;
using namespace std::chrono_literals;
using ise_test::party, ise_test::real_parties;
using namespace ise::net::shm;
using namespace shm_test;

std::string fresh_name() {
    static int made = 0;
    return fmt::format("@ise-unit-shm-{}-{}", ::getpid(), ++made);
}

ise::task<ise::result<blob>> try_echo(ise::remote there, std::size_t size) {
    blob sent;
    sent.content.assign(size, 7);
    auto got = co_await there.try_call(echo, std::move(sent), 20s);
    co_return got;
}

struct harbour {
    harbour() : boat(all.add("boat")) {
        boat.provide(echo, [](blob given) { return given; });
        boat.listen("shm://" + name);
    }
    // A call of an honest peer, which says by what it went.
    ise::result<blob> call(std::size_t size = 100) {
        if (!shore) shore = &all.add("shore");
        return all.run(*shore, try_echo(shore->at("shm://" + name), size));
    }
    std::uint64_t rejected() { return boat.services->counts().sessions_rejected; }

    real_parties all;
    std::string name = fresh_name();
    party& boat;
    party* shore = nullptr;
};

// A peer that follows the agreement as far as it likes.
struct stranger {
    explicit stranger(const std::string& name) : line(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0)) {
        sockaddr_un at{};
        at.sun_family = AF_UNIX;
        auto path = name + ".shm";
        std::memcpy(at.sun_path + 1, path.data() + 1, path.size() - 1);
        const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size());
        REQUIRE(::connect(line.get(), reinterpret_cast<sockaddr*>(&at), size) == 0);
    }
    void send(const std::string& bytes, const std::vector<int>& passed = {}) const {
        std::array<char, 256> room{};
        iovec content{const_cast<char*>(bytes.data()), bytes.size()};
        msghdr message{};
        message.msg_iov = &content;
        message.msg_iovlen = 1;
        if (!passed.empty()) {
            message.msg_control = room.data();
            message.msg_controllen = CMSG_SPACE(passed.size() * sizeof(int));
            auto* head = CMSG_FIRSTHDR(&message);
            head->cmsg_level = SOL_SOCKET;
            head->cmsg_type = SCM_RIGHTS;
            head->cmsg_len = CMSG_LEN(passed.size() * sizeof(int));
            std::memcpy(CMSG_DATA(head), passed.data(), passed.size() * sizeof(int));
        }
        REQUIRE(::sendmsg(line.get(), &message, MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size()));
    }
    // What came, up to `most` bytes; empty: the end.
    std::string receive(real_parties& all, std::size_t most = 8) const {
        std::string got(most, '\0');
        ssize_t count = -1;
        all.run_until(
            [&] { return (count = ::recv(line.get(), got.data(), most, MSG_DONTWAIT)) >= 0 || errno != EAGAIN; });
        got.resize(static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
        return got;
    }

    shm_fd line;
};

std::string offer(std::uint32_t bytes, char version = 1) {
    std::string made = "ISE-shm";
    made += version;
    for (int shift = 0; shift < 32; shift += 8) made += static_cast<char>(bytes >> shift);
    return made + std::string(4, '\0');
}
const std::string over_memory("ISE-shm\x01", 8), over_socket("ISE-shm\0", 8);

shm_fd bell() { return shm_fd(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)); }

// One that has agreed, and holds the memory.
struct agreed_stranger : stranger {
    agreed_stranger(real_parties& all, const std::string& name)
        : stranger(name), memory(memory_of(mapping::size_for(ring_bytes))), own(bell()), theirs(bell()) {
        send(offer(ring_bytes), {memory.get(), own.get(), theirs.get()});
        REQUIRE(receive(all) == over_memory);
        state = static_cast<ring_state*>(
            ::mmap(nullptr, mapping::size_for(ring_bytes), PROT_READ | PROT_WRITE, MAP_SHARED, memory.get(), 0));
        REQUIRE(static_cast<void*>(state) != MAP_FAILED);
    }
    ~agreed_stranger() { ::munmap(state, mapping::size_for(ring_bytes)); }
    std::byte* content() const { return reinterpret_cast<std::byte*>(state) + 4096; }
    void ring() const {
        const std::uint64_t once = 1;
        REQUIRE(::write(theirs.get(), &once, sizeof once) == sizeof once);
    }

    shm_fd memory, own, theirs;
    ring_state* state = nullptr; // [0]: to the boat, [1]: from it
};

int wait_for(real_parties& all, pid_t child) {
    int status = -1;
    // It is looked for again and again: its end is no event here.
    auto host = all.make_loop();
    ise::timer again(host->loop(), [] {});
    all.run_until([&] {
        again.arm(host->loop().now() + 5ms);
        return ::waitpid(child, &status, WNOHANG) == child;
    });
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

} // namespace

TEST_CASE("a call passes through shared memory, which is gone with its session", "[shm]") {
    harbour at;
    const auto before = open_descriptors();
    REQUIRE(mappings() == 0);
    REQUIRE(at.call().value().content.size() == 100);
    REQUIRE(mappings() == 2); // both sides are here
    REQUIRE(at.call(5'000'000).value().content.size() == 5'000'000);
    at.shore->services->stop(100ms);
    at.all.run_until([&] { return mappings() == 0; });
    at.all.run_until([&] { return open_descriptors() <= before + 1; }); // the loop of the shore
}

TEST_CASE("a component that shared memory does not reach is called over the socket", "[shm]") {
    harbour at;
    stranger other(at.name);
    SECTION("which offers none") { other.send(offer(0)); }
    SECTION("whose descriptors got lost") { other.send(offer(ring_bytes)); }
    REQUIRE(other.receive(at.all) == over_socket);
    REQUIRE(mappings() == 0);
}

TEST_CASE("offers that break the rules are refused, and nobody else notices", "[shm]") {
    harbour at;
    const auto before = open_descriptors();
    const auto right = mapping::size_for(ring_bytes);
    {
        stranger other(at.name);
        auto one = bell(), two = bell();
        SECTION("no mark") { other.send("GET / HTTP/1.1\r\n"); }
        SECTION("another version") { other.send(offer(0, 2)); }
        SECTION("memory that can be shrunk") {
            auto memory = memory_of(right, F_SEAL_GROW);
            other.send(offer(ring_bytes), {memory.get(), one.get(), two.get()});
        }
        SECTION("memory that can still be sealed") {
            auto memory = memory_of(right, F_SEAL_GROW | F_SEAL_SHRINK);
            other.send(offer(ring_bytes), {memory.get(), one.get(), two.get()});
        }
        SECTION("memory of another size") {
            auto memory = memory_of(GENERATE_COPY(std::size_t{0}, right - 1, right + 4096));
            other.send(offer(ring_bytes), {memory.get(), one.get(), two.get()});
        }
        SECTION("rings of a size that is none") {
            auto bytes = GENERATE(1u, 4096u, 65'537u, 98'304u, 0x8000'0000u, 0xffff'ffffu);
            auto memory = memory_of(mapping::size_for(bytes));
            other.send(offer(bytes), {memory.get(), one.get(), two.get()});
        }
        SECTION("a file") {
            shm_fd file(::open("/proc/self/exe", O_RDONLY | O_CLOEXEC));
            other.send(offer(ring_bytes), {file.get(), one.get(), two.get()});
        }
        SECTION("a socket in place of a bell") {
            auto memory = memory_of(right);
            other.send(offer(ring_bytes), {memory.get(), one.get(), other.line.get()});
        }
        SECTION("too many descriptors") {
            auto memory = memory_of(right);
            other.send(offer(ring_bytes), {memory.get(), one.get(), two.get(), two.get()});
        }
        REQUIRE(other.receive(at.all, 4096).empty());
        REQUIRE(at.rejected() == 1);
        REQUIRE(mappings() == 0);
    }
    at.all.run_until([&] { return open_descriptors() <= before; });
    REQUIRE(at.call().value().content.size() == 100);
}

TEST_CASE("a peer that ends at any byte of the agreement leaves nothing behind", "[shm]") {
    harbour at;
    const auto before = open_descriptors();
    const auto whole = offer(ring_bytes);
    for (std::size_t bytes = 1; bytes <= whole.size(); ++bytes) {
        {
            stranger other(at.name);
            auto memory = memory_of(mapping::size_for(ring_bytes));
            auto one = bell(), two = bell();
            other.send(whole.substr(0, bytes), {memory.get(), one.get(), two.get()});
        }
        at.all.run_until([&] { return at.rejected() == bytes; });
        at.all.run_until([&] { return open_descriptors() <= before; });
        REQUIRE(mappings() == 0);
    }
    REQUIRE(at.call().value().content.size() == 100);
}

TEST_CASE("a peer that breaks the rings ends its own session only", "[shm]") {
    harbour at;
    REQUIRE(at.call().value().content.size() == 100);
    {
        agreed_stranger other(at.all, at.name);
        SECTION("a position beyond what fits") {
            other.state[0].head = GENERATE(ring_bytes + 1, 0x8000'0000u, 0xffff'ffffu);
            other.ring();
        }
        SECTION("bytes that are no greeting") {
            std::memset(other.content(), 0xff, 100);
            other.state[0].head = 100;
            other.ring();
        }
        SECTION("a byte over the socket") { other.send("x"); }
        SECTION("bytes that change while they are read, and positions that go back and forth") {
            std::atomic<bool> enough{false};
            std::thread changing([&] {
                for (std::uint32_t round = 0; !enough; ++round) {
                    std::memset(other.content(), static_cast<int>(round), 1000);
                    other.state[0].head = round % 3000;
                    other.state[1].tail = round;
                    other.state[0].writer_sleeps = other.state[1].reader_sleeps = round % 2;
                    other.ring();
                }
            });
            at.all.run_until([&] { return at.rejected() == 1; });
            enough = true;
            changing.join();
        }
        SECTION("memory that it punches holes into") {
            ::fallocate(other.memory.get(), FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 0,
                        static_cast<off_t>(mapping::size_for(ring_bytes)));
            REQUIRE(::ftruncate(other.memory.get(), 0) != 0);
            other.state[0].ended = 1;
            other.ring();
        }
        at.all.run_until([&] { return at.rejected() == 1; });
    }
    at.all.run_until([&] { return mappings() == 0; });
    REQUIRE(at.call().value().content.size() == 100);
}

TEST_CASE("a killed peer is noticed at once and leaves nothing behind", "[shm]") {
    const auto name = fresh_name();
    std::array<int, 2> said{};
    REQUIRE(::pipe(said.data()) == 0);
    shm_fd result(said[0]), tell(said[1]);
    // First, so that it has no thread or loop of this process.
    const auto child = fork_child([&] {
        char go = 0;
        if (::read(result.get(), &go, 1) != 1) return 1;
        real_parties all;
        auto& shore = all.add("shore");
        for (;;)
            if (!all.run(shore, try_echo(shore.at("shm://" + name), 100'000))) return 2;
    });
    real_parties all;
    auto& boat = all.add("boat");
    std::size_t served = 0;
    boat.provide(echo, [&](blob given) {
        ++served;
        return given;
    });
    boat.listen("shm://" + name);
    const auto before = open_descriptors();
    REQUIRE(::write(tell.get(), "x", 1) == 1);
    all.run_until([&] { return served >= 20; });
    REQUIRE(mappings() == 1);
    REQUIRE(::kill(child, SIGKILL) == 0);
    all.run_until([&] { return mappings() == 0; });
    REQUIRE(open_descriptors() == before);
    REQUIRE(wait_for(all, child) == -SIGKILL);
}

TEST_CASE("whatever the system refuses while two agree, they go on over the socket", "[shm]") {
    struct refusal {
        const char* what;
        long call;
        int argument;
        std::uint32_t value;
        bool by_caller, by_called; // who needs it
    };
    const auto refused = GENERATE(values<refusal>({
        {"nothing", -1, -1, 0, false, false},
        {"memfd_create", SYS_memfd_create, -1, 0, true, false},
        {"ftruncate", call_of_ftruncate, -1, 0, true, false},
        {"sealing", call_of_fcntl, 1, F_ADD_SEALS, true, false},
        {"duplicates", call_of_fcntl, 1, F_DUPFD_CLOEXEC, true, true},
        {"eventfd", SYS_eventfd2, -1, 0, true, false},
        {"shared mappings", call_of_mmap, 3, MAP_SHARED, true, true},
        {"fstatfs", call_of_fstatfs, -1, 0, true, true},
        {"readlink", call_of_readlink, -1, 0, false, true},
        {"the peer's user", SYS_getsockopt, 2, SO_PEERCRED, true, true},
    }));
    const bool called = GENERATE(true, false); // the side that is refused it
    CAPTURE(refused.what, called);
    const auto name = fresh_name();
    std::array<int, 2> said{};
    REQUIRE(::pipe(said.data()) == 0);
    shm_fd result(said[0]), tell(said[1]);
    auto serve = [&](bool denied) {
        real_parties all;
        auto& boat = all.add("boat");
        std::size_t served = 0;
        boat.provide(echo, [&](blob given) {
            ++served;
            return given;
        });
        boat.listen("shm://" + name);
        if (denied) deny(refused.call, refused.argument, refused.value);
        if (::write(tell.get(), "x", 1) != 1) return 1;
        all.run_until([&] { return served > 0; });
        auto host = all.make_loop();
        bool late = false;
        ise::timer end(host->loop(), [&] { late = true; });
        end.arm(host->loop().now() + 10s);
        all.run_until([&] { return late || boat.services->sessions().empty(); });
        return late ? 2 : 0;
    };
    auto call = [&](bool denied) {
        char go = 0;
        if (::read(result.get(), &go, 1) != 1) return 3;
        real_parties all;
        auto& shore = all.add("shore");
        if (denied) deny(refused.call, refused.argument, refused.value);
        auto got = all.run(shore, try_echo(shore.at("shm://" + name), 100'000));
        if (!got) return 4;
        return mappings() == (called ? !refused.by_called : !refused.by_caller) ? 0 : 5;
    };
    // Children both, one of which has the filter.
    const auto server = fork_child([&] { return serve(called); });
    const auto client = fork_child([&] { return call(!called); });
    int first = -1, second = -1;
    const auto ended = ::waitpid(-1, &first, 0);
    REQUIRE((ended == server || ended == client));
    const auto other = ended == server ? client : server;
    const bool unfiltered = WIFEXITED(first) && WEXITSTATUS(first) == 77;
    if (unfiltered) REQUIRE(::kill(other, SIGKILL) == 0); // it waits for that one
    REQUIRE(::waitpid(other, &second, 0) == other);
    if (unfiltered) return ise_test::skip("this system has no seccomp filters");
    for (int status : {first, second}) {
        REQUIRE(WIFEXITED(status));
        REQUIRE(WEXITSTATUS(status) == 0);
    }
}

TEST_CASE("descriptors that come with each byte of an offer are not collected, and of another user none", "[shm]") {
    const bool kindred = GENERATE(true, false);
    // How many of them are held in the middle of the agreement; in a child, from which the peer's user can be hidden.
    const auto child = fork_child([&] {
        harbour at;
        if (!kindred) deny(SYS_getsockopt, 2, SO_PEERCRED);
        const auto before = open_descriptors();
        stranger other(at.name);
        const auto any = bell();
        const auto whole = offer(ring_bytes);
        for (std::size_t place = 0; place + 1 < whole.size(); ++place)
            other.send(whole.substr(place, 1), std::vector<int>(8, any.get()));
        int unread = 1;
        at.all.run_until([&] { return ::ioctl(other.line.get(), SIOCOUTQ, &unread) == 0 && unread == 0; });
        return static_cast<int>(open_descriptors() - before - 3); // without both ends and `any`
    });
    int status = -1;
    REQUIRE(::waitpid(child, &status, 0) == child);
    REQUIRE(WIFEXITED(status));
    if (!kindred && WEXITSTATUS(status) == 77) return ise_test::skip("this system has no seccomp filters");
    CHECK(WEXITSTATUS(status) == (kindred ? 8 : 0));
}

TEST_CASE("a name that is too long for its socket is refused", "[shm]") {
    real_parties all;
    auto& boat = all.add("boat");
    auto at = ise::endpoint::parse("shm://@" + std::string(103, 'x')).value();
    auto made = boat.services->listen(at);
    REQUIRE_FALSE(made);
    REQUIRE(made.error().code() == ise::errc::invalid_argument);
}

} // namespace shm_connections_test
