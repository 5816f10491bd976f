// The console on a tablet: it serves its screen over VNC, and a viewer written from RFC 6143 sees it and types.
#include <support/catch.hpp>
#include <support/program.hpp>

#include <csignal>
#include <cstdint>
#include <cstring>
#include <set>
#include <stdexcept>
#include <vector>

#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

using ise_test::program;

namespace {

constexpr int patience_ms = 120'000; // the machine may be busy

sockaddr_in loopback(std::uint16_t port) {
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_port = htons(port);
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return at;
}

std::uint16_t free_port() {
    int one = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    auto at = loopback(0);
    socklen_t size = sizeof at;
    bool bound = ::bind(one, reinterpret_cast<sockaddr*>(&at), size) == 0 &&
                 ::getsockname(one, reinterpret_cast<sockaddr*>(&at), &size) == 0;
    ::close(one);
    REQUIRE(bound);
    return ntohs(at.sin_port);
}

/// A viewer of 32 bits a pixel, raw encoding.
class viewer {
public:
    explicit viewer(std::uint16_t port) : port_(port) {}
    ~viewer() {
        if (socket_ >= 0) ::close(socket_);
    }
    viewer(const viewer&) = delete;
    viewer& operator=(const viewer&) = delete;

    bool connect() {
        socket_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        auto at = loopback(port_);
        if (::connect(socket_, reinterpret_cast<sockaddr*>(&at), sizeof at) == 0) return true;
        ::close(socket_);
        socket_ = -1;
        return false;
    }
    void shake_hands() {
        auto version = read(12);
        REQUIRE(std::memcmp(version.data(), "RFB 003.00", 10) == 0);
        send({version.begin(), version.end()});
        auto security = read(4);
        REQUIRE(security[3] == 1); // none: for a tunnel, or loopback
        send({1});
        auto init = read(24);
        width = init[0] * 256u + init[1];
        height = init[2] * 256u + init[3];
        read(init[20] * 0x1000000u + init[21] * 0x10000u + init[22] * 0x100u + init[23]); // the name
        send({0, 0, 0, 0, 32, 24, 0, 1, 0, 255, 0, 255, 0, 255, 16, 8, 0, 0, 0, 0});      // little-endian xRGB
        send({2, 0, 0, 1, 0, 0, 0, 0});                                                   // raw
        pixels.assign(width * height, 0);
    }
    /// The whole screen, or what has changed.
    void look(bool all) {
        auto low = [](std::size_t of) { return static_cast<std::uint8_t>(of & 255); };
        send({3, static_cast<std::uint8_t>(all ? 0 : 1), 0, 0, 0, 0, low(width >> 8), low(width), low(height >> 8),
              low(height)});
        auto head = read(4);
        REQUIRE(head[0] == 0);
        for (unsigned left = head[2] * 256u + head[3]; left > 0; --left) {
            auto r = read(12);
            std::size_t x = r[0] * 256u + r[1], y = r[2] * 256u + r[3], w = r[4] * 256u + r[5], h = r[6] * 256u + r[7];
            REQUIRE((r[8] | r[9] | r[10] | r[11]) == 0);
            REQUIRE((x + w <= width && y + h <= height));
            auto content = read(w * h * 4);
            for (std::size_t line = 0; line < h; ++line)
                std::memcpy(&pixels[(y + line) * width + x], &content[line * w * 4], w * 4);
        }
    }
    void key(std::uint32_t symbol, bool down) {
        auto byte = [&](int at) { return static_cast<std::uint8_t>(symbol >> at); };
        send({4, static_cast<std::uint8_t>(down), 0, 0, byte(24), byte(16), byte(8), byte(0)});
    }
    double brightness() const {
        double sum = 0;
        for (auto p : pixels) sum += (p & 255) + (p >> 8 & 255) + (p >> 16 & 255);
        return sum / 3 / static_cast<double>(pixels.size());
    }
    std::size_t width = 0, height = 0;
    std::vector<std::uint32_t> pixels;

private:
    std::vector<std::uint8_t> read(std::size_t bytes) {
        std::vector<std::uint8_t> got(bytes);
        for (std::size_t have = 0; have < bytes;) {
            pollfd one{socket_, POLLIN, 0};
            if (::poll(&one, 1, patience_ms) != 1) throw std::runtime_error("the console says nothing");
            auto some = ::recv(socket_, got.data() + have, bytes - have, 0);
            if (some <= 0) throw std::runtime_error("the console has hung up");
            have += static_cast<std::size_t>(some);
        }
        return got;
    }
    void send(const std::vector<std::uint8_t>& bytes) {
        REQUIRE(::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size()));
    }

    std::uint16_t port_;
    int socket_ = -1;
};

} // namespace

TEST_CASE("console program: a tablet sees it over VNC, and its keys work, while the name server never answers") {
    // Somebody who takes connections and says nothing: the windows must not wait for him.
    int silent = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    auto at = loopback(0);
    socklen_t size = sizeof at;
    REQUIRE(::bind(silent, reinterpret_cast<sockaddr*>(&at), size) == 0);
    REQUIRE(::listen(silent, 8) == 0);
    REQUIRE(::getsockname(silent, reinterpret_cast<sockaddr*>(&at), &size) == 0);
    auto names = "tcp://127.0.0.1:" + std::to_string(ntohs(at.sin_port));
    auto port = free_port();
    ise_test::start_options options;
    options.variables = {{"QT_QPA_PLATFORM", "vnc:size=1280x800:port=" + std::to_string(port)}};
    {
        program console({"atirma_console", "--name-server", names, "--settings", "none", "--size", "1280x800"},
                        options);
        viewer tablet(port);
        for (int waited = 0; !tablet.connect(); waited += 100) { // it takes a moment to begin
            REQUIRE(waited < patience_ms);
            ::usleep(100'000);
        }
        tablet.shake_hands();
        CHECK(tablet.width == 1280);
        CHECK(tablet.height == 800);
        tablet.look(true);
        auto bright = [&](auto wanted) { // until the window has painted itself so
            for (int waited = 0; !wanted(tablet.brightness()); waited += 100) {
                REQUIRE(waited < patience_ms);
                ::usleep(100'000);
                tablet.look(true);
            }
        };
        bright([](double now) { return now > 150; }); // the colours of the day
        CHECK(std::set<std::uint32_t>(tablet.pixels.begin(), tablet.pixels.end()).size() > 50);
        constexpr std::uint32_t control = 0xffe3, n = 'n';
        tablet.key(control, true);
        tablet.key(n, true);
        tablet.key(n, false);
        tablet.key(control, false);
        bright([](double now) { return now < 80; }); // and of the night
        console.signal(SIGTERM);
        CHECK(console.wait().exit_code == 0);
    }
    ::close(silent);
}
