#pragma once
#include <ise/core/environment.hpp>
#include <ise/core/inproc.hpp>
#include <ise/sim/flow.hpp>
#include <ise/sim/host.hpp>
#include <ise/sim/random.hpp>
#include <ise/sim/resource.hpp>

#include <map>

namespace ise::sim {

/// A process of the virtual world: the environment of a node there. Made by `host::start_process`, lives as
/// long as the world; once it has ended it refuses everything.
class process final : public environment {
public:
    /// As it was given when it was started.
    const std::string& name() const noexcept { return name_; }
    /// Where it runs.
    sim::host& host() noexcept { return host_; }
    /// False once it has ended.
    bool running() const noexcept { return running_; }

    /// Gone at once: its loops turn no more, what was suspended on them is destroyed, then what its program
    /// made; its connections are reset. Inside one of its own handlers that handler goes on to its end first.
    void crash() { finish(ending::crash); }
    /// The same, but its connections are closed in order: as a program that leaves without much ado.
    void stop() { finish(ending::stop); }
    /// Frozen, as by SIGSTOP: its host still takes bytes for it.
    void pause();
    /// Ends the pause; what is due runs now.
    void go_on();
    /// Its program again in a process of a new identity, with the same variables; ends this one if it runs.
    process& restart();

    /// Held until the process ends.
    void keep(std::shared_ptr<void> object) { kept_.push_back(std::move(object)); }
    /// An environment variable, such as ISE_NAME_SERVER.
    void set_variable(const std::string& name, std::string value) { variables_[name] = std::move(value); }
    /// How much the monotonic clock of this process is ahead of the world's, as on a machine of its own. Before it runs anything.
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
    result<std::string> read_secret(const std::string& path, std::size_t max_bytes) override { return read_file(path, max_bytes); }
    std::vector<std::string> interface_addresses() const override { return {host_.address()}; }

    /// @cond
    // For the world's parts.
    process(sim::host& on, std::string name, unsigned life, std::uint64_t id, host::program run,
            std::map<std::string, std::string> variables);
    ~process() override;
    std::shared_ptr<flow> flow_of(const loop& on) const;
    std::error_code begin_operation();
    void attach(const std::shared_ptr<resource>& what);
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
    host::program program_;
    std::map<std::string, std::string> variables_;
    inproc_registry inproc_;
    std::vector<class sim_loop*> loops_;
    std::vector<std::weak_ptr<resource>> resources_;
    std::vector<std::shared_ptr<void>> kept_;
    duration wall_offset_{};
    duration clock_offset_{};
    bool running_ = true;
    bool paused_ = false;
};

} // namespace ise::sim
