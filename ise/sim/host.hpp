#pragma once
#include <ise/core/environment.hpp>
#include <ise/core/inproc.hpp>
#include <ise/sim/random.hpp>
#include <ise/sim/socket_owner.hpp>

#include <asio/any_io_executor.hpp>

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace ise::sim {

class host;

/// A process of the virtual world: the environment of a node there. Made by `host::start_process`, lives as
/// long as the world; after its end all operations fail.
class process final : public environment, public socket_owner {
public:
    /// The program of a process: creates its components and returns their owner, which is destroyed when the
    /// process ends, after the coroutines on its loops.
    using program = std::function<std::shared_ptr<void>(process&)>;

    /// The name passed at its start.
    const std::string& name() const noexcept { return name_; }
    /// Its host.
    sim::host& host() noexcept { return host_; }

    /// Kills it: its loops stop, suspended coroutines are destroyed, then the objects of its program; its
    /// connections are reset. If called inside one of its own handlers, that handler first runs to its end.
    void crash() { finish(ending::crash); }
    /// The same, but its connections are closed in an orderly way, as by exit().
    void stop() { finish(ending::stop); }
    /// Stops it as by SIGSTOP: its host still receives bytes for it.
    void pause();
    /// Ends the pause; overdue events run now.
    void go_on();
    /// Runs its program again in a new process with the same variables; kills this one if it runs.
    process& restart();

    /// Held until the process ends.
    void keep(std::shared_ptr<void> object) { kept_.push_back(std::move(object)); }
    /// An environment variable, such as ISE_NAME_SERVER.
    void set_variable(const std::string& name, std::string value) { variables_[name] = std::move(value); }
    /// How much the monotonic clock of this process is ahead of the world's, as on a machine of its own. Before it runs
    /// anything.
    void set_clock_offset(duration ahead) noexcept { clock_offset_ = ahead; }
    /// How much the wall clock of this process is ahead of the world's.
    void set_wall_offset(duration ahead) noexcept { wall_offset_ = ahead; }

    // environment
    time_point now() const override;
    wall_time wall() const override;
    std::uint64_t random() override { return random_.next(); }
    const process_identity& identity() const override { return identity_; }
    std::optional<std::string> variable(const std::string& name) const override;
    std::unique_ptr<loop_host> make_loop(const std::string& name) override;
    /// `executor` must be one of this world (`world::context()`, or a loop's); everything runs on one thread,
    /// so the loop has a flow of its own there. Throws std::logic_error for another.
    std::unique_ptr<loop_host> adopt(asio::any_io_executor executor, bool one_thread) override;
    /// Runs `job` here and now; a dead process runs nothing.
    void offload(std::function<void()> job) override {
        if (running_) job();
    }
    bool is_virtual() const noexcept override { return true; }
    task<result<std::unique_ptr<stream>>> connect(loop& on, endpoint to) override;
    result<std::unique_ptr<listener>> listen(loop& on, const endpoint& at) override;
    result<std::unique_ptr<datagram_socket>> open_datagram(loop& on, const endpoint& at) override;
    result<std::unique_ptr<stream>> open_serial(loop& on, const serial_options& options) override;
    /// A serial line into this host under the last part of `link` ("ttyA" of "/run/demo/ttyA").
    result<pseudo_terminal> open_pseudo_terminal(loop& on, const std::string& link) override;
    result<std::string> read_file(const std::string& path, std::size_t max_bytes) override;
    result<std::string> read_secret(const std::string& path, std::size_t max_bytes) override {
        return read_file(path, max_bytes);
    }
    std::vector<std::string> interface_addresses() const override { return {here().address()}; }

    /// @cond
    // For the world's parts.
    process(sim::host& on, network& net, std::string name, unsigned life, std::uint64_t id, program run,
            std::map<std::string, std::string> variables);
    ~process() override;
    std::shared_ptr<flow> flow_of(const loop& on) const override;
    void finish(ending how);
    void start();
    /// @endcond

private:
    friend class sim_loop;
    std::unique_ptr<loop_host> new_loop(std::string name);
    result<void> usable(const char* what) const;
    void tear_down();

    sim::host& host_;
    std::string name_;
    process_identity identity_;
    generator random_;
    program program_;
    std::map<std::string, std::string> variables_;
    inproc_registry inproc_;
    std::vector<class sim_loop*> loops_;
    std::vector<std::shared_ptr<void>> kept_;
    duration wall_offset_{};
    duration clock_offset_{};
    bool paused_ = false;
};

/// A machine of the virtual world with its processes, made by `world::host(name)`. Lives as long as the world.
class host final : public machine {
public:
    /// See `process::program`.
    using program = process::program;

    /// Made by `world::host`.
    host(world_core& world, network& net, std::string name, std::string address);
    ~host();

    /// Starts a process, whose program runs at once. The reference stays valid after the process has ended.
    process& start_process(std::string name, program run = {}, std::map<std::string, std::string> variables = {});

    /// Crashes the whole host without notifying its peers; packets that it has sent stay in transit.
    void crash();
    /// Boots it again, with a new boot identity and without processes; old connections are reset when used.
    void boot();

    /// Its world.
    world_core& world() noexcept { return world_; }

    /// @cond
    // For the world's parts.
    void end_processes(bool quietly);
    /// @endcond

private:
    world_core& world_;
    network& net_;
    std::uint64_t next_process_id_ = 1000;
    std::map<std::string, unsigned> lives_;
    std::vector<std::unique_ptr<process>> processes_;
};

} // namespace ise::sim
