// Each of the boat's links is switched off and on by a person's commands, while the page goes on and says where the fix
// came from.
#include "deployment.hpp"

#include <asio/buffer.hpp>
#include <asio/connect.hpp>
#include <asio/io_context.hpp>
#include <asio/ip/tcp.hpp>
#include <asio/read_until.hpp>
#include <asio/steady_timer.hpp>
#include <asio/write.hpp>

#include <optional>
#include <regex>

using ise_test::Contains;

namespace {

constexpr auto patience = std::chrono::minutes(3); // only what is broken takes that long

/// A visitor of the page: reads the event stream, line by line.
class visitor {
public:
    explicit visitor(const std::string& url) {
        std::smatch part;
        static const std::regex form(R"(http://([^:/]+):(\d+).*)");
        REQUIRE(std::regex_match(url, part, form));
        socket_.connect({asio::ip::make_address(part[1].str()), static_cast<std::uint16_t>(std::stoi(part[2]))});
        asio::write(socket_, asio::buffer(std::string("GET /events HTTP/1.1\r\nHost: page\r\n\r\n")));
    }

    /// Over which link the position came that the page is told next.
    std::string next_source() {
        static const std::regex position(R"re("position":\{[^}]*"source":"(\w+)")re");
        for (;;) {
            auto line = next_line();
            std::smatch found;
            if (std::regex_search(line, found, position)) return found[1];
        }
    }
    /// Until the page has told that many positions in a row that came over this link, and none else.
    bool sees_only(const std::string& link, int times) {
        auto limit = std::chrono::steady_clock::now() + patience;
        for (int seen = 0; seen < times;) {
            if (std::chrono::steady_clock::now() > limit) return false;
            seen = next_source() == link ? seen + 1 : 0;
        }
        return true;
    }
    /// Until the page has told that something came over this link since.
    bool hears(const std::string& link) {
        const std::regex heard(R"re("heard":\{[^}]*")re" + link + R"re(":(\d+))re");
        auto limit = std::chrono::steady_clock::now() + patience;
        for (std::optional<long long> before; std::chrono::steady_clock::now() <= limit;) {
            auto line = next_line();
            std::smatch found;
            if (!std::regex_search(line, found, heard)) continue;
            auto at = std::stoll(found[1]);
            if (before && at > *before) return true;
            if (!before) before = at;
        }
        return false;
    }

private:
    std::string next_line() {
        std::optional<std::error_code> outcome;
        std::size_t size = 0;
        auto result = [&](std::error_code problem, std::size_t got) {
            outcome = problem;
            size = got;
        };
        asio::async_read_until(socket_, asio::dynamic_buffer(text_), '\n', result);
        loop_.restart();
        loop_.run_for(patience);
        if (!outcome) { // the stream has fallen silent
            socket_.close();
            loop_.run();
        }
        INFO("the page's stream ended or fell silent");
        REQUIRE_FALSE(*outcome);
        auto line = text_.substr(0, size);
        text_.erase(0, size);
        return line;
    }

    asio::io_context loop_;
    asio::ip::tcp::socket socket_{loop_};
    std::string text_;
};

std::string endpoint_in(const std::string& line, const std::string& kind) {
    auto from = line.find(kind + "://");
    INFO(line);
    REQUIRE(from != std::string::npos);
    return line.substr(from, line.find(' ', from) - from);
}

/// A boat with all its links, their proxies, one communication node and the page.
class three_links : public deployment {
public:
    three_links() {
        run_atirma("air", "xbee-link", {"--shore-port", file("shore"), "--boat-port", file("boat")});
        auto said = run_atirma("gprs", "gprs-proxy", {"--boat-listen", "tcp://127.0.0.1:0"}, "tcp://");
        auto gprs = endpoint_in(said, "tcp");
        said =
            run_atirma("carrier", "gprs-link", {"--boat-listen", "tcp://127.0.0.1:0", "--proxy-tcp", gprs}, "tcp://");
        auto carrier = endpoint_in(said, "tcp");
        asio::io_context any;
        asio::ip::tcp::acceptor free(any, {asio::ip::make_address("127.0.0.1"), 0});
        auto hook = free.local_endpoint().port();
        free.close();
        run_atirma("gateway", "iridium-gateway",
                   {"--listen-http", "", "--post-to", fmt::format("http://127.0.0.1:{}/rockblock/mo", hook)});
        run_atirma("sky", "iridium-modem", {"--port", file("iridium"), "--min-session", "0", "--max-session", "1"});
        run_atirma("iridium", "iridium-proxy",
                   {"--imei", "300234010753370", "--database", file("iridium.db"), "--webhook",
                    fmt::format("tcp://127.0.0.1:{}", hook), "--send-by", "none", "--store", "atirma/communication"});
        run_atirma("boat", "boat-simulator",
                   {"--serial", file("boat"), "--gprs", carrier, "--gprs-period", "2", "--iridium-serial",
                    file("iridium"), "--iridium-period", "5"});
        run_atirma("xbee", "xbee-proxy", {"--serial", file("shore")});
        run_atirma("node", "communication-node", {"--file", file("node.db")});
        page_ = run_atirma("page", "web-server", {"--telemetry", "atirma/communication", "--port", "0"}, "http://");
        page_ = page_.substr(page_.find("http://"));
    }
    std::string page() const { return page_; }
    void check_reply(const std::string& whom, const std::string& service, const std::string& request,
                     const std::string& expected) {
        auto answer = call(whom, service, request);
        INFO(answer.err);
        CHECK(answer.exit_code == 0);
        CHECK_THAT(answer.out, Contains(expected));
    }
    void radio(bool up) {
        check_reply("atirma/air", "air_control", fmt::format(R"({{"up":{}}})", up), fmt::format(R"("up":{})", up));
    }
    void gprs(bool up) {
        check_reply("atirma/carrier", "carrier_control", fmt::format(R"({{"up":{}}})", up),
                    fmt::format(R"("up":{})", up));
    }
    void sky(bool free) {
        check_reply("atirma/iridium/modem", "iridium_sky_control", fmt::format(R"({{"free":{}}})", free),
                    fmt::format(R"("free":{})", free));
    }

private:
    std::string page_;
};

} // namespace

TEST_CASE("processes: each link is switched off and on, and the page goes on and says where its fix came from") {
    three_links it;
    visitor page(it.page());
    CHECK(page.sees_only("xbee", 4)); // the fastest of them, as long as it is there
    for (const char* link : {"gprs", "iridium"}) CHECK(page.hears(link));

    it.radio(false);
    it.sky(false);
    CHECK(page.sees_only("gprs", 4));
    CHECK_THAT(it.next_of("atirma/communication", "communication_state"),
               Contains(R"("fix":{"link":"gprs")") || Contains(R"("link":"gprs","measured_at")"));

    it.gprs(false);
    it.sky(true);
    CHECK(page.sees_only("iridium", 3));

    it.sky(false);
    it.radio(true);
    CHECK(page.sees_only("xbee", 4));

    it.gprs(true);
    it.sky(true);
    for (const char* link : {"xbee", "gprs", "iridium"}) CHECK(page.hears(link));
    for (const char* name : {"page", "node", "boat"}) CHECK(it.end(name).exit_code == 0);
}
