#include <ise/core/real/descriptor_stream.hpp>
#include <ise/core/real/sockets.hpp>

#include <asio/connect.hpp>
#include <asio/ip/tcp.hpp>

#include <fmt/format.h>

#include <cerrno>

namespace ise::real {
namespace {

using asio::ip::tcp;

void tune(tcp::socket& socket) {
    std::error_code ignored; // a socket that died already says so at its first read
    socket.set_option(tcp::no_delay(true), ignored);
    socket.non_blocking(true, ignored);
}

endpoint as_endpoint(const tcp::endpoint& at) { return {protocol::tcp, at.address().to_string(), at.port(), {}}; }

std::unique_ptr<stream> as_stream(tcp::socket socket) {
    tune(socket);
    std::error_code ignored;
    auto peer = as_endpoint(socket.remote_endpoint(ignored)).text();
    return std::make_unique<descriptor_stream<tcp::socket>>(std::move(socket), std::move(peer));
}

using accepted = std::pair<std::error_code, std::unique_ptr<stream>>;

class tcp_listener final : public listener {
public:
    tcp_listener(tcp::acceptor acceptor, endpoint where) : acceptor_(std::move(acceptor)), where_(std::move(where)) {}

    task<std::pair<std::error_code, std::unique_ptr<stream>>> accept() override {
        auto [problem, socket] = co_await acceptor_.async_accept(as_tuple);
        co_return accepted(problem, problem ? nullptr : as_stream(std::move(socket)));
    }
    void close() override {
        std::error_code ignored;
        acceptor_.close(ignored);
    }
    endpoint where() const override { return where_; }

private:
    tcp::acceptor acceptor_;
    endpoint where_;
};

bool out_of_descriptors(const std::error_code& why) { return why.value() == EMFILE || why.value() == ENFILE; }

} // namespace

failure connect_failure(const endpoint& to, const std::error_code& why) {
    auto what = fmt::format("cannot connect to {}", to.text());
    if (out_of_descriptors(why)) return failure(errc::unreachable, io_failure(what, why).message());
    return failure(errc::unreachable, fmt::format("{}: {}", what, why.message()));
}

task<result<std::unique_ptr<stream>>> connect_tcp(loop& on, endpoint to) {
    tcp::resolver resolver(on.get_executor());
    auto flags = tcp::resolver::numeric_service;
    auto [no_name, found] = co_await resolver.async_resolve(to.host, std::to_string(to.port), flags, as_tuple);
    if (no_name) {
        if (no_name == asio::error::operation_aborted) co_return failure(errc::cancelled, "connecting was cancelled");
        co_return failure(errc::unreachable,
                          fmt::format("{}: cannot resolve '{}': {}", to.text(), to.host, no_name.message()));
    }
    std::string tried;
    bool itself = found.size() == 1 && as_endpoint(found.begin()->endpoint()).text() == to.text();
    for (const auto& candidate : found) {
        tcp::socket socket(on.get_executor());
        auto [problem] = co_await socket.async_connect(candidate.endpoint(), as_tuple);
        if (!problem) co_return as_stream(std::move(socket));
        if (problem == asio::error::operation_aborted) co_return failure(errc::cancelled, "connecting was cancelled");
        if (itself || out_of_descriptors(problem)) co_return connect_failure(to, problem);
        tried += fmt::format("{}{}: {}", tried.empty() ? "" : ", ", as_endpoint(candidate.endpoint()).text(),
                             problem.message());
    }
    co_return failure(errc::unreachable, fmt::format("cannot connect to {} ({})", to.text(), tried));
}

result<std::unique_ptr<listener>> listen_tcp(loop& on, const endpoint& at) {
    std::error_code problem;
    auto refuse = [&] { return io_failure(fmt::format("cannot listen on {}", at.text()), problem); };

    tcp::resolver resolver(on.get_executor());
    auto found = resolver.resolve(at.host, std::to_string(at.port),
                                  tcp::resolver::passive | tcp::resolver::numeric_service, problem);
    if (problem || found.empty()) return refuse();
    auto address = found.begin()->endpoint();

    tcp::acceptor acceptor(on.get_executor());
    acceptor.open(address.protocol(), problem);
    if (problem) return refuse();
    acceptor.set_option(tcp::acceptor::reuse_address(true), problem);
    acceptor.bind(address, problem);
    if (problem) return refuse();
    acceptor.listen(asio::socket_base::max_listen_connections, problem);
    if (problem) return refuse();
    auto where = as_endpoint(acceptor.local_endpoint(problem));
    return std::unique_ptr<listener>(std::make_unique<tcp_listener>(std::move(acceptor), std::move(where)));
}

} // namespace ise::real
