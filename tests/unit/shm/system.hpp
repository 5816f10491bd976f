#pragma once
#include <ise/transport/shm/memory.hpp>

#include <support/catch.hpp>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include <fcntl.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

/// What the tests of shared memory see of the system, and children to which it refuses something.
namespace shm_test {

using shm_fd = ise::real::owned_fd;

constexpr std::uint32_t ring_bytes = ise::net::shm::min_ring_bytes;

// Mappings of ISE's shared memory into this process: of the rings and blocks of all connections, or of one kind.
inline int mappings(std::string_view kind = "memfd:ise-") {
    std::ifstream maps("/proc/self/maps");
    int count = 0;
    for (std::string line; std::getline(maps, line);) count += line.find(kind) != line.npos;
    return count;
}
inline long open_descriptors() {
    return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), std::filesystem::directory_iterator());
}

// Memory as a peer makes it.
inline shm_fd memory_of(std::size_t bytes, int seals = ise::net::shm::demanded_seals) {
    shm_fd made(::memfd_create("ise-stranger", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    REQUIRE(::ftruncate(made.get(), static_cast<off_t>(bytes)) == 0);
    if (seals != 0) REQUIRE(::fcntl(made.get(), F_ADD_SEALS, seals) == 0);
    return made;
}

// In a child, whose exit code is returned; the parties of this process go on meanwhile.
template <class Work>
pid_t fork_child(Work work) {
    const auto child = ::fork();
    if (child == 0) {
        ::alarm(120); // a defect does not hang the test
        try {
            ::_exit(work());
        } catch (...) {
            ::_exit(99);
        }
    }
    REQUIRE(child > 1);
    return child;
}

// The system calls behind the C library's functions: newer processors have one where older ones have two, and those of
// 32 bits a second one for files of 64 bits.
#ifdef SYS_readlink
constexpr long call_of_readlink = SYS_readlink;
#else
constexpr long call_of_readlink = SYS_readlinkat;
#endif
#ifdef SYS_mmap2
constexpr long call_of_mmap = SYS_mmap2, call_of_ftruncate = SYS_ftruncate64, call_of_fcntl = SYS_fcntl64,
               call_of_fstatfs = SYS_fstatfs64;
#else
constexpr long call_of_mmap = SYS_mmap, call_of_ftruncate = SYS_ftruncate, call_of_fcntl = SYS_fcntl,
               call_of_fstatfs = SYS_fstatfs;
#endif

// From now on this process is refused a system call, where the lower half of one of its arguments is as given.
inline void deny(long call, int argument = -1, std::uint32_t value = 0) {
    std::vector<sock_filter> rules{BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr))};
    const bool one = argument >= 0;
    rules.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(call), 0,
                             static_cast<std::uint8_t>(one ? 3 : 1)));
    if (one) {
        rules.push_back(BPF_STMT(
            BPF_LD | BPF_W | BPF_ABS,
            static_cast<std::uint32_t>(offsetof(seccomp_data, args) + static_cast<std::size_t>(argument) * 8)));
        rules.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, 1));
    }
    rules.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EPERM));
    rules.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW));
    const sock_fprog program{static_cast<unsigned short>(rules.size()), rules.data()};
    if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 || ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) != 0)
        ::_exit(77);
}

} // namespace shm_test
