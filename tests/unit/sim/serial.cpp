#include "talk.hpp"

#include <asio/buffer.hpp>

#include <support/catch.hpp>

namespace serial_test {

using namespace talk;

namespace {

task<> write_text(ise::stream& to, std::string text) {
    auto failed = co_await write_all(to, text);
    (void)failed;
}

task<> gather(ise::stream& from, std::string& into, std::error_code& ended) { ended = co_await read_all(from, into); }

ise::serial_options options(unsigned baud) {
    ise::serial_options made;
    made.device = "/dev/ttyUSB0";
    made.baud = baud;
    return made;
}

struct line_and_modem {
    ise::sim::world world;
    ise::sim::process& proxy = world.host("shore").start_process("proxy");
    ise::sim::process& modem = world.host("shore").start_process("modem");
    std::unique_ptr<ise::loop_host> proxy_loop = proxy.make_loop("main"), modem_loop = modem.make_loop("main");
    ise::sim::serial_line& line = world.serial_line("ttyUSB0", world.host("shore"));
    std::unique_ptr<ise::stream> far = std::move(line.open_far_end(modem, modem_loop->loop()).value());
    std::unique_ptr<ise::stream> near;
    std::string at_far, at_near;
    std::error_code far_ended, near_ended;

    void open(unsigned baud = 9600) {
        near = std::move(proxy.open_serial(proxy_loop->loop(), options(baud)).value());
        spawn(proxy_loop->loop(), gather(*near, at_near, near_ended));
    }
    line_and_modem() { spawn(modem_loop->loop(), gather(*far, at_far, far_ended)); }
};

} // namespace

TEST_CASE("sim: a serial line carries bytes both ways at its baud rate") {
    line_and_modem it;
    it.open(9600);
    spawn(it.proxy_loop->loop(), write_text(*it.near, std::string(9600, 'x')));
    spawn(it.modem_loop->loop(), write_text(*it.far, "modem"));
    it.world.run_for(5s);
    CHECK(it.at_near == "modem");
    CHECK(it.at_far.size() > 4700);
    CHECK(it.at_far.size() < 4900);
    it.world.run_for(6s);
    CHECK(it.at_far.size() == 9600);
}

TEST_CASE("sim: a serial device is opened once, loses what nobody reads, and has no end") {
    line_and_modem it;
    spawn(it.modem_loop->loop(), write_text(*it.far, "unheard"));
    it.world.run_for(1s);
    it.open();
    CHECK(it.proxy.open_serial(it.proxy_loop->loop(), options(9600)).error().code() == ise::errc::io_failed);
    it.world.run_for(1s);
    CHECK(it.at_near == "");
    it.near.reset();
    it.world.run_for(1s);
    CHECK(it.near_ended == asio::error::operation_aborted);
    CHECK_FALSE(it.far_ended);
    it.open();
    spawn(it.modem_loop->loop(), write_text(*it.far, "heard"));
    it.world.run_for(1s);
    CHECK(it.at_near == "heard");
    auto none = options(9600);
    none.device = "/dev/ttyS0";
    CHECK(it.proxy.open_serial(it.proxy_loop->loop(), none).error().code() == ise::errc::io_failed);
}

TEST_CASE("sim: a serial device vanishes under its reader and comes back") {
    line_and_modem it;
    it.open();
    it.world.at(1s, [&] { it.line.vanish(); });
    it.world.run_for(2s);
    CHECK(it.near_ended == std::errc::no_such_device);
    std::array pieces{asio::const_buffer("x", 1)};
    CHECK(it.near->try_write(pieces).problem == std::errc::no_such_device);
    it.near.reset();
    CHECK(it.proxy.open_serial(it.proxy_loop->loop(), options(9600)).error().code() == ise::errc::io_failed);
    it.line.come_back();
    it.open();
    spawn(it.proxy_loop->loop(), write_text(*it.near, "again"));
    it.world.run_for(1s);
    CHECK(it.at_far == "again");
}

TEST_CASE("sim: a serial device is free again after its process crashed") {
    line_and_modem it;
    it.open();
    it.world.run_for(1s);
    it.proxy.crash();
    it.near.reset();
    auto& again = it.proxy.restart();
    auto loop = again.make_loop("main");
    CHECK(again.open_serial(loop->loop(), options(9600)));
}

TEST_CASE("sim: at the wrong baud rate the bytes are garbled") {
    line_and_modem it;
    it.line.far_end_baud = 9600;
    it.open(115200);
    spawn(it.proxy_loop->loop(), write_text(*it.near, "hello"));
    it.world.run_for(1s);
    CHECK(it.at_far.size() == 5);
    CHECK(it.at_far != "hello");
}

} // namespace serial_test
