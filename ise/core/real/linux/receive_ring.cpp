#include <ise/core/real/linux/receive_ring.hpp>

#include <asio/error.hpp>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <limits>

#include <linux/io_uring.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace ise::real {

namespace {

constexpr unsigned requests = 64;
// A socket whose bytes fill one goes back to epoll.
constexpr std::size_t buffer_bytes = 16 * 1024;
constexpr std::uint16_t buffers = 8;

// After so many waits in a row that brought nothing but events of epoll, all sockets go back to it.
constexpr unsigned max_idle_waits = 64;

// Requests that are not a socket's, by their `user_data`.
constexpr std::uint64_t epoll_tag = std::numeric_limits<std::uint64_t>::max();
constexpr std::uint64_t cancel_tag = epoll_tag - 1;

// A datagram comes behind its `io_uring_recvmsg_out` and this much room for the address of its sender.
constexpr std::size_t address_bytes = sizeof(sockaddr_in6);
constexpr std::size_t before_datagram = sizeof(io_uring_recvmsg_out) + address_bytes;

std::uint32_t load(std::uint32_t* at) noexcept { return std::atomic_ref(*at).load(std::memory_order_acquire); }
void store(std::uint32_t* at, std::uint32_t value) noexcept {
    std::atomic_ref(*at).store(value, std::memory_order_release);
}

// Valgrind lets no other thread run while one waits in `io_uring_enter`. It preloads a library of its own.
bool is_under_valgrind() noexcept {
    const char* preloaded = std::getenv("LD_PRELOAD");
    return preloaded && std::strstr(preloaded, "/vgpreload_");
}

std::error_code problem_of(int result) noexcept {
    if (result == 0) return asio::error::eof;
    return {-result, asio::error::get_system_category()};
}

} // namespace

receive_ring::memory::memory(std::size_t size, int ring, long at) : size_(size) {
    const int kind = ring >= 0 ? MAP_SHARED | MAP_POPULATE : MAP_PRIVATE | MAP_ANONYMOUS;
    at_ = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, kind, ring, at);
    if (at_ == MAP_FAILED) at_ = nullptr;
}

receive_ring::memory& receive_ring::memory::operator=(memory&& other) noexcept {
    std::swap(at_, other.at_);
    std::swap(size_, other.size_);
    return *this;
}

receive_ring::memory::~memory() {
    if (at_) ::munmap(at_, size_);
}

std::unique_ptr<receive_ring> receive_ring::make(int epoll) {
    if (is_under_valgrind()) return nullptr;
    std::unique_ptr<receive_ring> made(new receive_ring);
    if (!made->set_up(epoll)) made.reset();
    return made;
}

bool receive_ring::set_up(int epoll) {
    io_uring_params how{};
    how.flags = IORING_SETUP_SINGLE_ISSUER | IORING_SETUP_DEFER_TASKRUN | IORING_SETUP_TASKRUN_FLAG;
    ring_.reset(static_cast<int>(::syscall(SYS_io_uring_setup, requests, &how)));
    if (!ring_ || !(how.features & IORING_FEAT_SINGLE_MMAP)) return false;
    rings_ = memory(std::max(how.sq_off.array + how.sq_entries * sizeof(std::uint32_t),
                             how.cq_off.cqes + how.cq_entries * sizeof(io_uring_cqe)),
                    ring_.get(), IORING_OFF_SQ_RING);
    requests_ = memory(how.sq_entries * sizeof(io_uring_sqe), ring_.get(), IORING_OFF_SQES);
    buffers_ = memory(buffers * buffer_bytes);
    buffer_list_ = memory(buffers * sizeof(io_uring_buf));
    if (!rings_ || !requests_ || !buffers_ || !buffer_list_) return false;
    submit_head_ = rings_.at<std::uint32_t>(how.sq_off.head);
    submit_tail_ = rings_.at<std::uint32_t>(how.sq_off.tail);
    submit_flags_ = rings_.at<std::uint32_t>(how.sq_off.flags);
    submit_list_ = rings_.at<std::uint32_t>(how.sq_off.array);
    submit_mask_ = how.sq_entries - 1;
    complete_head_ = rings_.at<std::uint32_t>(how.cq_off.head);
    complete_tail_ = rings_.at<std::uint32_t>(how.cq_off.tail);
    completions_ = rings_.at<io_uring_cqe>(how.cq_off.cqes);
    complete_mask_ = how.cq_entries - 1;

    io_uring_buf_reg list{};
    list.ring_addr = reinterpret_cast<std::uintptr_t>(buffer_list_.at<void>());
    list.ring_entries = buffers;
    if (::syscall(SYS_io_uring_register, ring_.get(), IORING_REGISTER_PBUF_RING, &list, 1) != 0) return false;
    for (std::uint16_t buffer = 0; buffer < buffers; ++buffer) give_back(buffer);
    came_.reserve(2 * std::size_t{how.cq_entries});
    epoll_ = epoll;
    return true;
}

