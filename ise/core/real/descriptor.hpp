#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/loop.hpp>

#include <cstdint>
#include <memory>
#include <system_error>
#include <utility>

namespace ise::real {

class descriptor;
class receive_ring;

/// Who tells descriptors what is ready: a loop of ISE's own. On the loop, or once it has ended.
class readiness {
public:
    virtual std::error_code add(descriptor& watched) = 0;
    virtual std::error_code change(descriptor& watched, bool to_write) = 0;
    virtual void remove(descriptor& watched) noexcept = 0;
    /// It is told again that it can be read, after others had their turn.
    virtual void again(descriptor& watched) = 0;
    /// Receives for it: bytes go to `on_received`, and no events are reported, until `on_received_all` or the end.
    /// False: events go on.
    virtual bool receive(descriptor& watched) = 0;

protected:
    ~readiness() = default;
};

/// A file descriptor, or a socket, that belongs to this process, non-blocking and closed on exec; -1: none.
class owned_fd {
public:
    owned_fd() noexcept = default;
    explicit owned_fd(int fd) noexcept : fd_(fd) {}
    owned_fd(owned_fd&& other) noexcept : fd_(other.release()) {}
    owned_fd& operator=(owned_fd&& other) noexcept {
        reset(other.release());
        return *this;
    }
    ~owned_fd() { reset(); }

    explicit operator bool() const noexcept { return fd_ >= 0; }
    int get() const noexcept { return fd_; }
    int release() noexcept { return std::exchange(fd_, -1); }
    void reset(int fd = -1) noexcept;

private:
    int fd_ = -1;
};

/// The error of the system call that failed last, in the category of Asio, whose errors it is compared with.
std::error_code last_system_error() noexcept;

/// A descriptor and its readiness on a loop: told by the loop where it is a `readiness`, else by Asio. Used on the
/// loop. Whoever derives from it closes it first of all when it is destroyed.
class descriptor {
public:
    descriptor(const descriptor&) = delete;
    descriptor& operator=(const descriptor&) = delete;

    int fd() const noexcept { return fd_.get(); }
    /// Handles an event; `over`: the end, or an error.
    struct ready {
        bool to_read, to_write, over;
    };
    /// An event of the loop, in a turn of it.
    void on_events(ready what);
    void on_again();
    /// Valid during the call that hands it over.
    struct received {
        bytes_view content;
        bytes_view from; ///< of a datagram: its sender, a `sockaddr`
    };
    /// Whether the loop receives for it.
    bool receives() const noexcept { return receive_slot_ != no_slot; }
    /// Whether what it receives are datagrams, each from an address.
    virtual bool takes_datagrams() const noexcept { return false; }

protected:
    descriptor(loop& on, owned_fd fd) noexcept : on_(on), fd_(std::move(fd)) {}
    ~descriptor() { close_descriptor(); }

    /// Begins to watch it; a socket that connects begins to connect before.
    std::error_code watch();
    void close_descriptor() noexcept;

    loop& on() const noexcept { return on_; }
    /// Each new event is told, also while what came before was not read.
    bool told_each() const noexcept { return own_ != nullptr; }
    bool fd_open() const noexcept { return static_cast<bool>(fd_); }

    /// There is something to read, or the end, or an error: a reader need not wait. False once reading has found
    /// nothing. One that finds something each time gives way to others after some reads.
    bool may_read() noexcept { return readable_ && reads_left_ > 0 && reads_left_-- > 0; }
    void found_nothing() noexcept { readable_ = false; }
    /// All was read that there was. What comes later is told, but an end that was told already is not told again.
    void found_less() noexcept { readable_ = readable_ && over_; }

    /// In a turn of the loop, where reading may find something. Nothing is destroyed within the call.
    virtual void on_readable() = 0;
    virtual void on_writable() = 0;
    /// Whoever waits asks for it each time.
    void want_read();
    std::error_code want_write();
    /// At the end of an event, which was short or not: after many short ones in a row the loop receives for it, where
    /// it can. True: from now on it does.
    bool is_received_for_after(bool short_event);
    static constexpr std::size_t short_bytes = 4 * 1024;
    /// In a turn of the loop, as `on_readable`: bytes of a stream, or a datagram.
    virtual void on_received([[maybe_unused]] const received& what) {}
    /// The same: an error, or the end of a stream. The loop does not receive for it any more.
    virtual void on_receive_failure([[maybe_unused]] const std::error_code& problem) {}
    /// The same, after `on_received_all`: it cannot be watched at present, so that no event comes.
    virtual void on_unwatched(const std::error_code& problem) { on_receive_failure(problem); }
    /// The loop does not receive for it any more, and reports events from here on.
    void on_received_all();

private:
    friend class receive_ring;
    struct asio_watch;

    static constexpr std::uint32_t no_slot = ~std::uint32_t{0};
    static constexpr int reads_in_a_row = 16;

    bool receive();
    void come_readable(bool over);

    loop& on_;
    owned_fd fd_;
    readiness* own_ = nullptr; // else Asio
    std::shared_ptr<asio_watch> asio_;
    std::uint32_t receive_slot_ = no_slot; // at the ring that receives for it
    unsigned short_events_ = 0;            // in a row
    int reads_left_ = 0;
    bool readable_ = false;
    bool over_ = false;           // the end, or an error
    bool waits_to_write_ = false; // `own_` tells it
    bool again_ = false;          // listed for the next round of the loop
};

} // namespace ise::real
