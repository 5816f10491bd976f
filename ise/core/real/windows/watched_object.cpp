#include <ise/core/real/windows/watched_object.hpp>

#include <asio/any_io_executor.hpp>

namespace ise::real {
namespace {

int option_of(SOCKET socket, int name) noexcept {
    int value = 0, size = sizeof value;
    if (::getsockopt(socket, SOL_SOCKET, name, reinterpret_cast<char*>(&value), &size) != 0) return 0;
    return value;
}

} // namespace

watched_object::watched_object(const asio::any_io_executor& on, int socket) {
    const auto number = static_cast<SOCKET>(socket);
    if (option_of(number, SO_TYPE) != SOCK_STREAM || option_of(number, SO_ACCEPTCONN) != 0) {
        other_.emplace(on);
        other_->assign(asio::generic::datagram_protocol(AF_INET, 0), number);
        return;
    }
    sockaddr_storage far{};
    int size = sizeof far;
    connecting_ = ::getpeername(number, reinterpret_cast<sockaddr*>(&far), &size) != 0;
    connection_.emplace(on);
    connection_->assign(asio::generic::stream_protocol(AF_INET, 0), number);
}

void watched_object::close(std::error_code& problem) {
    if (connection_) connection_->close(problem);
    else other_->close(problem);
}

} // namespace ise::real
