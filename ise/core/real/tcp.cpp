#include <ise/core/asio_compat.hpp>
#include <ise/core/real/socket_stream.hpp>
#include <ise/core/real/sockets.hpp>
#include <ise/core/real/system_errors.hpp>

#include <asio/io_context.hpp>
#include <asio/ip/tcp.hpp>

#include <fmt/format.h>

#include <cstring>
#include <vector>

namespace ise::real {
namespace {

using asio::ip::tcp;
using compat::as_tuple;

endpoint as_endpoint(const tcp::endpoint& at) { return {protocol::tcp, at.address().to_string(), at.port(), {}}; }

std::string peer_of(int fd) {
    tcp::endpoint far;
    socklen_t size = static_cast<socklen_t>(far.capacity());
    if (::getpeername(fd, far.data(), &size) != 0) far = {}; // one that died already
    return as_endpoint(far).text();
}

using accepted = std::pair<std::error_code, std::unique_ptr<stream>>;

class tcp_listener final : public listener {
public:
    tcp_listener(loop& on, owned_fd listening, endpoint where)
        : on_(on), acceptor_(on, std::move(listening)), where_(std::move(where)) {}

    std::error_code watch() { return acceptor_.watch(); }
    task<accepted> accept() override {
        auto& on = on_; // this may be gone afterwards
        auto [problem, socket] = co_await acceptor_.accept();
        if (problem) co_return accepted(problem, nullptr);
        auto peer = peer_of(socket.get());
        co_return socket_stream::of(on, std::move(socket), std::move(peer));
    }
    void close() override { acceptor_.close(); }
    endpoint where() const override { return where_; }

private:
    loop& on_;
    socket_acceptor acceptor_;
    endpoint where_;
};

} // namespace

failure connect_failure(const endpoint& to, const std::error_code& why) {
    auto what = fmt::format("cannot connect to {}", to.text());
    if (is_out_of_descriptors(why)) return failure(errc::unreachable, io_failure(what, why).message());
    return failure(errc::unreachable, fmt::format("{}: {}", what, why.message()));
}

task<result<std::unique_ptr<stream>>> connect_tcp(loop& on, endpoint to) {
    std::vector<tcp::endpoint> found;
    std::error_code no_address;
    auto address = asio::ip::make_address(to.host, no_address);
    if (!no_address) {
        found.emplace_back(address, to.port);
    } else {
        tcp::resolver resolver(on.get_executor());
        auto flags = tcp::resolver::numeric_service;
        auto [no_name, all] = co_await resolver.async_resolve(to.host, std::to_string(to.port), flags, as_tuple);
        if (no_name == asio::error::operation_aborted) co_return failure(errc::cancelled, "connecting was cancelled");
        if (no_name)
            co_return failure(errc::unreachable,
                              fmt::format("{}: cannot resolve '{}': {}", to.text(), to.host, no_name.message()));
        for (const auto& one : all) found.push_back(one.endpoint());
    }
    std::string tried;
    const bool itself = found.size() == 1 && as_endpoint(found.front()).text() == to.text();
    for (const auto& candidate : found) {
        sockaddr_storage target{};
        std::memcpy(&target, candidate.data(), candidate.size());
        auto where = as_endpoint(candidate).text();
        auto size = static_cast<socklen_t>(candidate.size());
        auto [problem, line] = co_await socket_stream::connect(on, target, size, where);
        if (!problem) co_return std::move(line);
        if (problem == asio::error::operation_aborted) co_return failure(errc::cancelled, "connecting was cancelled");
        if (itself || is_out_of_descriptors(problem)) co_return connect_failure(to, problem);
        tried += fmt::format("{}{}: {}", tried.empty() ? "" : ", ", where, problem.message());
    }
    co_return failure(errc::unreachable, fmt::format("cannot connect to {} ({})", to.text(), tried));
}

result<std::unique_ptr<listener>> listen_tcp(loop& on, const endpoint& at) {
    std::error_code problem;
    auto refuse = [&] { return io_failure(fmt::format("cannot listen on {}", at.text()), problem); };
    auto refuse_for_last = [&] {
        problem = last_system_error();
        return refuse();
    };

    asio::io_context here;
    tcp::resolver resolver(here);
    auto found = resolver.resolve(at.host, std::to_string(at.port),
                                  tcp::resolver::passive | tcp::resolver::numeric_service, problem);
    if (problem || found.empty()) return refuse();
    const auto address = found.begin()->endpoint();

    auto socket = new_socket(address.protocol().family(), SOCK_STREAM);
    if (!socket) return refuse_for_last();
    problem = claim_port(socket.get());
    if (problem) return refuse();
    tcp::endpoint bound;
    auto size = static_cast<socklen_t>(bound.capacity());
    if (::bind(socket.get(), address.data(), static_cast<socklen_t>(address.size())) != 0 ||
        ::listen(socket.get(), SOMAXCONN) != 0 || ::getsockname(socket.get(), bound.data(), &size) != 0)
        return refuse_for_last();
    auto made = std::make_unique<tcp_listener>(on, std::move(socket), as_endpoint(bound));
    problem = made->watch();
    if (problem) return refuse();
    return std::unique_ptr<listener>(std::move(made));
}

} // namespace ise::real
