#include <ise/core/real/linux/receive_ring.hpp>

#include <asio/error.hpp>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <limits>

#include <linux/io_uring.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace ise::real {

namespace {

constexpr unsigned requests = 64;
// A receipt that fills one is no short message.
constexpr std::size_t buffer_bytes = 16 * 1024;
constexpr std::uint16_t buffers = 8;

// So many times in a row the epoll instance alone had something: then the sockets go back to it.
constexpr unsigned waits_in_vain = 64;

// Names of requests that are not a socket's.
constexpr std::uint64_t epoll_name = std::numeric_limits<std::uint64_t>::max();
constexpr std::uint64_t cancel_name = epoll_name - 1;

std::uint32_t load(const std::uint32_t* at) noexcept {
    return std::atomic_ref(*const_cast<std::uint32_t*>(at)).load(std::memory_order_acquire);
}
void store(std::uint32_t* at, std::uint32_t value) noexcept {
    std::atomic_ref(*at).store(value, std::memory_order_release);
}

std::error_code problem_of(int result) noexcept {
    if (result == 0) return asio::error::eof;
    return {-result, asio::error::get_system_category()};
}

} // namespace

receive_ring::memory::memory(std::size_t size) : size_(size) {
    at_ = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (at_ == MAP_FAILED) at_ = nullptr;
}

receive_ring::memory::memory(int ring, std::size_t size, long at) : size_(size) {
    at_ = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, ring, at);
    if (at_ == MAP_FAILED) at_ = nullptr;
}

receive_ring::memory::memory(memory&& other) noexcept : at_(std::exchange(other.at_, nullptr)), size_(other.size_) {}

receive_ring::memory& receive_ring::memory::operator=(memory&& other) noexcept {
    std::swap(at_, other.at_);
    std::swap(size_, other.size_);
    return *this;
}

receive_ring::memory::~memory() {
    if (at_) ::munmap(at_, size_);
}

std::unique_ptr<receive_ring> receive_ring::make(int epoll) {
    std::unique_ptr<receive_ring> made(new receive_ring);
    if (!made->set_up(epoll)) made.reset();
    return made;
}

bool receive_ring::set_up(int epoll) {
    io_uring_params how{};
    how.flags = IORING_SETUP_SINGLE_ISSUER | IORING_SETUP_DEFER_TASKRUN | IORING_SETUP_TASKRUN_FLAG;
    ring_.reset(static_cast<int>(::syscall(SYS_io_uring_setup, requests, &how)));
    if (!ring_ || !(how.features & IORING_FEAT_SINGLE_MMAP)) return false;
    rings_ = memory(ring_.get(),
                    std::max(how.sq_off.array + how.sq_entries * sizeof(std::uint32_t),
                             how.cq_off.cqes + how.cq_entries * sizeof(io_uring_cqe)),
                    IORING_OFF_SQ_RING);
    requests_ = memory(ring_.get(), how.sq_entries * sizeof(io_uring_sqe), IORING_OFF_SQES);
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
    // The sockets are held by their receipts, and without this until some time after the descriptor is closed.
    auto& all = next_request();
    all.opcode = IORING_OP_ASYNC_CANCEL;
    all.cancel_flags = IORING_ASYNC_CANCEL_ANY | IORING_ASYNC_CANCEL_ALL;
    all.user_data = cancel_name;
    enter(0);
}

// A request whose name the kernel tells with each completion. They are submitted when the loop waits next.
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
    request.user_data = epoll_name;
}

std::uint64_t receive_ring::name_of(std::uint32_t at) const noexcept {
    return std::uint64_t{places_[at].round} << 32 | at;
}

void receive_ring::receive(std::uint32_t at) noexcept {
    auto& request = next_request();
    request.opcode = IORING_OP_RECV;
    request.fd = places_[at].of->fd();
    request.ioprio = IORING_RECV_MULTISHOT;
    request.flags = IOSQE_BUFFER_SELECT;
    request.user_data = name_of(at);
}

