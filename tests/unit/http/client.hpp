#pragma once
#include <ise/http/http_server.hpp>

#include <ise/core/real/environment.hpp>
#include <ise/core/task_scope.hpp>

#include <support/catch.hpp>

#include <asio/buffer.hpp>
#include <asio/io_context.hpp>
#include <asio/ip/tcp.hpp>
#include <asio/post.hpp>
#include <asio/read.hpp>
#include <asio/read_until.hpp>
#include <asio/write.hpp>

#include <exception>
#include <memory>
#include <string>
#include <string_view>

namespace web_test {

/// Where a server of a test runs: a loop on a context that the test polls.
struct grounds {
    grounds() = default;
    ~grounds() {
        scope.stop();
        while (scope.size() > 0) turn();
    }
    auto spawner() {
        return [this](std::string name, ise::task<> body) { scope.spawn(std::move(name), std::move(body)); };
    }
    void turn() {
        context.restart();
        context.poll();
    }

    std::string logged; ///< by a server that has `log`
    asio::io_context context;
    ise::real_environment env;
    ise::logger log{env, "server",
                    [this](const ise::log_record& result) { logged.append(result.message).append("\n"); }};
    std::unique_ptr<ise::loop_host> host = env.adopt(context.get_executor(), true);
    ise::task_scope scope{host->loop(), [](const std::string&, std::exception_ptr) {}};
};

/// Any free port of that address.
inline ise::endpoint any_port(std::string address = "127.0.0.1") {
    return ise::endpoint{ise::protocol::tcp, std::move(address), 0, {}};
}

/// An address of this machine that is no loopback address, and so another host to the server; empty: it has none.
inline std::string another_host() {
    for (const auto& text : ise::real_environment().interface_addresses()) {
        auto address = asio::ip::make_address(text);
        if (address.is_v4() && !address.is_loopback()) return text;
    }
    WARN("this machine has no address beyond loopback: what another host gets is not tested");
    return "";
}

/// A blocking HTTP client for tests: the server runs on `context`, which is polled between the socket's steps, so
/// that everything happens on one thread and in one order.
class client {
public:
    client(asio::io_context& context, std::uint16_t port, std::string_view address = "127.0.0.1")
        : context_(context), socket_(own_) {
        socket_.connect({asio::ip::make_address(address), port});
        socket_.non_blocking(true);
    }

    void send(std::string_view text) {
        while (!text.empty()) {
            std::error_code failed;
            auto sent = socket_.write_some(asio::buffer(text), failed);
            if (failed && failed != asio::error::would_block) return;
            text.remove_prefix(sent);
            turn();
        }
    }

    void get(std::string_view path, std::string_view headers = "", std::string_view method = "GET") {
        send(std::string(method) + " " + std::string(path) + " HTTP/1.1\r\nHost: test\r\n" + std::string(headers) +
             "\r\n");
    }

    /// Everything received so far and until `wanted` stands in it, or the server closed.
    std::string& read_until(std::string_view wanted) {
        while (received.find(wanted) == std::string::npos && !closed) read_some();
        return received;
    }
    std::string& read_to_end() {
        while (!closed) read_some();
        return received;
    }
    /// One whole answer with a Content-Length; what was received stays.
    std::string& read_answer(bool head = false) {
        read_until("\r\n\r\n");
        auto body = received.find("\r\n\r\n") + 4;
        auto field = received.find("Content-Length: ");
        auto length = head || field == std::string::npos ? 0 : std::stoul(received.substr(field + 16));
        while (received.size() < body + length && !closed) read_some();
        return received;
    }

    asio::ip::tcp::socket& socket() { return socket_; }
    void turn() {
        context_.restart();
        context_.poll();
    }

    std::string received;
    bool closed = false;

private:
    void read_some() {
        char buffer[16384];
        std::error_code failed;
        auto got = socket_.read_some(asio::buffer(buffer), failed);
        if (failed == asio::error::would_block) {
            context_.restart();
            context_.run_one_for(std::chrono::milliseconds(5)); // the server's turn; how long does not matter
            return;
        }
        if (failed) closed = true;
        received.append(buffer, got);
    }

    asio::io_context& context_;
    asio::io_context own_;
    asio::ip::tcp::socket socket_;
};

} // namespace web_test
