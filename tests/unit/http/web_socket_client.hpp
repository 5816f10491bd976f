// A WebSocket client on the virtual world.
#pragma once
#include <ise/http/web_socket_frames.hpp>

#include <ise/core/environment.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/sim/world.hpp>

#include <asio/buffer.hpp>

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace web_socket_test {

class client {
public:
    client(ise::sim::world& world, const std::string& host, const std::string& server, std::uint16_t port,
           std::string protocols, std::string headers = "")
        : host_(world.host(host).start_process("client").make_loop("main")),
          scope_(host_->loop(), [](const auto&, auto) {}) {
        protocols_ = std::move(protocols);
        headers_ = std::move(headers);
        scope_.spawn("client", talk(ise::endpoint{ise::protocol::tcp, server, port, {}}));
    }

    void send(ise::web_socket_opcode kind, std::string_view payload) {
        std::string made;
        ise::append_masked_frame(made, kind, payload, 0x12345678);
        send_raw(made);
    }
    void send_raw(std::string_view bytes) {
        if (!line_ || closed) return;
        asio::const_buffer all(bytes.data(), bytes.size());
        line_->try_write(std::span(&all, 1));
    }
    void leave() {
        if (line_) line_->close();
    }

    std::string raw_head; ///< in place of the handshake
    bool open = false, closed = false;
    bool answers = true;    ///< pings and close frames
    std::string head, rest; ///< of the answer; what follows a refusal
    std::vector<std::string> texts, pongs;
    struct message {
        ise::wall_time came{};
        std::string payload;
    };
    std::vector<message> binaries;
    std::optional<ise::web_socket_code> code;
    std::string reason;

private:
    ise::task<> talk(ise::endpoint to) {
        auto& on = host_->loop();
        auto connected = co_await on.env().connect(on, std::move(to));
        if (!connected) {
            closed = true;
            co_return;
        }
        line_ = std::move(*connected);
        auto ask = raw_head;
        if (ask.empty())
            ask = "GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: "
                  "dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: " +
                  protocols_ + "\r\n" + headers_ + "\r\n";
        send_raw(ask);
        if (!raw_head.empty()) line_->shutdown_write();
        std::array<std::byte, 16384> room;
        ise::web_socket_reader reader(ise::web_socket_reader::from::servers);
        while (!closed) {
            auto got = co_await line_->read_some(asio::buffer(room));
            auto bytes = ise::bytes_view(room).first(got.bytes);
            if (!open) {
                head.append(ise::as_text(bytes));
                auto end = head.find("\r\n\r\n");
                if (end == std::string::npos) {
                    closed = closed || got.problem;
                    continue;
                }
                rest = head.substr(end + 4);
                head.resize(end + 2);
                if (!head.starts_with("HTTP/1.1 101 ")) {
                    if (head.find("Connection: keep-alive") != std::string::npos) closed = true;
                    open = false;
                    while (!got.problem && !closed) {
                        got = co_await line_->read_some(asio::buffer(room));
                        rest.append(ise::as_text(ise::bytes_view(room).first(got.bytes)));
                    }
                    closed = true;
                    line_->close();
                    co_return;
                }
                open = true;
                bytes = ise::as_bytes(rest);
            }
            while (!bytes.empty()) {
                auto used = reader.feed(bytes);
                if (!used) throw ise::error(used.error());
                bytes = bytes.subspan(*used);
                if (reader.complete()) take(reader.take());
            }
            if (got.problem) closed = true;
        }
        line_->close();
    }
    void take(ise::web_socket_message got) {
        using opcode = ise::web_socket_opcode;
        if (got.kind == opcode::text) texts.push_back(std::move(got.payload));
        if (got.kind == opcode::binary) {
            message made;
            made.came = host_->loop().env().wall();
            made.payload = std::move(got.payload);
            binaries.push_back(std::move(made));
        } else if (got.kind == opcode::pong) {
            pongs.push_back(std::move(got.payload));
        } else if (got.kind == opcode::ping && answers) {
            send(opcode::pong, got.payload);
        } else if (got.kind == opcode::close) {
            code = got.code;
            reason = got.payload;
            if (answers) closed = true;
        }
    }

    std::unique_ptr<ise::loop_host> host_;
    ise::task_scope scope_;
    std::string protocols_, headers_;
    std::unique_ptr<ise::stream> line_;
};

} // namespace web_socket_test
