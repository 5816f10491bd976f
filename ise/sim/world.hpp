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

/// A virtual world in one thread on a virtual clock: hosts, their processes, and the network between them. The same
/// seed gives the same run with every compiler. A test of unmodified components:
///
///     ise::sim::world world{7};
///     auto& boat = world.host("boat").start_process("boat");       // an ise::environment each
///     auto& shore = world.host("shore").start_process("console");
///     world.net().between("boat", "shore").loss = 0.1;
///     world.at(30s, [&] { world.net().partition("boat", "shore"); });
///     world.at(90s, [&] { world.net().heal("boat", "shore"); });
///
///     auto main = shore.make_loop("main");
///     ise::async_run(main->loop().get_executor(), console(shore, main->loop()), asio::detached);
///     REQUIRE(world.run_until([&] { return console_has_a_fix; }, 10min));   // virtual minutes
///
/// Lifetime: the world must outlive all users of its processes; coroutines that are suspended when it is destroyed are
/// destroyed without being resumed. Used from one thread. No function waits in real time.
class world : public world_core {
public:
    /// The same seed gives the same run.
    explicit world(std::uint64_t seed = 1);
    ~world();

    /// The host of that name, created on first use.
    sim::host& host(const std::string& name);
    /// The network between the hosts.
    network& net() noexcept { return network_; }
    /// A serial line into that host, created on first use: device "/dev/" + name, or name.
    sim::serial_line& serial_line(const std::string& name, sim::host& into);

    /// Schedules `action` at this time since the beginning of the world.
    void at(duration since_start, std::function<void()> action);
    /// The same, counted from now.
    void after(duration from_now, std::function<void()> action);

    /// Runs until `done()` returns true, checked after every event, or `within` has passed. Returns whether it is true.
    /// Throws sim::stuck beyond the bounds of events (`bounds()`), and exceptions that escape from handlers.
    bool run_until(const std::function<bool()>& done, duration within = std::chrono::hours(1));
    /// Runs for exactly this long.
    void run_for(duration time);
    /// Runs until no event is left or `within` has passed. Returns whether no event is left.
    bool run_until_idle(duration within = std::chrono::hours(24));

    /// The maximum number of events of a run; set it before running.
    scheduler::bounds& bounds() noexcept { return engine().limits; }

    /// @cond
    const std::map<std::string, std::unique_ptr<sim::host>>& hosts() const noexcept { return hosts_; }
    /// @endcond

private:
    network network_{*this};
    std::map<std::string, std::unique_ptr<sim::host>> hosts_;
};

} // namespace ise::sim
