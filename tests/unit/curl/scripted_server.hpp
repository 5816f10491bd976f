#pragma once
#include <ise/core/asio_compat.hpp>
#include <support/program.hpp>
#include <support/real_parties.hpp>

#include <asio/buffer.hpp>
#include <asio/ip/tcp.hpp>
#include <asio/read.hpp>
#include <asio/read_until.hpp>
#include <asio/ssl.hpp>
#include <asio/write.hpp>

#include <filesystem>
#include <list>
#include <unistd.h>

namespace curl_test {

/// Certificates for the servers of the tests, made once a run; gone with it.
class certificates {
public:
    static certificates& made() {
        static certificates all;
        return all;
    }
    std::string file(const std::string& name) const { return (folder_ / name).string(); }

private:
    certificates() {
        std::filesystem::create_directories(folder_);
        self_signed("server", "DNS:localhost,IP:127.0.0.1");
        self_signed("other", "DNS:elsewhere.example");
    }
    ~certificates() { std::filesystem::remove_all(folder_); }
    void self_signed(const std::string& name, const std::string& names) {
        auto ran = ise_test::run_program({"/usr/bin/openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt",
                                          "ec_paramgen_curve:prime256v1", "-nodes", "-keyout", file(name + ".key"),
                                          "-out", file(name + ".pem"), "-days", "2", "-subj", "/CN=test", "-addext",
                                          "subjectAltName=" + names});
        if (ran.exit_code != 0) throw std::runtime_error("openssl: " + ran.err);
    }
    std::filesystem::path folder_ = std::filesystem::temp_directory_path() / ("ise-curl-" + std::to_string(::getpid()));
};

/// One connection of a scripted server.
class visitor {
public:
    visitor(asio::ip::tcp::socket socket, asio::ssl::context* tls) : plain_(std::move(socket)) {
        if (tls) secure_.emplace(plain_, *tls);
    }

    ise::task<bool> begin() {
        if (!secure_) co_return true;
        auto [problem] = co_await secure_->async_handshake(asio::ssl::stream_base::server, ise::compat::as_tuple);
        co_return !problem;
    }
    /// A line without its end; empty at the end of the stream.
    ise::task<std::string> next_line() {
        std::error_code problem;
        std::size_t size = 0;
        if (secure_) {
            auto [failed, got] =
                co_await asio::async_read_until(*secure_, asio::dynamic_buffer(held_), "\r\n", ise::compat::as_tuple);
            problem = failed, size = got;
        } else {
            auto [failed, got] =
                co_await asio::async_read_until(plain_, asio::dynamic_buffer(held_), "\r\n", ise::compat::as_tuple);
            problem = failed, size = got;
        }
        std::string made = held_.substr(0, problem ? 0 : size - 2);
        held_.erase(0, problem ? held_.size() : size);
        ended = ended || problem;
        heard.push_back(made);
        co_return made;
    }
    /// Everything up to a blank line.
    ise::task<std::string> head() {
        std::string made;
        for (;;) {
            auto one = co_await next_line();
            if (one.empty()) break;
            made += one + "\n";
        }
        co_return made;
    }
    ise::task<std::string> bytes(std::size_t count) {
        if (held_.size() < count) {
            auto more = asio::transfer_exactly(count - held_.size());
            if (secure_) co_await asio::async_read(*secure_, asio::dynamic_buffer(held_), more, ise::use_task);
            else co_await asio::async_read(plain_, asio::dynamic_buffer(held_), more, ise::use_task);
        }
        auto made = held_.substr(0, count);
        held_.erase(0, count);
        co_return made;
    }
    /// False where the other side is gone.
    ise::task<bool> say(std::string text) {
        std::error_code problem;
        if (secure_) {
            auto [failed, size] = co_await asio::async_write(*secure_, asio::buffer(text), ise::compat::as_tuple);
            problem = failed;
        } else {
            auto [failed, size] = co_await asio::async_write(plain_, asio::buffer(text), ise::compat::as_tuple);
            problem = failed;
        }
        co_return !problem;
    }
    /// Says nothing until the other side has gone.
    ise::task<> silence() {
        while (!ended) co_await next_line();
    }
    void hang_up() {
        std::error_code ignored;
        plain_.close(ignored);
        ended = true;
    }

    std::vector<std::string> heard;
    bool ended = false;

private:
    asio::ip::tcp::socket plain_;
    std::optional<asio::ssl::stream<asio::ip::tcp::socket&>> secure_;
    std::string held_;
};

/// A server on loopback whose words a test writes, on the test's own thread: what it talks to may not block.
class scripted_server {
public:
    using script = std::function<ise::task<>(visitor&)>;

    scripted_server(ise_test::real_parties& all, ise_test::party& on, script talk, const std::string& certificate = {})
        : all_(all), scope_(on.on, [](const std::string&, std::exception_ptr) {}), talk_(std::move(talk)),
          acceptor_(on.on.get_executor(), {asio::ip::make_address("127.0.0.1"), 0}) {
        if (!certificate.empty()) {
            tls_.emplace(asio::ssl::context::tls_server);
            tls_->use_certificate_chain_file(certificates::made().file(certificate + ".pem"));
            tls_->use_private_key_file(certificates::made().file(certificate + ".key"), asio::ssl::context::pem);
        }
        scope_.spawn("server", accept());
    }
    ~scripted_server() {
        scope_.stop();
        all_.run_until([&] { return scope_.size() == 0; });
    }

    std::string at(const std::string& scheme, const std::string& path = {}) const {
        return scheme + "://localhost:" + std::to_string(acceptor_.local_endpoint().port()) + path;
    }
    std::list<visitor> visitors; ///< all that ever came; a handshake that failed included

private:
    ise::task<> accept() {
        for (;;) {
            auto socket = co_await acceptor_.async_accept(ise::use_task);
            auto& one = visitors.emplace_back(std::move(socket), tls_ ? &*tls_ : nullptr);
            scope_.spawn("visitor", serve(one));
        }
    }
    ise::task<> serve(visitor& who) {
        bool begun = co_await who.begin();
        if (begun) co_await talk_(who);
        who.hang_up();
    }

    ise_test::real_parties& all_;
    ise::task_scope scope_;
    script talk_;
    std::optional<asio::ssl::context> tls_;
    asio::ip::tcp::acceptor acceptor_;
};

} // namespace curl_test
