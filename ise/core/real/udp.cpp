#include <ise/core/real/descriptor_stream.hpp>
#include <ise/core/real/sockets.hpp>

#include <asio/ip/udp.hpp>

#include <fmt/format.h>

#include <memory>
#include <mutex>
#include <optional>

namespace ise::real {
namespace {

using asio::ip::udp;

constexpr std::size_t max_datagram = 65'535;
// What arrives while the loop is busy; the kernel gives less where its administrator says so.
constexpr int kernel_buffer_bytes = 1 << 20;

endpoint as_endpoint(const udp::endpoint& at) { return {protocol::udp, at.address().to_string(), at.port(), {}}; }

using received = std::pair<std::error_code, const datagram*>;

class udp_socket final : public datagram_socket {
public:
    udp_socket(loop& on, udp::socket socket, endpoint where)
        : on_(on), socket_(std::move(socket)), where_(std::move(where)) {}

    task<received> receive() override {
        if (room_.empty()) room_.resize(max_datagram);
        auto [problem, count] = co_await socket_.async_receive_from(asio::buffer(room_), sender_, as_tuple);
        co_return take(problem, count);
    }

    std::error_code try_send(const endpoint& to, bytes_view content) override {
        std::error_code problem;
        auto address = address_of(to, problem);
        if (!problem) socket_.send_to(asio::buffer(content.data(), content.size()), address, 0, problem);
        return problem;
    }

    void close() override {
        std::error_code ignored;
        socket_.close(ignored);
    }
    endpoint where() const override { return where_; }

private:
    // Most datagrams go where the last one went, and come from where it came from: its address is turned into text, or
    // read from it, once.
    struct peer {
        udp::endpoint address;
        endpoint named;
    };

    received take(std::error_code problem, std::size_t count) {
        if (problem) return {problem, nullptr};
        if (sender_ != last_sender_) {
            last_.peer = as_endpoint(sender_);
            last_sender_ = sender_;
        }
        last_.content.assign(room_.begin(), room_.begin() + static_cast<std::ptrdiff_t>(count));
        return {{}, &last_};
    }

    udp::endpoint address_of(const endpoint& to, std::error_code& problem) {
        std::lock_guard lock(sending_);
        if (to == went_to_.named) return went_to_.address;
        auto address = asio::ip::make_address(to.host, problem);
        if (problem) return {named(to, problem), to.port};
        went_to_ = {udp::endpoint(address, to.port), to};
        return went_to_.address;
    }

    struct lookup {
        explicit lookup(loop& on) : resolver(on.get_executor()) {}
        udp::resolver resolver;
        std::string name;
        std::optional<asio::ip::address> found;
        std::error_code problem;
        bool pending = false;
    };

    // A name is looked up without waiting: would_block until it is known.
    asio::ip::address named(const endpoint& to, std::error_code& problem) {
        if (!lookup_) lookup_ = std::make_shared<lookup>(on_);
        problem = asio::error::would_block;
        if (lookup_->pending) return {};
        if (lookup_->name == to.host) {
            problem = lookup_->problem;
            if (problem) lookup_->name.clear(); // looked up afresh next time
            return lookup_->found.value_or(asio::ip::address());
        }
        lookup_->name = to.host;
        lookup_->pending = true;
        auto version = where_.host.find(':') == std::string::npos ? udp::v4() : udp::v6();
        lookup_->resolver.async_resolve(
            version, to.host, "",
            [into = std::weak_ptr(lookup_)](std::error_code wrong, udp::resolver::results_type all) {
                auto known = into.lock();
                if (!known) return;
                known->pending = false;
                known->found.reset();
                known->problem = wrong         ? wrong
                                 : all.empty() ? std::error_code(asio::error::host_not_found)
                                               : std::error_code();
                if (!known->problem) known->found = all.begin()->endpoint().address();
            });
        return {};
    }

    loop& on_;
    udp::socket socket_;
    endpoint where_;
    bytes room_;           // of the receive that waits
    udp::endpoint sender_; // its datagram's
    datagram last_;
    udp::endpoint last_sender_;
    std::mutex sending_; // signs of life are sent from another thread
    peer went_to_;
    std::shared_ptr<lookup> lookup_;
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
    std::error_code ignored; // what the kernel gives is used
    socket.set_option(asio::socket_base::receive_buffer_size(kernel_buffer_bytes), ignored);
    auto where = as_endpoint(socket.local_endpoint(problem));
    return std::unique_ptr<datagram_socket>(std::make_unique<udp_socket>(on, std::move(socket), std::move(where)));
}

} // namespace ise::real
