#include <ise/transport/shm/memory.hpp>

#include <ise/core/real/linux/local_peer.hpp>

#include <fmt/format.h>

#include <bit>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <utility>

#include <fcntl.h>
#include <linux/magic.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/statfs.h>
#include <unistd.h>

namespace ise::net::shm {
namespace {

constexpr std::size_t state_bytes = 4096;
static_assert(2 * sizeof(ring_state) <= state_bytes);

failure system_refused(std::string_view what) {
    return io_failure(fmt::format("no shared memory: {} failed", what), real::last_system_error());
}

// Writing to anything else could block, or end the process by a signal.
std::optional<bool> is_bell(const owned_fd& what) {
    std::array<char, 64> name{};
    auto link = fmt::format("/proc/self/fd/{}", what.get());
    const auto size = ::readlink(link.c_str(), name.data(), name.size());
    if (size < 0) return std::nullopt;
    return std::string_view(name.data(), static_cast<std::size_t>(size)) == "anon_inode:[eventfd]";
}

failure too_late() { return {errc::io_failed, "no shared memory: too few file descriptors are left (ulimit -n)"}; }

bool same_namespace(pid_t other, const char* kind) {
    struct stat here {
    }, there{};
    if (::stat(fmt::format("/proc/{}/ns/{}", other, kind).c_str(), &there) != 0) return false;
    return ::stat(fmt::format("/proc/self/ns/{}", kind).c_str(), &here) == 0 && here.st_ino == there.st_ino &&
           here.st_dev == there.st_dev;
}

// Memory that shrinks would end this process when it is read; on a disk, or in huge pages, it may do so as it is.
result<std::byte*> map(const owned_fd& memory, std::size_t bytes, int access) {
    struct stat about {};
    struct statfs where {};
    const int seals = ::fcntl(memory.get(), F_GET_SEALS);
    if (seals < 0 || (seals & demanded_seals) != demanded_seals)
        return failure(errc::protocol_error, "it offered memory that it could shrink");
    if (::fstatfs(memory.get(), &where) != 0 || ::fstat(memory.get(), &about) != 0) return system_refused("fstat");
    if (where.f_type != TMPFS_MAGIC) return failure(errc::protocol_error, "it offered memory of another kind");
    if (about.st_size != static_cast<off_t>(bytes))
        return failure(errc::protocol_error,
                       fmt::format("it offered {} bytes of memory in place of {}", about.st_size, bytes));
    auto* at = ::mmap(nullptr, bytes, access, MAP_SHARED, memory.get(), 0); // NOLINT
    if (at == MAP_FAILED) return system_refused("mmap");
    return static_cast<std::byte*>(at);
}

} // namespace

std::uint64_t machine_bytes() noexcept {
    const auto pages = ::sysconf(_SC_PHYS_PAGES), page = ::sysconf(_SC_PAGESIZE);
    return pages <= 0 || page <= 0 ? 0 : static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(page);
}

// Numbers are given from the lowest: a quarter of what this process may open is in use. The rest is for sessions that
// need one, as over a socket.
bool is_late(const owned_fd& newest) {
    rlimit now{};
    if (::getrlimit(RLIMIT_NOFILE, &now) != 0 || now.rlim_cur == RLIM_INFINITY) return false;
    return static_cast<rlim_t>(newest.get()) >= now.rlim_cur / 4;
}

std::uint32_t ring_bytes_here() noexcept {
    const auto share = machine_bytes() / 65'536;
    return std::bit_floor(static_cast<std::uint32_t>(std::clamp<std::uint64_t>(share, min_ring_bytes, max_ring_bytes)));
}

bool is_ring_size(std::uint32_t bytes) noexcept {
    return std::has_single_bit(bytes) && bytes >= min_ring_bytes && bytes <= max_ring_bytes;
}

std::size_t mapping::size_for(std::uint32_t ring_bytes) noexcept {
    return state_bytes + 2 * static_cast<std::size_t>(ring_bytes);
}

mapping::mapping(mapping&& other) noexcept
    : begin_(std::exchange(other.begin_, nullptr)), ring_bytes_(other.ring_bytes_) {}

mapping& mapping::operator=(mapping&& other) noexcept {
    std::swap(begin_, other.begin_);
    std::swap(ring_bytes_, other.ring_bytes_);
    return *this;
}

mapping::~mapping() {
    if (begin_) ::munmap(begin_, size_for(ring_bytes_));
}

result<mapping> mapping::of(const owned_fd& memory, std::uint32_t ring_bytes) {
    if (!is_ring_size(ring_bytes))
        return failure(errc::protocol_error, fmt::format("it offered rings of {} bytes", ring_bytes));
    auto at = map(memory, size_for(ring_bytes), PROT_READ | PROT_WRITE);
    if (!at) return at.error();
    mapping made;
    made.begin_ = *at;
    made.ring_bytes_ = ring_bytes;
    return made;
}

result<const std::byte*> map_to_read(const owned_fd& memory, std::size_t bytes) {
    auto at = map(memory, bytes, PROT_READ);
    if (!at) return at.error();
    return *at;
}

ring_state& mapping::state(int ring) const noexcept {
    return reinterpret_cast<ring_state*>(begin_)[ring]; // zero at first, as they are made
}
std::byte* mapping::content(int ring) const noexcept {
    return begin_ + state_bytes + static_cast<std::size_t>(ring) * ring_bytes_;
}
ring_writer mapping::writer(int ring) const noexcept { return {state(ring), content(ring), ring_bytes_}; }
ring_reader mapping::reader(int ring) const noexcept { return {state(ring), content(ring), ring_bytes_}; }

result<owned_fd> make_memory(const char* name, std::size_t bytes) {
    rlimit files{};
    if (::getrlimit(RLIMIT_FSIZE, &files) == 0 && bytes > files.rlim_cur) // beyond it a signal ends the process
        return failure(errc::io_failed,
                       fmt::format("no shared memory: files may have {} bytes at most (ulimit -f)", files.rlim_cur));
    owned_fd made(::memfd_create(name, MFD_CLOEXEC | MFD_ALLOW_SEALING));
    if (!made) return system_refused("memfd_create");
    if (::ftruncate(made.get(), static_cast<off_t>(bytes)) != 0) return system_refused("ftruncate");
    return made;
}

result<descriptors> make_descriptors(std::uint32_t ring_bytes) {
    auto memory = make_memory("ise-shm", mapping::size_for(ring_bytes));
    if (!memory) return memory.error();
    descriptors made;
    made.memory = std::move(*memory);
    if (::fcntl(made.memory.get(), F_ADD_SEALS, demanded_seals) != 0) return system_refused("sealing");
    for (auto* bell : {&made.connecting_bell, &made.accepting_bell}) {
        bell->reset(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
        if (!*bell) return system_refused("eventfd");
    }
    if (is_late(made.accepting_bell)) return too_late();
    return made;
}

result<descriptors> take_descriptors(std::span<owned_fd> passed) {
    if (passed.size() > descriptor_count) return failure(errc::protocol_error, "it passed too many descriptors");
    if (passed.size() < descriptor_count)
        return failure(errc::io_failed, "no shared memory: not all of its descriptors arrived");
    for (const auto& bell : passed.subspan(1)) {
        const auto right = is_bell(bell);
        if (!right) return system_refused("reading /proc/self/fd");
        if (!*right) return failure(errc::protocol_error, "it passed something else in place of a doorbell");
    }
    if (is_late(passed.back())) return too_late();
    descriptors made;
    made.memory = std::move(passed[0]);
    made.connecting_bell = std::move(passed[1]);
    made.accepting_bell = std::move(passed[2]);
    return made;
}

bool is_kindred(int socket) {
    auto peer = real::credentials_of_peer(socket);
    if (!peer || peer->pid <= 0 || peer->uid != ::geteuid()) return false;
    return peer->pid == ::getpid() || (same_namespace(peer->pid, "pid") && same_namespace(peer->pid, "user"));
}

bool send_with(int socket, std::span<const std::byte> bytes, std::span<const int> passed) noexcept {
    alignas(cmsghdr) std::array<char, CMSG_SPACE(descriptor_count * sizeof(int))> room{};
    iovec content{const_cast<std::byte*>(bytes.data()), bytes.size()};
    msghdr message{};
    message.msg_iov = &content;
    message.msg_iovlen = 1;
    if (!passed.empty()) {
        message.msg_control = room.data();
        message.msg_controllen = CMSG_SPACE(passed.size_bytes());
        auto* head = CMSG_FIRSTHDR(&message);
        head->cmsg_level = SOL_SOCKET;
        head->cmsg_type = SCM_RIGHTS;
        head->cmsg_len = CMSG_LEN(passed.size_bytes());
        std::memcpy(CMSG_DATA(head), passed.data(), passed.size_bytes());
    }
    for (;;) {
        const auto sent = ::sendmsg(socket, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
        if (sent < 0 && errno == EINTR) continue;
        return sent == static_cast<ssize_t>(bytes.size());
    }
}

bool send_with(int socket, std::span<const std::byte> bytes, const descriptors& passed) noexcept {
    const std::array<int, descriptor_count> numbers{passed.memory.get(), passed.connecting_bell.get(),
                                                    passed.accepting_bell.get()};
    return send_with(socket, bytes, numbers);
}

owned_fd duplicate(int of) noexcept { return owned_fd(::fcntl(of, F_DUPFD_CLOEXEC, 0)); }

} // namespace ise::net::shm
