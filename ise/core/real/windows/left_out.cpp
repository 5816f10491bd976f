// The parts of the real environment that Windows lacks.
#include <ise/core/real/sockets.hpp>

#include <fmt/format.h>

namespace ise::real {
namespace {

failure not_on_windows(std::string_view what) {
    return {errc::invalid_argument, fmt::format("{} cannot be used: Windows has no such thing in ISE; use tcp:// "
                                                "between processes, or run this part on Linux",
                                                what)};
}

} // namespace

task<result<std::unique_ptr<stream>>> connect_local(loop&, endpoint to) { co_return not_on_windows(to.text()); }
result<std::unique_ptr<listener>> listen_local(loop&, const endpoint& at) { return not_on_windows(at.text()); }
result<std::unique_ptr<stream>> open_serial(loop&, const serial_options& options) {
    return not_on_windows(fmt::format("serial port {}", options.device));
}
result<pseudo_terminal> open_pseudo_terminal(loop&, const std::string& link) {
    return not_on_windows(fmt::format("pseudo-terminal {}", link));
}

} // namespace ise::real
