#include <ise/core/real/socket_stream.hpp>
#include <ise/core/real/sockets.hpp>

#include <asio/buffer.hpp>
#include <asio/ip/udp.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
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

using outcome = std::pair<std::error_code, const datagram*>;

class udp_socket final : public datagram_socket, private descriptor {
public:
    udp_socket(loop& on, owned_fd socket, endpoint where)
        : descriptor(on, std::move(socket)), where_(std::move(where)), receiver_(on) {}
    ~udp_socket() override { close(); }

    using descriptor::watch;

    void deliver_to(datagram_reader& reader, std::size_t max_bytes) override {
        deliver_to_ = &reader;
        max_bytes_ = std::min(max_bytes, max_datagram);
        want_read();
    }

    task<outcome> receive() override {
        if (!fd_open()) co_return outcome(asio::error::operation_aborted, nullptr);
        if (may_read()) {
            auto got = take();
            if (got.first != asio::error::would_block) co_return got;
        }
        want_read();
        auto got = co_await receiver_.wait();
        co_return got;
    }

    [[gnu::hot]] std::error_code try_send(const endpoint& to, bytes_view content) override {
        std::error_code problem;
        auto address = address_of(to, problem);
        if (problem) return problem;
        return send_datagram(fd(), content, address.data(), static_cast<socklen_t>(address.size()));
    }

    void close() override {
        if (!fd_open()) return;
        close_descriptor();
        receiver_.resume({asio::error::operation_aborted, nullptr});
    }
    endpoint where() const override { return where_; }

private:
    // Most datagrams go where the last one went, and come from where it came from: its address is turned into text, or
    // read from it, once.
    struct peer {
        udp::endpoint address;
        endpoint named;
    };

    void on_readable() override {
        if (deliver_to_) return deliver();
        if (!receiver_.waiting() || !may_read()) return;
        auto got = take();
        if (got.first == asio::error::would_block) want_read();
        else receiver_.resume(got);
    }
    void on_writable() override {}
    bool takes_datagrams() const noexcept override { return true; }

    [[gnu::hot]] void on_received(const received& what) override {
        const auto size = std::min(what.from.size(), sender_.capacity());
        std::memcpy(sender_.data(), what.from.data(), size);
        sender_.resize(size);
        hand_over(what.content);
    }
    void on_receive_failure(const std::error_code& problem) override {
        deliver_to_->on_problem(problem);
        on_received_all();
    }
    // Of a listener: its peers may come back when others have left room.
    void on_unwatched(const std::error_code& problem) override {
        deliver_to_->on_problem(problem);
        if (!fd_open()) return;
        if (!watch_again_) watch_again_ = std::make_unique<timer>(on(), [this] { on_received_all(); });
        watch_again_->arm(on().now() + std::chrono::milliseconds(100));
    }

    void deliver() {
        unsigned count = 0;
        while (may_read()) {
            const auto got = read();
            if (got.problem && got.problem == asio::error::would_block) break;
            if (got.problem) deliver_to_->on_problem(got.problem);
            else hand_over(bytes_view(room_).first(got.bytes));
            if (!fd_open()) return;
            ++count;
        }
        if (!is_received_for_after(count == 1 && max_bytes_ <= short_bytes)) want_read();
    }

    // Of the one that `sender_` has sent.
    [[gnu::hot]] void hand_over(bytes_view content) {
        if (content.size() <= max_bytes_) deliver_to_->on_datagram(name_of_sender(), content);
    }

    transfer read() {
        if (room_.empty()) room_.resize(std::min(max_bytes_ + 1, max_datagram)); // one more shows that it is longer
        auto size = static_cast<socklen_t>(sender_.capacity());
        const auto got = receive_datagram(fd(), asio::buffer(room_), sender_.data(), size);
        if (got.problem == asio::error::would_block) found_nothing();
        else if (!got.problem) sender_.resize(size);
        return got;
    }

    outcome take() {
        const auto got = read();
        if (got.problem) return {got.problem, nullptr};
        last_.peer = name_of_sender();
        last_.content.assign(room_.begin(), room_.begin() + static_cast<std::ptrdiff_t>(got.bytes));
        return {{}, &last_};
    }

    const endpoint& name_of_sender() {
        if (sender_ != came_from_.address) came_from_ = {sender_, as_endpoint(sender_)};
        return came_from_.named;
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
        if (!lookup_) lookup_ = std::make_shared<lookup>(on());
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

    endpoint where_;
    bytes room_;
    udp::endpoint sender_; // of the datagram that came last
    peer came_from_;
    datagram last_; // for `receive`
    datagram_reader* deliver_to_ = nullptr;
    std::size_t max_bytes_ = max_datagram;
    std::mutex sending_; // signs of life are sent from another thread
    peer went_to_;
    std::shared_ptr<lookup> lookup_;
    std::unique_ptr<timer> watch_again_;
    waiter<outcome> receiver_;
};

} // namespace

result<std::unique_ptr<datagram_socket>> open_udp(loop& on, const endpoint& at) {
    std::error_code problem;
    auto refuse = [&] { return io_failure(fmt::format("cannot open {}", at.text()), problem); };
    auto address = asio::ip::make_address(at.host == "localhost" ? "127.0.0.1" : at.host, problem);
    if (problem) return refuse();
    auto refuse_for_last = [&] {
        problem = last_system_error();
        return refuse();
    };
    auto socket = new_socket(address.is_v6() ? AF_INET6 : AF_INET, SOCK_DGRAM);
    if (!socket) return refuse_for_last();
    const udp::endpoint wanted(address, at.port);
    udp::endpoint bound;
    auto size = static_cast<socklen_t>(bound.capacity());
    if (::bind(socket.get(), wanted.data(), static_cast<socklen_t>(wanted.size())) != 0 ||
        ::getsockname(socket.get(), bound.data(), &size) != 0)
        return refuse_for_last();
    // What the kernel gives is used.
    set_option(socket.get(), SOL_SOCKET, SO_RCVBUF, kernel_buffer_bytes);
    auto made = std::make_unique<udp_socket>(on, std::move(socket), as_endpoint(bound));
    problem = made->watch();
    if (problem) return refuse();
    return std::unique_ptr<datagram_socket>(std::move(made));
}

} // namespace ise::real
