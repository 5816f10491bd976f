#pragma once
#include <ise/core/endpoint.hpp>
#include <ise/core/result.hpp>
#include <ise/core/stream.hpp>
#include <ise/core/task.hpp>
#include <ise/core/time.hpp>

#include <asio/any_io_executor.hpp>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace ise {

class loop;

/// Who this process is, for "the nearest transport" and for telling one life of a component from the next.
struct process_identity {
    std::string host_name;  ///< for people
    std::string host_key;   ///< equal where local sockets and loopback reach: machine, boot, network namespace
    std::string process_key;///< equal only within one process and life
    std::uint64_t process_id = 0; ///< of the operating system
};

/// How a serial line is opened: 8 data bits, no parity, 1 stop bit.
struct serial_options {
    std::string device; ///< "/dev/ttyUSB0", or a name that the virtual world knows
    unsigned baud = 9600; ///< bits a second
    bool hardware_flow_control = false; ///< RTS and CTS
};

/// A serial line made of nothing: programs open `device` like a port, and whatever is emulated behind it reads and
/// writes `far_end`. When the program at the device closes it, `far_end` may fail; make another one then.
struct pseudo_terminal {
    std::unique_ptr<stream> far_end; ///< what the emulated device reads and writes
    std::string device; ///< what `open_serial` opens: the link where one was asked for
};

/// Owns a loop and whatever runs it; destroying it ends the loop and waits for its thread.
class loop_host {
public:
    virtual ~loop_host() = default;
    virtual ise::loop& loop() noexcept = 0; ///< always the same one
    /// Lets it look for events for up to `window` before it sleeps, as long as that pays. Only a thread of its own does
    /// that: a program polls its own executors as it likes, and in the virtual world nothing sleeps. At most once; thread-safe.
    virtual void poll([[maybe_unused]] duration window) {}
    /// Ends the loop: nothing runs on it any more, its thread has been waited for, and what was suspended there is
    /// destroyed, all while what that refers to still stands. The loop and its executor stay as husks until the host is
    /// destroyed, so that what was made on them (sockets, timers) can be destroyed in between. Any number of times; not
    /// from the loop's own thread, except for an adopted loop: that one is ended on its executor.
    virtual void end() = 0;
};

/// The world as one process sees it. Nothing in ISE reads a clock, sleeps, draws a random number or opens
/// anything except through it, so that the same components run on the real and on the virtual world.
///
/// Lifetime: outlives its loops and everything made from it. Thread-safe, but for what takes a `loop&`: that
/// is called on that loop.
class environment {
public:
    virtual ~environment() = default;

    /// The monotonic clock.
    virtual time_point now() const = 0;
    /// The same clock as it was some milliseconds ago at most, where that is cheaper to read.
    virtual time_point recently() const { return now(); }
    /// Civil time, UTC; it may be set back.
    virtual wall_time wall() const = 0;
    /// Unpredictable in the real world, seeded in the virtual one.
    virtual std::uint64_t random() = 0;
    /// Of this process, the same as long as it lives.
    virtual const process_identity& identity() const = 0;
    /// An environment variable of the process, such as ISE_NAME_SERVER.
    virtual std::optional<std::string> variable(const std::string& name) const = 0;

    /// A loop of its own: a thread in the real world.
    virtual std::unique_ptr<loop_host> make_loop(const std::string& name) = 0;
    /// A loop on an executor that the embedding program runs. `one_thread` promises that nothing on it ever
    /// runs concurrently; without it ISE works behind a strand.
    virtual std::unique_ptr<loop_host> adopt(asio::any_io_executor executor, bool one_thread) = 0;

    /// Runs `work` on a thread for such work; in the virtual world at once, taking no time.
    virtual void offload(std::function<void()> work) = 0;
    /// Whether time is virtual: then nothing may block.
    virtual bool is_virtual() const noexcept = 0;

    /// Connects to a tcp, local or inproc endpoint; a host name with several addresses is tried in order.
    /// Errors: errc::unreachable with each address and its cause. Cancellation: terminal, nothing is left open.
    virtual task<result<std::unique_ptr<stream>>> connect(loop& on, endpoint to) = 0;
    /// Errors: errc::address_in_use, errc::invalid_argument, errc::io_failed.
    virtual result<std::unique_ptr<listener>> listen(loop& on, const endpoint& at) = 0;
    /// A socket bound to a udp endpoint (port 0: any). Errors as `listen`.
    virtual result<std::unique_ptr<datagram_socket>> open_datagram(loop& on, const endpoint& at) = 0;
    /// Errors: errc::io_failed (no such device, no permission, in use).
    virtual result<std::unique_ptr<stream>> open_serial(loop& on, const serial_options& options) = 0;
    /// Makes a pseudo-terminal, found under the symbolic link `link` unless that is empty. The link goes with `far_end`; one
    /// that a dead program left behind is replaced. Errors: errc::address_in_use (something else lies there), errc::io_failed.
    virtual result<pseudo_terminal> open_pseudo_terminal(loop& on, const std::string& link) = 0;

    /// The whole content of a small file (configuration, recorded data), at most `max_bytes`.
    virtual result<std::string> read_file(const std::string& path, std::size_t max_bytes) = 0;

    /// Addresses of this host that others may reach, for a listener bound to every interface.
    virtual std::vector<std::string> interface_addresses() const = 0;

    /// `read_file` of a file that holds a secret: one that other users of the machine can read, replace or change is refused.
    /// Errors: errc::unauthorized (who may, and what to do), errc::io_failed, errc::too_large.
    virtual result<std::string> read_secret(const std::string& path, std::size_t max_bytes) = 0;
    /// `read_file` of a file that decides whom to believe: one that other users of the machine can replace or change is refused.
    /// Errors as `read_secret`. A world without users reads it as any other.
    virtual result<std::string> read_trusted(const std::string& path, std::size_t max_bytes) { return read_file(path, max_bytes); }
};

} // namespace ise
