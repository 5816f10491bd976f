#include "sockets.hpp"

#include <support/catch.hpp>

#include <asio/buffer.hpp>
#include <asio/ip/tcp.hpp>

namespace sockets_test {

TEST_CASE("sockets: a peer that resets the connection after each byte ends reading and writing") {
    for (bool own : {true, false}) {
        place at(own);
        auto ear = at.env.listen(at.host->loop(), ise::endpoint::parse("tcp://127.0.0.1:0").value()).value();
        auto accept = [](ise::listener& from) -> task<std::unique_ptr<ise::stream>> {
            auto taken = co_await from.accept();
            co_return std::move(taken.second);
        };
        auto until_an_error = [](ise::stream& from) -> task<std::pair<std::size_t, std::error_code>> {
            std::pair<std::size_t, std::error_code> out;
            std::string room(3, ' ');
            while (!out.second) {
                auto got = co_await from.read_some(asio::buffer(room));
                out.first += got.bytes;
                out.second = got.problem;
            }
            co_return out;
        };
        auto write_until_an_error = [](ise::stream& to) -> task<std::error_code> {
            const std::string piece(1000, 'x');
            const asio::const_buffer all(piece.data(), piece.size());
            for (;;) {
                auto wrote = to.try_write({&all, 1});
                if (wrote.problem && wrote.problem != asio::error::would_block) co_return wrote.problem;
                auto problem = co_await to.wait_writable();
                if (problem) co_return problem;
            }
        };
        auto free = [](std::unique_ptr<ise::stream> what) -> task<> {
            what.reset();
            co_return;
        };
        for (std::size_t count = 0; count < 40; ++count) {
            INFO(own << count);
            asio::io_context elsewhere;
            asio::ip::tcp::socket peer(elsewhere);
            peer.connect({asio::ip::make_address("127.0.0.1"), static_cast<std::uint16_t>(ear->where().port)});
            auto mine = at.run(accept(*ear));
            // Half of them are read while it comes, half of them later.
            std::future<std::pair<std::size_t, std::error_code>> read;
            auto begin = [&] {
                read = ise::async_run(at.host->loop().get_executor(), until_an_error(*mine), asio::use_future);
            };
            if (count % 2 == 0) begin();
            for (std::size_t n = 0; n < count; ++n) peer.send(asio::buffer("x", 1));
            peer.set_option(asio::socket_base::linger(true, 0));
            peer.close();
            if (count % 2 == 1) begin();
            auto [bytes, problem] = read.get();
            CHECK(bytes <= count);
            CHECK(problem == asio::error::connection_reset);
            const auto wrote = at.run(write_until_an_error(*mine));
            CHECK((wrote == asio::error::broken_pipe || wrote == asio::error::connection_reset));
            at.run(free(std::move(mine)));
        }
        auto no_ear = [](std::unique_ptr<ise::listener> what) -> task<> {
            what.reset();
            co_return;
        };
        at.run(no_ear(std::move(ear)));
    }
}

} // namespace sockets_test
