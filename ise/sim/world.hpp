#pragma once
#include <ise/sim/host.hpp>
#include <ise/sim/network.hpp>
#include <ise/sim/serial_line.hpp>
#include <ise/sim/world_core.hpp>

#include <functional>
#include <map>
#include <memory>
#include <string>

namespace ise::sim {

/// Everything in one thread on a virtual clock: hosts, their processes, the network between them. The same seed
/// gives the same run, whatever the compiler. A test of components that know nothing of it:
///
///     ise::sim::world world{7};
///     auto& boat = world.host("boat").start_process("boat");       // an ise::environment each
///     auto& shore = world.host("shore").start_process("console");
///     world.net().between("boat", "shore").loss = 0.1;
///     world.at(30s, [&] { world.net().partition("boat", "shore"); });
///     world.at(90s, [&] { world.net().heal("boat", "shore"); });
///
///     auto main = shore.make_loop("main");
///     asio::co_spawn(main->loop().get_executor(), console(shore, main->loop()), asio::detached);
///     REQUIRE(world.run_until([&] { return console_has_a_fix; }, 10min));   // virtual minutes
///
/// Lifetime: the world outlives what uses its processes; what is suspended when it goes is destroyed unresumed.
/// Used from one thread. Nothing here waits in real time.
class world : public world_core {
public:
    /// The same seed gives the same run.
    explicit world(std::uint64_t seed = 1);
    ~world();

    /// The host of that name, made when it is first asked for.
    sim::host& host(const std::string& name);
    /// What lies between the hosts.
    network& net() noexcept { return network_; }
    /// A serial line into that host, made when it is first asked for: device "/dev/" + name, or name.
    sim::serial_line& serial_line(const std::string& name, sim::host& into);

    /// Runs `action` when this much time has passed since the world began.
    void at(duration since_start, std::function<void()> action);
    /// The same, counted from now.
    void after(duration from_now, std::function<void()> action);

    /// Runs until `done()` holds, looked at after every event, or `within` has passed. Whether it holds.
    /// Throws sim::stuck beyond the bounds of events (`bounds()`), and what a handler lets escape.
    bool run_until(const std::function<bool()>& done, duration within = std::chrono::hours(1));
    /// Runs for exactly this long.
    void run_for(duration time);
    /// Runs until nothing is left to do or `within` has passed. Whether nothing is left.
    bool run_until_idle(duration within = std::chrono::hours(24));

    /// How many events a run may take; to be set before it runs.
    scheduler::bounds& bounds() noexcept { return engine().limits; }

private:
    network network_{*this};
    std::map<std::string, std::unique_ptr<sim::host>> hosts_;
};

} // namespace ise::sim