void receive_ring::cancel(std::uint64_t name) noexcept {
    auto& request = next_request();
    request.opcode = IORING_OP_ASYNC_CANCEL;
    request.addr = name;
    request.user_data = cancel_name;
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
        places_.emplace_back();
        free_.reserve(places_.size());
        free_.push_back(static_cast<std::uint32_t>(places_.size() - 1));
    }
    const auto at = free_.back();
    free_.pop_back();
    places_[at].of = &who;
    places_[at].leaves = false;
    who.receives_at_ = at;
    if (receiving_++ == 0) watch_epoll();
    receive(at);
}

void receive_ring::leave(std::uint32_t at) noexcept {
    if (!std::exchange(places_[at].leaves, true)) cancel(name_of(at));
}

void receive_ring::forget(descriptor& who) noexcept {
    const auto at = std::exchange(who.receives_at_, descriptor::nowhere);
    if (at == descriptor::nowhere) return;
    places_[at].of = nullptr;
    cancel(name_of(at));
    enter(0);
}

[[gnu::hot]] bool receive_ring::wait(bool sleeps) noexcept {
    take_completions();
    if (epoll_ready_ || !came_.empty()) sleeps = false;
    if (sleeps || unsubmitted() > 0 || system_has_work()) {
        enter(sleeps ? 1 : 0);
        take_completions();
    }
    if (!came_.empty()) in_vain_ = 0;
    else if (epoll_ready_ && ++in_vain_ == waits_in_vain) leave_all();
    return std::exchange(epoll_ready_, false);
}

void receive_ring::leave_all() noexcept {
    in_vain_ = 0;
    for (std::uint32_t at = 0; at < places_.size(); ++at)
        if (places_[at].of) leave(at);
}

[[gnu::hot]] void receive_ring::take_completions() noexcept {
    auto head = *complete_head_;
    const auto tail = load(complete_tail_);
    bool epoll_watched = true;
    for (; head != tail; ++head) {
        const auto& one = completions_[head & complete_mask_];
        if (one.user_data == epoll_name) {
            epoll_ready_ = epoll_ready_ || one.res > 0;
            if (one.res != -ECANCELED && !(one.flags & IORING_CQE_F_MORE)) epoll_watched = false;
        } else if (one.user_data != cancel_name) {
            came_.push_back({one.user_data, one.res, one.flags});
        }
    }
    store(complete_head_, head);
    if (!epoll_watched) watch_epoll();
}

[[gnu::hot]] void receive_ring::tell(loop& on) {
    // What one brings may close others, and begin with more.
    for (std::size_t next = 0; next < came_.size(); ++next) tell_one(came_[next], on);
    came_.clear();
}

[[gnu::hot]] void receive_ring::tell_one(const completion& came, loop& on) {
    const auto at = static_cast<std::uint32_t>(came.what);
    auto* who = places_[at].of;
    const bool has_bytes = came.result > 0;
    const bool too_fast = came.result == static_cast<std::int32_t>(buffer_bytes) || came.result == -ENOBUFS;
    const bool ends = !has_bytes && came.result != -ENOBUFS && came.result != -ECANCELED;
    bool last = !(came.flags & IORING_CQE_F_MORE);
    if (too_fast && last) places_[at].leaves = true;
    else if (too_fast) leave(at);
    if (last && who && has_bytes && !places_[at].leaves) { // the system stops for reasons of its own
        receive(at);
        last = false;
    }
    if (last) {
        ++places_[at].round;
        places_[at].of = nullptr;
        if (who) who->receives_at_ = descriptor::nowhere;
        free_.push_back(at);
        if (--receiving_ == 0) { // the loop waits by epoll alone
            cancel(epoll_name);
            enter(0);
        }
    }
    const auto buffer = static_cast<std::uint16_t>(came.flags >> IORING_CQE_BUFFER_SHIFT);
    if (who && (has_bytes || last)) {
        loop::turn in(on);
        if (has_bytes)
            who->on_received({buffers_.at<std::byte>(buffer * buffer_bytes), static_cast<std::size_t>(came.result)},
                             {});
        if (ends) who->on_received({}, problem_of(came.result));
        else if (last) who->on_received_all();
    }
    if (came.flags & IORING_CQE_F_BUFFER) give_back(buffer);
}

} // namespace ise::real
