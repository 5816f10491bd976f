#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/real/descriptor.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

struct io_uring_buf;
struct io_uring_cqe;
struct io_uring_sqe;

namespace ise::real {

/// Receives for sockets of a loop by io_uring, and waits for its epoll instance: the system call that waits also brings
/// the bytes or the datagram. With epoll alone it takes two, and the kernel looks at the socket twice. For short
/// messages only: where bytes fill a buffer, their socket goes back to epoll, and is read to where they belong. So do
/// all of them while what comes is for others, which cost one call more here.
///
/// Used, made and destroyed by one thread.
class receive_ring {
public:
    /// Null where the system does not offer it (before Linux 6.1, or forbidden, as in many containers) or has no memory
    /// or descriptor left.
    static std::unique_ptr<receive_ring> make(int epoll);
    /// The kernel has released every socket when this returns.
    ~receive_ring();
    receive_ring(const receive_ring&) = delete;
    receive_ring& operator=(const receive_ring&) = delete;

    /// Receives for `who` until the end, an error, or `on_received_all`: its bytes come too fast, or it was asked to
    /// leave.
    void begin(descriptor& who);
    /// Sends the socket back to epoll, behind the bytes that were received by then.
    void leave(descriptor& who) noexcept { leave(who.receive_slot_); }
    /// Delivers nothing more. The kernel has released the socket when this returns.
    void forget(descriptor& who) noexcept;

    /// Whether it receives for any. Where not, the loop waits by epoll alone, which takes one call less.
    bool receives() const noexcept { return receiving_ > 0; }
    /// Waits for a completion, or, without `sleeps`, only looks. Returns whether the epoll instance has events.
    bool wait(bool sleeps) noexcept;
    /// The epoll instance has more events than were taken.
    void epoll_has_more() noexcept { epoll_ready_ = true; }
    /// Delivers the completions of sockets, each in a turn of `on`.
    void deliver(loop& on);

private:
    class memory {
    public:
        memory() = default;
        explicit memory(std::size_t size, int ring = -1, long at = 0); // of the ring, if one is given
        memory& operator=(memory&& other) noexcept;
        ~memory();
        explicit operator bool() const noexcept { return at_ != nullptr; }
        template <class T>
        T* at(std::size_t offset = 0) const noexcept {
            return reinterpret_cast<T*>(static_cast<std::byte*>(at_) + offset);
        }

    private:
        void* at_ = nullptr;
        std::size_t size_ = 0;
    };
    // Of a socket, from `begin` until the last completion of its request.
    struct slot {
        descriptor* of = nullptr;     // null: it was forgotten
        std::uint32_t generation = 0; // in the tag: a late cancel must not hit the next socket
        bool leaves = false;          // it goes back to epoll
    };
    struct completion {
        std::uint64_t tag;
        std::int32_t result;
        std::uint32_t flags;
    };

    receive_ring() = default;
    bool set_up(int epoll);
    io_uring_sqe& next_request() noexcept;
    int enter(unsigned completions) noexcept;
    unsigned unsubmitted() const noexcept;
    bool system_has_work() const noexcept;
    void take_completions() noexcept;
    void watch_epoll() noexcept;
    void receive(std::uint32_t at) noexcept;
    void leave(std::uint32_t at) noexcept;
    void leave_all() noexcept;
    void cancel(std::uint64_t tag) noexcept;
    void withdraw(std::uint64_t tag) noexcept;
    void give_back(std::uint16_t buffer) noexcept;
    std::uint64_t tag_of(std::uint32_t at) const noexcept;
    descriptor::received message_in(const completion& came, const descriptor& to) const noexcept;
    void deliver_one(const completion& came, loop& on);

    owned_fd ring_;
    memory rings_, requests_, buffers_, buffer_list_;
    std::uint32_t *submit_head_ = nullptr, *submit_tail_ = nullptr, *submit_flags_ = nullptr, *submit_list_ = nullptr;
    std::uint32_t submit_mask_ = 0;
    std::uint32_t *complete_head_ = nullptr, *complete_tail_ = nullptr;
    io_uring_cqe* completions_ = nullptr;
    std::uint32_t complete_mask_ = 0;
    std::uint16_t buffer_tail_ = 0;
    int epoll_ = -1;
    bool epoll_ready_ = false;
    unsigned idle_waits_ = 0; // in a row, that brought nothing for a socket

    std::vector<completion> came_; // for `deliver`
    std::vector<slot> slots_;
    std::vector<std::uint32_t> free_;
    std::size_t receiving_ = 0; // slots in use
};

} // namespace ise::real
