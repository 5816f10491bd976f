#pragma once
// Sockets on a loop of ISE's own, or on an io_context of the program.
#include <ise/asio.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/core/sleep.hpp>
#include <ise/core/transport.hpp>

#include <asio/buffer.hpp>
#include <asio/io_context.hpp>
#include <asio/use_future.hpp>

#include <support/local_sockets.hpp>

#include <atomic>
#include <future>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <unistd.h>

namespace sockets_test {

using namespace std::chrono_literals;
using ise::task;

inline constexpr std::size_t much = 16 << 20; // more than the system holds

// A loop of either kind; what is made on it goes before it.
struct place {
    explicit place(bool own) {
        if (own) {
            host = env.make_loop("sockets");
            return;
        }
        host = env.adopt(io.get_executor(), true);
        thread = std::thread([this] { io.run(); });
    }
    ~place() {
        if (!thread.joinable()) {
            host->end();
            return;
        }
        std::promise<void> ended;
        asio::post(io, [&] {
            host->end();
            ended.set_value();
        });
        ended.get_future().wait();
        work.reset();
        io.stop();
        thread.join();
    }
    // Runs it in a turn of the loop, and returns then.
    template <class Work>
    void in_turn(Work what) {
        std::promise<void> done;
        asio::post(host->loop().get_executor(), [&] {
            ise::loop::turn in(host->loop());
            what();
            done.set_value();
        });
        done.get_future().wait();
    }
    template <class T>
    T run(task<T> what) {
        return ise::async_run(host->loop().get_executor(), std::move(what), asio::use_future).get();
    }

    ise::real_environment env;
    asio::io_context io{1};
    std::optional<asio::executor_work_guard<asio::io_context::executor_type>> work{io.get_executor()};
    std::unique_ptr<ise::loop_host> host;
    std::thread thread;
};

struct pair {
    std::unique_ptr<ise::listener> ear;
    std::unique_ptr<ise::stream> near, far;
};

inline task<pair> connected(place& at, ise::endpoint where) {
    pair made;
    made.ear = at.env.listen(at.host->loop(), where).value();
    auto line = co_await at.env.connect(at.host->loop(), made.ear->where());
    made.near = std::move(line).value();
    auto [problem, stranger] = co_await made.ear->accept();
    if (problem) throw std::system_error(problem);
    made.far = std::move(stranger);
    co_return made;
}

/// Whether it is tcp, of each kind of stream socket that the system has.
inline std::vector<bool> kinds() {
    return ise_test::has_local_sockets() ? std::vector<bool>{true, false} : std::vector<bool>{true};
}

inline ise::endpoint endpoint_of(bool tcp) {
    static int count = 0;
    auto name = "local://@ise-sockets-" + std::to_string(::getpid()) + "-" + std::to_string(count++);
    return ise::endpoint::parse(tcp ? "tcp://127.0.0.1:0" : name).value();
}

inline task<> write_all(ise::stream& to, std::size_t left) {
    const std::string piece(100'000, 'x');
    while (left > 0) {
        const asio::const_buffer rest(piece.data(), std::min(left, piece.size()));
        const auto wrote = to.try_write({&rest, 1});
        left -= wrote.bytes;
        if (wrote.problem == asio::error::would_block) {
            auto problem = co_await to.wait_writable();
            if (problem) throw std::system_error(problem);
        } else if (wrote.problem) {
            throw std::system_error(wrote.problem);
        }
    }
    to.shutdown_write();
}

// How much came before the end.
inline task<std::size_t> read_all(ise::stream& from) {
    std::string room(4096, ' ');
    std::size_t come = 0;
    for (;;) {
        auto got = co_await from.read_some(asio::buffer(room));
        come += got.bytes;
        if (got.problem == asio::error::eof) co_return come;
        if (got.problem) throw std::system_error(got.problem);
    }
}

inline task<std::error_code> read_error(ise::stream& from) {
    std::string room(16, ' ');
    auto got = co_await from.read_some(asio::buffer(room));
    co_return got.problem;
}

/// Counts what is delivered, into little room; `limit`: closes the stream once that much has come.
struct counting_reader final : ise::stream_reader {
    counting_reader(ise::stream& of, std::size_t most) : from(of), limit(most) {}

    asio::mutable_buffer room() noexcept override { return asio::buffer(memory); }
    void on_bytes(const ise::transfer& got) override {
        if (from_closed) ++calls_after_close;
        come += got.bytes;
        if (got.problem) problem = got.problem;
        if (!got.problem && come < limit) return;
        from_closed = true;
        from.close();
    }

    ise::stream& from;
    const std::size_t limit;
    std::string memory = std::string(1000, ' ');
    std::size_t come = 0;
    int calls_after_close = 0;
    std::atomic<bool> from_closed{false};
    std::error_code problem;
};

inline task<> close(ise::stream& what) {
    what.close();
    co_return;
}

inline task<> drop(pair& what) {
    what = {};
    co_return;
}

} // namespace sockets_test
