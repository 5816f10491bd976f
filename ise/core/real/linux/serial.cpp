#include <ise/core/real/descriptor.hpp>
#include <ise/core/real/linux/descriptor_stream.hpp>
#include <ise/core/real/sockets.hpp>

#include <asio/posix/stream_descriptor.hpp>
#include <asio/serial_port.hpp>

#include <fmt/format.h>

#include <fcntl.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

namespace ise::real {

result<std::unique_ptr<stream>> open_serial(loop& on, const serial_options& options) {
    using port = asio::serial_port;
    std::error_code problem;
    auto refuse = [&] { return io_failure(fmt::format("cannot open serial port {}", options.device), problem); };

    port opened(on.get_executor());
    opened.open(options.device, problem);
    if (problem) return refuse();
    // One owner: two programs on one modem would tear each other's frames apart.
    if (::ioctl(opened.native_handle(), TIOCEXCL) != 0) {
        problem.assign(errno, std::system_category());
        return refuse();
    }
    opened.set_option(port::baud_rate(options.baud), problem);
    if (problem) return refuse();
    opened.set_option(port::character_size(8), problem);
    opened.set_option(port::parity(port::parity::none), problem);
    opened.set_option(port::stop_bits(port::stop_bits::one), problem);
    opened.set_option(
        port::flow_control(options.hardware_flow_control ? port::flow_control::hardware : port::flow_control::none),
        problem);
    if (problem) return refuse();
    int flags = ::fcntl(opened.native_handle(), F_GETFL);
    ::fcntl(opened.native_handle(), F_SETFL, flags | O_NONBLOCK);
    ::tcflush(opened.native_handle(), TCIOFLUSH); // what came while nobody listened is old

    // An asio::serial_port can be read but not awaited for writability: the descriptor itself can.
    owned_fd own(::fcntl(opened.native_handle(), F_DUPFD_CLOEXEC, 0));
    if (!own) {
        problem = last_system_error();
        return refuse();
    }
    asio::posix::stream_descriptor descriptor(on.get_executor(), own.get());
    own.release();
    return std::unique_ptr<stream>(
        std::make_unique<descriptor_stream<asio::posix::stream_descriptor>>(std::move(descriptor), options.device));
}

} // namespace ise::real