receive_ring::~receive_ring() {
    if (epoll_ < 0) return;
    // The kernel holds each socket until its request is cancelled; closing the ring does that some time later only.
    auto& all = next_request();
    all.opcode = IORING_OP_ASYNC_CANCEL;
    all.cancel_flags = IORING_ASYNC_CANCEL_ANY | IORING_ASYNC_CANCEL_ALL;
    all.user_data = cancel_tag;
    enter(0);
}

// The next `enter` submits it.
io_uring_sqe& receive_ring::next_request() noexcept {
    if (unsubmitted() > submit_mask_) enter(0);
    const auto tail = *submit_tail_;
    auto& request = requests_.at<io_uring_sqe>()[tail & submit_mask_];
    std::memset(&request, 0, sizeof request);
    submit_list_[tail & submit_mask_] = tail & submit_mask_;
    store(submit_tail_, tail + 1);
    return request;
}

unsigned receive_ring::unsubmitted() const noexcept { return *submit_tail_ - load(submit_head_); }

bool receive_ring::system_has_work() const noexcept {
    return load(submit_flags_) & (IORING_SQ_TASKRUN | IORING_SQ_CQ_OVERFLOW);
}

[[gnu::hot]] int receive_ring::enter(unsigned completions) noexcept {
    return static_cast<int>(
        ::syscall(SYS_io_uring_enter, ring_.get(), unsubmitted(), completions, IORING_ENTER_GETEVENTS, nullptr, 0));
}

void receive_ring::watch_epoll() noexcept {
    auto& request = next_request();
    request.opcode = IORING_OP_POLL_ADD;
    request.fd = epoll_;
    request.len = IORING_POLL_ADD_MULTI;
    request.poll32_events = POLLIN;
    request.user_data = epoll_tag;
}

std::uint64_t receive_ring::tag_of(std::uint32_t at) const noexcept {
    return std::uint64_t{slots_[at].generation} << 32 | at;
}

void receive_ring::receive(std::uint32_t at) noexcept {
    static msghdr of_datagrams = [] {
        msghdr made{};
        made.msg_namelen = address_bytes;
        return made;
    }();
    const auto& who = *slots_[at].of;
    auto& request = next_request();
    request.opcode = who.takes_datagrams() ? IORING_OP_RECVMSG : IORING_OP_RECV;
    if (who.takes_datagrams()) request.addr = reinterpret_cast<std::uintptr_t>(&of_datagrams);
    request.fd = who.fd();
    request.ioprio = IORING_RECV_MULTISHOT;
    request.flags = IOSQE_BUFFER_SELECT;
    request.user_data = tag_of(at);
}

void receive_ring::cancel(std::uint64_t tag) noexcept {
    auto& request = next_request();
    request.opcode = IORING_OP_ASYNC_CANCEL;
    request.addr = tag;
    request.user_data = cancel_tag;
}

[[gnu::hot]] void receive_ring::give_back(std::uint16_t buffer) noexcept {
    // The tail of the list lies in what its first entry does not use.
    auto* list = buffer_list_.at<io_uring_buf>();
    auto& entry = list[buffer_tail_++ % buffers];
    entry.addr = reinterpret_cast<std::uintptr_t>(buffers_.at<std::byte>(buffer * buffer_bytes));
    entry.len = buffer_bytes;
    entry.bid = buffer;
    std::atomic_ref(list->resv).store(buffer_tail_, std::memory_order_release);
}

void receive_ring::begin(descriptor& who) {
    if (free_.empty()) {
        slots_.emplace_back();
        free_.reserve(slots_.size());
        free_.push_back(static_cast<std::uint32_t>(slots_.size() - 1));
    }
    const auto at = free_.back();
    free_.pop_back();
    slots_[at].of = &who;
    slots_[at].leaves = false;
    who.receive_slot_ = at;
    if (receiving_++ == 0) watch_epoll();
    receive(at);
}

void receive_ring::leave(std::uint32_t at) noexcept {
    if (!std::exchange(slots_[at].leaves, true)) cancel(tag_of(at));
}

