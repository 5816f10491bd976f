#pragma once
#include <ise/core/real/environment.hpp>
#include <ise/sim/world.hpp>
#include <support/authority.hpp>
#include <support/party.hpp>

#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>

#include <fmt/format.h>

#include <unistd.h>

/// Two components over each transport; the tests know no more than this.
namespace conformance {

using namespace ise_test;

/// Credentials that are good for all of them, made once.
inline const std::filesystem::path& certificates() {
    static authority trusted;
    static auto folder = trusted.issue("host");
    return folder;
}

/// What differs between transports, as the table of FORMAT.md has it.
struct as_streams {
    static constexpr int calls_beside_big = 2; ///< that are answered, at least, while a big message is on its way
    static constexpr bool lossless = true;             ///< may be asked for
    static constexpr bool calls_are_repeated = false;  ///< on the next session
    static constexpr std::size_t big_message = 8 << 20;
    static constexpr std::uint64_t message_limit = 16 << 20; // as these components say
};
struct as_datagrams {
    static constexpr int calls_beside_big = 2;
    static constexpr bool lossless = false;
    static constexpr bool calls_are_repeated = true;
    static constexpr std::size_t big_message = (1 << 20) - 1024;
    static constexpr std::uint64_t message_limit = 1 << 20;  // of the transport
};

class real_world {
public:
    static constexpr std::uint64_t heartbeat_ns = 300'000'000; // a test waits for three
    real_world() : work_(asio::make_work_guard(context_)) {}
    std::unique_ptr<ise::loop_host> loop() { return env_.adopt(context_.get_executor(), true); }
    ise::security_options credentials() const { return {}; }
    ise::environment& env_a() { return env_; }
    ise::environment& env_b() { return env_; }
    bool run_until(const std::function<bool()>& done) {
        while (!done()) context_.run_one();
        return true;
    }
    std::unique_ptr<ise::loop_host> loop_a() { return loop(); }
    std::unique_ptr<ise::loop_host> loop_b() { return loop(); }

private:
    ise::real_environment env_;
    asio::io_context context_;
    asio::executor_work_guard<asio::io_context::executor_type> work_;
};

struct tcp : real_world, as_streams {
    std::string where() const { return "tcp://127.0.0.1:0"; }
};
struct tcp6 : real_world, as_streams {
    std::string where() const { return "tcp://[::1]:0"; }
};
struct tls : real_world, as_streams {
    std::string where() const { return "tls://127.0.0.1:0"; }
    ise::security_options credentials() const {
        ise::security_options made;
        made.tls_folder = certificates().string();
        return made;
    }
};
struct local : real_world, as_streams {
    std::string where() const { return fmt::format("local://@ise-conformance-{}", ::getpid()); }
};
struct in_process : real_world, as_streams {
    static constexpr int calls_beside_big = 1; // it is handed over at once, as it is
    std::string where() const { return "inproc://conformance"; }
};
struct udp : real_world, as_datagrams {
    std::string where() const { return "udp://127.0.0.1:0"; }
};
struct udp6 : real_world, as_datagrams {
    std::string where() const { return "udp://[::1]:0"; }
};
struct virtual_world {
    static constexpr std::uint64_t heartbeat_ns = 5'000'000'000; // lost packets are late ones there
    ise::sim::world world{11};
    ise::sim::process& a = world.host("boat").start_process("boat");
    ise::sim::process& b = world.host("shore").start_process("shore");
    virtual_world() {
        world.net().between("boat", "shore").latency = std::chrono::milliseconds(30);
        world.net().between("boat", "shore").loss = 0.05;
    }
    ise::security_options credentials() const { return {}; }
    ise::environment& env_a() { return a; }
    ise::environment& env_b() { return b; }
    std::unique_ptr<ise::loop_host> loop_a() { return a.make_loop("main"); }
    std::unique_ptr<ise::loop_host> loop_b() { return b.make_loop("main"); }
    bool run_until(const std::function<bool()>& done) { return world.run_until(done); }
};
struct virtual_tcp : virtual_world, as_streams {
    std::string where() const { return "tcp://10.0.0.1:7400"; }
};
struct virtual_tls : virtual_world, as_streams {
    virtual_tls() {
        for (const char* host : {"boat", "shore"})
            for (const char* file : {"ca.pem", "certificate.pem", "key.pem"}) world.host(host).write_file(std::string("tls/") + file, read_all(certificates() / file));
    }
    std::string where() const { return "tls://10.0.0.1:7400"; }
    ise::security_options credentials() const {
        ise::security_options made;
        made.tls_folder = "tls";
        return made;
    }
};
struct virtual_udp : virtual_world, as_datagrams {
    virtual_udp() {
        world.net().between("boat", "shore").duplicate = 0.05;
        world.net().between("boat", "shore").reorder = 0.05;
    }
    std::string where() const { return "udp://10.0.0.1:7400"; }
};

/// A provider "boat" that listens, and a requester "shore".
template <class World>
struct pair {
    World world;
    party boat{world.env_a(), world.loop_a(), "boat", quick(), ise::security::load(world.env_a(), world.credentials()).value()};
    party shore{world.env_b(), world.loop_b(), "shore", quick(), ise::security::load(world.env_b(), world.credentials()).value()};
    ise::endpoint where;
    ise::remote there;

    void open() {
        where = boat.listen(world.where());
        there = shore.at(where);
    }
    ~pair() {
        for (auto* one : {&boat, &shore}) {
            one->services->stop(std::chrono::milliseconds(100));
            one->scope.stop();
        }
        world.run_until([&] { return boat.scope.size() == 0 && shore.scope.size() == 0; });
        CHECK(boat.escaped.empty());
        CHECK(shore.escaped.empty());
    }
    bool run_until(const std::function<bool()>& done) { return world.run_until(done); }
    template <class T>
    T run(ise::task<T> body) {
        auto state = start(shore.on, std::move(body));
        REQUIRE(run_until([&] { return state->done; }));
        if constexpr (std::is_void_v<T>) {
            state->get();
        } else {
            return std::move(state->get());
        }
    }
    /// The session as the requester has it, cut without a word.
    void cut() {
        auto session = shore.services->sessions().begin()->second;
        session->wire().close(ise::failure(ise::errc::peer_lost, "cut"));
    }

private:
    static ise::service_options quick() {
        ise::service_options made;
        made.accepts.heartbeat_ns = World::heartbeat_ns;
        made.accepts.max_message_bytes = as_streams::message_limit;
        made.first_back_off = std::chrono::milliseconds(5);
        made.longest_back_off = std::chrono::milliseconds(50);
        return made;
    }
};

} // namespace conformance
