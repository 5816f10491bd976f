#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/result.hpp>
#include <ise/core/stream.hpp>
#include <ise/sim/random.hpp>
#include <ise/sim/socket_owner.hpp>

#include <array>
#include <memory>
#include <string>

namespace ise::sim {

class serial_end;

/// A serial line into a host: the device that `environment::open_serial` opens, and the far end for whatever is
/// emulated there. Ten bits a byte at the baud rate that the device was opened with. What is written while the
/// other end is not open is lost, as on a wire; there is no end of stream. Made by `world::serial_line`.
class serial_line {
public:
    static constexpr std::size_t send_buffer_bytes = 4096;         ///< beyond it a write would block
    static constexpr std::size_t receive_buffer_bytes = 16 * 1024; ///< beyond it bytes are lost (overrun, traced)

    /// The line of that name into that host, made when it is first asked for.
    static serial_line& into(world_core& world, machine& host, const std::string& name);
    /// Made by `into`.
    serial_line(world_core& world, const machine& into, const std::string& name);
    ~serial_line();

    /// The far end, for use on that loop of any process; one at a time.
    /// Errors: errc::io_failed (the far end is open already).
    result<std::unique_ptr<stream>> open_far_end(socket_owner& owner, loop& on);

    /// Unplugged: the device end fails with `no_such_device`, opening fails, what the far end writes is lost.
    void vanish();
    /// Plugged in again: it can be opened anew. The far end was there all the time.
    void come_back() noexcept { present_ = true; }
    /// Whether it is plugged in.
    bool present() const noexcept { return present_; }

    /// Baud rate of the far end; bytes are garbled while the device is opened at another rate. 0: any.
    unsigned far_end_baud = 0;

    /// @cond
    // For the world's parts.
    result<std::unique_ptr<stream>> open_device(socket_owner& owner, loop& on, const std::string& device,
                                                unsigned baud);
    /// @endcond

private:
    friend class serial_end;
    static constexpr std::size_t device = 0, far = 1;

    void carry(std::size_t from, bytes_view content);
    void arrive(std::size_t to, bytes content);

    world_core& world_;
    std::string name_;
    generator random_;
    std::array<std::weak_ptr<serial_end>, 2> ends_;
    std::array<std::size_t, 2> under_way_{};
    std::array<time_point, 2> free_at_{};
    unsigned baud_ = 9600;
    bool present_ = true;
};

} // namespace ise::sim
