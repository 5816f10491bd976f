#pragma once
#include <ise/core/asio_names.hpp>
#include <ise/core/endpoint.hpp>
#include <ise/core/result.hpp>
#include <ise/core/stream.hpp>
#include <ise/core/task.hpp>
#include <ise/core/time.hpp>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace ise {

class loop;

/// The identity of this process, for choosing the nearest transport and for distinguishing lives of a component.
struct process_identity {
    std::string host_name;        ///< for people
    std::string host_key;         ///< equal where local sockets and loopback reach: machine, boot, network namespace
    std::string process_key;      ///< equal only within one process and life
    std::uint64_t process_id = 0; ///< the operating system's process id
};

/// The settings of a serial line; always 8 data bits, no parity, 1 stop bit.
struct serial_options {
    std::string device;                 ///< "/dev/ttyUSB0", or a name in the virtual world
    unsigned baud = 9600;               ///< bits per second
    bool hardware_flow_control = false; ///< RTS and CTS
};

/// An emulated serial line: programs open `device` like a port, and the emulated device behind it reads and
/// writes `far_end`. When the program closes the device, `far_end` may fail; make another one then.
struct pseudo_terminal {
    std::unique_ptr<stream> far_end; ///< the end of the emulated device
    std::string device;              ///< the name for `open_serial`: the symbolic link, if there is one
};

/// Owns a loop and its thread, if it has one; destroying it ends the loop and waits for the thread.
class loop_host {
public:
    virtual ~loop_host() = default;
    virtual ise::loop& loop() noexcept = 0; ///< always the same one
    /// Makes it poll for events for up to `window` before it sleeps, adaptively. This applies only to a thread of its
    /// own: a program polls its own executors, and in the virtual world nothing sleeps. Call it at most once;
    /// thread-safe.
    virtual void poll([[maybe_unused]] duration window) {}
    /// Ends the loop: nothing runs on it any more, its thread has ended, and suspended coroutines are destroyed while
    /// the objects that they refer to still exist. The loop and its executor remain, unusable, until the host is
    /// destroyed, so that sockets and timers made on them can be destroyed in between. May be repeated; not from the
    /// loop's own thread, except for an adopted loop, which is ended on its executor.
    virtual void end() = 0;
};

/// The access of one process to the outside world. All of ISE reads clocks, sleeps, draws random numbers and opens
/// sockets and files only through it, so that the same components run in the real and in the virtual world.
///
/// Lifetime: must outlive its loops and everything made from it. Thread-safe, except functions with a `loop&`, which
/// are called on that loop.
class environment {
public:
    virtual ~environment() = default;

    /// The monotonic clock.
    virtual time_point now() const = 0;
    /// The same clock, at most some milliseconds behind, if that is cheaper to read.
    virtual time_point recently() const { return now(); }
    /// Civil time, UTC; it may be set back.
    virtual wall_time wall() const = 0;
    /// Unpredictable in the real world, seeded in the virtual one.
    virtual std::uint64_t random() = 0;
    /// The identity of this process, constant during its life.
    virtual const process_identity& identity() const = 0;
    /// An environment variable of the process, such as ISE_NAME_SERVER.
    virtual std::optional<std::string> variable(const std::string& name) const = 0;

    /// Makes a loop; in the real world with a thread of its own.
    virtual std::unique_ptr<loop_host> make_loop(const std::string& name) = 0;
    /// Makes a loop on an executor that the embedding program runs. `one_thread` guarantees that nothing on it ever
    /// runs concurrently; without it ISE uses a strand.
    virtual std::unique_ptr<loop_host> adopt(asio::any_io_executor executor, bool one_thread) = 0;

    /// Runs `work` on a worker thread; in the virtual world at once, in zero time.
    virtual void offload(std::function<void()> work) = 0;
    /// Whether time is virtual: then nothing may block.
    virtual bool is_virtual() const noexcept = 0;

    /// Connects to a tcp, local or inproc endpoint; the addresses of a host name are tried in order. Other transports
    /// are made of these and of datagrams (ise/transport).
    /// Errors: errc::unreachable with each address and its cause. Cancellation: terminal, no connection stays open.
    virtual task<result<std::unique_ptr<stream>>> connect(loop& on, endpoint to) = 0;
    /// Errors: errc::address_in_use, errc::invalid_argument, errc::io_failed.
    virtual result<std::unique_ptr<listener>> listen(loop& on, const endpoint& at) = 0;
    /// A socket bound to a udp endpoint (port 0: any). Errors as `listen`.
    virtual result<std::unique_ptr<datagram_socket>> open_datagram(loop& on, const endpoint& at) = 0;
    /// Errors: errc::io_failed (no such device, no permission, in use).
    virtual result<std::unique_ptr<stream>> open_serial(loop& on, const serial_options& options) = 0;
    /// Makes a pseudo-terminal, with the symbolic link `link` unless that is empty. The link is removed with `far_end`;
    /// one of a dead program is replaced. Errors: errc::address_in_use (another file is there), errc::io_failed.
    virtual result<pseudo_terminal> open_pseudo_terminal(loop& on, const std::string& link) = 0;

    /// The whole content of a small file (configuration, recorded data), at most `max_bytes`.
    virtual result<std::string> read_file(const std::string& path, std::size_t max_bytes) = 0;

    /// Addresses of this host that other hosts may reach, for a listener bound to every interface.
    virtual std::vector<std::string> interface_addresses() const = 0;

    /// Reads a file with a secret: refuses one that other users of the machine can read, replace or change.
    /// Errors: errc::unauthorized (the user, and the remedy), errc::io_failed, errc::too_large.
    virtual result<std::string> read_secret(const std::string& path, std::size_t max_bytes) = 0;
    /// Reads a file with trusted authorities: refuses one that other users of the machine can replace or change.
    /// Errors as `read_secret`. A world without users reads it like any other file.
    virtual result<std::string> read_trusted(const std::string& path, std::size_t max_bytes) {
        return read_file(path, max_bytes);
    }
};

} // namespace ise