void receive_ring::forget(descriptor& who) noexcept {
    const auto at = std::exchange(who.receive_slot_, descriptor::no_slot);
    if (at == descriptor::no_slot) return;
    slots_[at].of = nullptr;
    withdraw(tag_of(at));
    cancel(tag_of(at));
    enter(0);
}

// A request that the system has not taken yet, for want of memory, names a descriptor that may be another's by then.
void receive_ring::withdraw(std::uint64_t tag) noexcept {
    for (auto at = load(submit_head_); at != *submit_tail_; ++at) {
        auto& request = requests_.at<io_uring_sqe>()[at & submit_mask_];
        if (request.user_data != tag) continue;
        std::memset(&request, 0, sizeof request);
        request.opcode = IORING_OP_NOP;
        request.user_data = tag; // its completion frees the slot
    }
}

[[gnu::hot]] bool receive_ring::wait(bool sleeps) noexcept {
    take_completions();
    if (epoll_ready_ || !came_.empty()) sleeps = false;
    if (sleeps || unsubmitted() > 0 || system_has_work()) {
        enter(sleeps ? 1 : 0);
        take_completions();
    }
    if (!came_.empty()) idle_waits_ = 0;
    else if (epoll_ready_ && ++idle_waits_ == max_idle_waits) leave_all();
    return std::exchange(epoll_ready_, false);
}

void receive_ring::leave_all() noexcept {
    idle_waits_ = 0;
    for (std::uint32_t at = 0; at < slots_.size(); ++at)
        if (slots_[at].of) leave(at);
}

[[gnu::hot]] void receive_ring::take_completions() noexcept {
    auto head = *complete_head_;
    const auto tail = load(complete_tail_);
    bool epoll_watched = true;
    for (; head != tail; ++head) {
        const auto& one = completions_[head & complete_mask_];
        if (one.user_data == epoll_tag) {
            epoll_ready_ = epoll_ready_ || one.res > 0;
            if (one.res != -ECANCELED && !(one.flags & IORING_CQE_F_MORE)) epoll_watched = false;
        } else if (one.user_data != cancel_tag) {
            came_.push_back({one.user_data, one.res, one.flags});
        }
    }
    store(complete_head_, head);
    if (!epoll_watched) watch_epoll();
}

[[gnu::hot]] void receive_ring::deliver(loop& on) {
    // A delivery may close other sockets, and begin to receive for more.
    for (std::size_t next = 0; next < came_.size(); ++next) deliver_one(came_[next], on);
    came_.clear();
}

[[gnu::hot]] descriptor::received receive_ring::message_in(const completion& came,
                                                           const descriptor& to) const noexcept {
    const auto buffer = static_cast<std::uint16_t>(came.flags >> IORING_CQE_BUFFER_SHIFT);
    const bytes_view all(buffers_.at<std::byte>(buffer * buffer_bytes), static_cast<std::size_t>(came.result));
    if (!to.takes_datagrams()) return {all, {}};
    io_uring_recvmsg_out head{};
    std::memcpy(&head, all.data(), sizeof head);
    return {all.subspan(before_datagram), all.subspan(sizeof head, std::min(std::size_t{head.namelen}, address_bytes))};
}

[[gnu::hot]] void receive_ring::deliver_one(const completion& came, loop& on) {
    const auto at = static_cast<std::uint32_t>(came.tag);
    auto* who = slots_[at].of;
    const bool has_bytes = came.result > 0;
    const bool too_fast = came.result == static_cast<std::int32_t>(buffer_bytes) || came.result == -ENOBUFS;
    const bool failed = !has_bytes && came.result != -ENOBUFS && came.result != -ECANCELED;
    bool last = !(came.flags & IORING_CQE_F_MORE);
    if (too_fast && last) slots_[at].leaves = true;
    else if (too_fast) leave(at);
    if (last && who && has_bytes && !slots_[at].leaves) { // the system stops for reasons of its own
        receive(at);
        last = false;
    }
    if (last) {
        ++slots_[at].generation;
        slots_[at].of = nullptr;
        if (who) who->receive_slot_ = descriptor::no_slot;
        free_.push_back(at);
        if (--receiving_ == 0) { // the loop waits by epoll alone
            cancel(epoll_tag);
            enter(0);
        }
    }
    if (who && (has_bytes || last)) {
        loop::turn in(on);
        if (has_bytes) who->on_received(message_in(came, *who));
        if (failed) who->on_receive_failure(problem_of(came.result));
        else if (last) who->on_received_all();
    }
    if (came.flags & IORING_CQE_F_BUFFER) give_back(static_cast<std::uint16_t>(came.flags >> IORING_CQE_BUFFER_SHIFT));
}

} // namespace ise::real
