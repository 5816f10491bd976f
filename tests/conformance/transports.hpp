#pragma once
#include <ise/core/real/environment.hpp>
#include <ise/sim/world.hpp>
#include <ise/transport/security.hpp>

#include <support/relay.hpp>

#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>

#include <functional>
#include <string>
#include <vector>

/// Two components over each transport; the tests know no more than this.
namespace conformance {

using ise_test::relay;

/// What differs between transports, as the table of FORMAT.md has it.
struct column {
    std::string at;       ///< where the provider listens
    std::string relay_at; ///< and the relay before it; none within a process
    bool datagrams = false;
    bool lossless = true;            ///< may be asked for
    bool calls_are_repeated = false; ///< on the next session
    int calls_beside_big = 2;        ///< that are answered, at least, while a big message is on its way
    std::size_t big_message = 8 << 20;
    std::uint64_t message_limit = 16 << 20;   ///< as these components say
    std::uint64_t heartbeat_ns = 300'000'000; ///< a test waits for three
};
column of_streams(std::string at, std::string relay_at);
column of_datagrams(std::string at, std::string relay_at);

/// Where the two live, and what they go over.
class world {
public:
    explicit world(column what) : has(std::move(what)) {}
    virtual ~world() = default;

    column has;
    ise::security_options credentials;

    virtual ise::environment& boat() = 0;
    virtual ise::environment& shore() = 0;
    /// Beside the boat: what lies between the hosts lies before it.
    virtual ise::environment& router() = 0;
    virtual std::unique_ptr<ise::loop_host> loop(ise::environment& of) = 0;
    /// Whether it came to that.
    virtual bool run_until(const std::function<bool()>& done) = 0;
    virtual bool is_virtual() const = 0;
    /// Between the hosts, while `apart`, nothing passes and nobody is told.
    virtual void part(relay& between, bool apart) { apart ? between.hold() : between.go_on(); }
};

/// The machine's own sockets, on one thread, the test's.
class real_world : public world {
public:
    explicit real_world(column what) : world(std::move(what)), work_(asio::make_work_guard(context_)) {}
    ise::environment& boat() override { return env_; }
    ise::environment& shore() override { return env_; }
    ise::environment& router() override { return env_; }
    std::unique_ptr<ise::loop_host> loop(ise::environment&) override {
        return env_.adopt(context_.get_executor(), true);
    }
    /// Gives up after two minutes, which no test takes: one that fails should not hang.
    bool run_until(const std::function<bool()>& done) override;
    bool is_virtual() const override { return false; }

private:
    ise::real_environment env_;
    asio::io_context context_;
    asio::executor_work_guard<asio::io_context::executor_type> work_;
};

struct tcp : real_world {
    tcp();
};
struct tcp6 : real_world {
    tcp6();
};
struct tls : real_world {
    tls();
};
struct local : real_world {
    local();
};
/// With a shared key, which seals them.
struct sealed_tcp : real_world {
    sealed_tcp();
};
struct sealed_local : real_world {
    sealed_local();
};
/// Through shared memory, and over its socket where the two cannot share it.
struct shm : real_world {
    shm();
};
struct sealed_shm : real_world {
    sealed_shm();
};
struct in_process : real_world {
    in_process();
};
struct udp : real_world {
    udp();
};
struct udp6 : real_world {
    udp6();
};
struct sealed_udp : real_world {
    sealed_udp();
};
/// With certificates.
struct certified_udp : real_world {
    certified_udp();
};

/// The virtual network between the two hosts.
struct weather {
    std::string name = "usual";
    std::uint64_t seed = 11;
    double loss = 0.05;
    double disorder = 0.05;             ///< of datagrams: that come twice, or late
    std::uint64_t bytes_per_second = 0; ///< 0: unlimited
};
std::vector<weather> all_weathers();

class virtual_world : public world {
public:
    virtual_world(column what, const weather& now);
    ise::environment& boat() override { return boat_; }
    ise::environment& shore() override { return shore_; }
    ise::environment& router() override { return router_; }
    std::unique_ptr<ise::loop_host> loop(ise::environment& of) override { return of.make_loop("main"); }
    bool run_until(const std::function<bool()>& done) override { return sea_.run_until(done); }
    bool is_virtual() const override { return true; }
    void part(relay&, bool apart) override {
        apart ? sea_.net().partition("boat", "shore") : sea_.net().heal("boat", "shore");
    }

protected:
    void give_certificates();

    ise::sim::world sea_;

private:
    ise::sim::process& boat_ = sea_.host("boat").start_process("boat");
    ise::sim::process& shore_ = sea_.host("shore").start_process("shore");
    ise::sim::process& router_ = sea_.host("boat").start_process("router");
};

struct virtual_tcp : virtual_world {
    explicit virtual_tcp(const weather& now = {});
};
struct virtual_tls : virtual_world {
    explicit virtual_tls(const weather& now = {});
};
struct virtual_udp : virtual_world {
    explicit virtual_udp(const weather& now = {});
};
struct virtual_sealed_udp : virtual_world {
    explicit virtual_sealed_udp(const weather& now = {});
};
struct virtual_certified_udp : virtual_world {
    explicit virtual_certified_udp(const weather& now = {});
};

} // namespace conformance
