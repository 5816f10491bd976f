#pragma once
#include <asio/io_context.hpp>
#include <asio/ip/tcp.hpp>
#include <asio/post.hpp>
#include <asio/read.hpp>
#include <asio/read_until.hpp>
#include <asio/write.hpp>

#include <string>
#include <string_view>

namespace web_test {

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
        send(std::string(method) + " " + std::string(path) + " HTTP/1.1\r\nHost: test\r\n" + std::string(headers) + "\r\n");
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
