#include <ise/core/real/descriptor_stream.hpp>
#include <ise/core/real/sockets.hpp>

#include <asio/ip/udp.hpp>

#include <fmt/format.h>

namespace ise::real {
namespace {

using asio::ip::udp;

constexpr std::size_t largest_datagram = 65'535;

endpoint as_endpoint(const udp::endpoint& at) { return {protocol::udp, at.address().to_string(), at.port(), {}}; }

class udp_socket final : public datagram_socket {
public:
    udp_socket(udp::socket socket, endpoint where) : socket_(std::move(socket)), where_(std::move(where)) {}

    task<std::pair<std::error_code, datagram>> receive() override {
        bytes room(largest_datagram);
        udp::endpoint from;
        auto [problem, count] = co_await socket_.async_receive_from(asio::buffer(room), from, as_tuple);
        room.resize(problem ? 0 : count);
        datagram received;
        received.peer = as_endpoint(from);
        received.content = std::move(room);
        co_return std::pair(problem, std::move(received));
    }

    std::error_code try_send(const endpoint& to, bytes_view content) override {
        std::error_code problem;
        auto address = asio::ip::make_address(to.host, problem);
        if (problem) return problem;
        socket_.send_to(asio::buffer(content.data(), content.size()), udp::endpoint(address, to.port), 0, problem);
        return problem;
    }

    void close() override {
        std::error_code ignored;
        socket_.close(ignored);
    }
    endpoint where() const override { return where_; }

private:
    udp::socket socket_;
    endpoint where_;
};

} // namespace

result<std::unique_ptr<datagram_socket>> open_udp(loop& on, const endpoint& at) {
    std::error_code problem;
    auto refuse = [&] { return io_failure(fmt::format("cannot open {}", at.text()), problem); };
    auto address = asio::ip::make_address(at.host == "localhost" ? "127.0.0.1" : at.host, problem);
    if (problem) return refuse();
    udp::socket socket(on.get_executor());
    socket.open(address.is_v6() ? udp::v6() : udp::v4(), problem);
    if (problem) return refuse();
    socket.bind(udp::endpoint(address, at.port), problem);
    if (problem) return refuse();
    socket.non_blocking(true, problem);
    auto where = as_endpoint(socket.local_endpoint(problem));
    return std::unique_ptr<datagram_socket>(std::make_unique<udp_socket>(std::move(socket), std::move(where)));
}

} // namespace ise::real
