// Any bytes as what a client sends to the HTTP server, on the virtual network. The input is a list of records: a
// length (one byte) and so many bytes; length 0 lets five seconds pass. Every connection ends, and what it was answered
// is HTTP.
#include <ise/http/http_server.hpp>

#include <ise/core/sleep.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/sim/world.hpp>

#include <asio/buffer.hpp>

#include <algorithm>
#include <array>
#include <cstdlib>

using namespace std::chrono_literals;
using namespace ise;

namespace {

void require(bool holds) {
    if (!holds) std::abort();
}

constexpr ise::static_file page = {"/index.html", "text/html", "<p>page</p>", "", "\"1\""};

struct party {
    party(ise::sim::world& world, const std::string& named)
        : host(world.host(named).start_process(named).make_loop("main")),
          scope(this->host->loop(), [](const auto&, auto) {}) {}
    std::unique_ptr<ise::loop_host> host;
    ise::task_scope scope;
};

struct sea {
    sea() {
        server.serve(std::span(&page, 1));
        server.get("/long", [](const ise::http_request&) {
            ise::http_response made;
            made.stream = tell;
            return made;
        });
        server.events("/events", [](std::string_view last) {
            return ise::sse_event{"a:1", "snapshot", std::string(last)};
        });
        server.otherwise([](ise::http_request asked) { return answer(std::move(asked)); });
        server.listen(at()).value();
    }
    static ise::endpoint at() { return ise::endpoint::parse("tcp://shore:80").value(); }
    static ise::task<ise::http_response> answer(ise::http_request asked) {
        require(asked.message.body.size() <= 500);
        if (asked.path == "/throw") throw std::runtime_error("thrown");
        ise::http_response made;
        made.body = asked.message.body;
        made.download_as = asked.query;
        co_return made;
    }
    static ise::task<> tell(std::shared_ptr<ise::http_stream> to) {
        for (int i = 0; i < 3; ++i) {
            auto unsent = co_await to->write("a piece");
            if (unsent) co_return;
        }
    }
    static ise::http_limits limits() {
        ise::http_limits made;
        made.max_requests = 20;
        made.message.max_body_bytes = 500;
        return made;
    }
    static ise::http_server::spawner spawner(party& of) {
        return [&of](std::string name, ise::task<> body) { of.scope.spawn(std::move(name), std::move(body)); };
    }

    ise::sim::world world{1};
    party shore{world, "shore"}, net{world, "net"};
    ise::http_server server{shore.host->loop(), ise::logger(), limits(), spawner(shore)};
};

ise::task<> talk(ise::loop& on, ise::bytes_view input, std::string& received, bool& closed) {
    auto to = sea::at();
    auto connected = co_await on.env().connect(on, std::move(to));
    require(connected.has_value());
    auto line = std::move(*connected);
    while (!input.empty()) {
        auto length = std::min<std::size_t>(static_cast<std::size_t>(input[0]), input.size() - 1);
        auto piece = input.subspan(1, length);
        input = input.subspan(1 + length);
        asio::const_buffer all(piece.data(), piece.size());
        auto moved = line->try_write(std::span(&all, 1));
        if (moved.problem) break;
        if (length == 0) co_await ise::sleep_for(on, 5s);
    }
    line->shutdown_write();
    std::array<char, 4096> buffer;
    for (;;) {
        auto got = co_await line->read_some(asio::buffer(buffer));
        received.append(buffer.data(), got.bytes);
        if (got.problem) break;
    }
    closed = true;
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static auto& here = *new sea;
    ise::bytes_view input(reinterpret_cast<const std::byte*>(data), std::min<std::size_t>(size, 20'000));
    std::string received;
    bool closed = false;
    here.net.scope.spawn("client", talk(here.net.host->loop(), input, received, closed));
    require(here.world.run_until([&] { return closed; }, 24h));
    require(here.world.run_until([&] { return here.server.statistics().open_connections == 0; }, 5min));
    require(received.empty() || received.starts_with("HTTP/1.1 "));
    return 0;
}
