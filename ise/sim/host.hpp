#pragma once
#include <ise/core/endpoint.hpp>
#include <ise/core/result.hpp>

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace ise::sim {

class world;
class process;
class tcp_acceptor;
class datagram_end;
class serial_line;

/// A machine of the virtual world, made by `world::host(name)`: an address, ports, files, serial lines and
/// processes. Lives as long as the world.
class host {
public:
    /// What a process does: makes its components and returns what holds them, which is destroyed when the
    /// process ends, after everything that was suspended on its loops.
    using program = std::function<std::shared_ptr<void>(process&)>;

    /// Made by `world::host`.
    host(sim::world& world, std::string name, std::string address);
    ~host();

    /// As in `world::host`, and in endpoints: tcp://boat:7000.
    const std::string& name() const noexcept { return name_; }
    const std::string& address() const noexcept { return address_; } ///< "10.0.0.1"
    /// Not crashed.
    bool up() const noexcept { return up_; }
    /// How often it was started, the first time included.
    unsigned boots() const noexcept { return boots_; }

    /// A new process, whose program runs at once. The reference stays good after the process has ended.
    process& start_process(std::string name, program run = {}, std::map<std::string, std::string> variables = {});

    /// The whole host is gone at once: nobody is told, what it sent is under way still.
    void crash();
    /// Up again, with another boot identity and no processes; connections from before are reset when used.
    void boot();

    /// A file that the host's processes read.
    void write_file(const std::string& path, std::string content) { files_[path] = std::move(content); }

    /// The world that it is in.
    sim::world& world() noexcept { return world_; }

    /// @cond
    // For the world's parts.
    bool is_me(const std::string& name_or_address) const;
    result<void> claim(endpoint& at, const endpoint& wanted, const std::vector<endpoint>& taken);
    tcp_acceptor* acceptor_for(const endpoint& to) const;
    datagram_end* datagram_for(const endpoint& to) const;
    const std::map<std::string, std::string>& files() const noexcept { return files_; }
    std::vector<tcp_acceptor*> acceptors;   ///< as they came
    std::vector<datagram_end*> datagrams;
    std::map<std::string, serial_line*> serial_lines;
    std::uint16_t ephemeral_port();
    void end_processes(bool quietly);
    /// @endcond

private:
    friend class process;

    sim::world& world_;
    std::string name_, address_;
    bool up_ = true;
    unsigned boots_ = 1;
    std::uint16_t next_port_ = 49152;
    std::uint64_t next_process_id_ = 1000;
    std::map<std::string, unsigned> lives_;
    std::map<std::string, std::string> files_;
    std::vector<std::unique_ptr<process>> processes_;
};

} // namespace ise::sim
