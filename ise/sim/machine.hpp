#pragma once
#include <ise/core/endpoint.hpp>
#include <ise/core/result.hpp>

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace ise::sim {

class tcp_acceptor;
class datagram_end;
class serial_line;

/// A host as the network and its sockets know it: an address, ports, files and serial lines.
class machine {
public:
    /// Made as a `host`.
    machine(std::string name, std::string address) : name_(std::move(name)), address_(std::move(address)) {}
    machine(const machine&) = delete;
    machine& operator=(const machine&) = delete;

    /// Its name, also used in endpoints: tcp://boat:7000.
    const std::string& name() const noexcept { return name_; }
    const std::string& address() const noexcept { return address_; } ///< "10.0.0.1"
    /// Whether it is running.
    bool up() const noexcept { return up_; }
    /// The number of its starts, including the first.
    unsigned boots() const noexcept { return boots_; }

    /// Sets a file that the host's processes can read.
    void write_file(const std::string& path, std::string content) { files_[path] = std::move(content); }

    /// @cond
    // For the world's parts.
    bool is_me(const std::string& name_or_address) const;
    result<void> claim(endpoint& at, const endpoint& wanted, const std::vector<endpoint>& taken);
    /// Whether something bound at `at` hears what is sent to `to`.
    bool hears(const endpoint& at, const endpoint& to) const;
    const std::map<std::string, std::string>& files() const noexcept { return files_; }
    std::vector<tcp_acceptor*> acceptors; ///< as they came
    std::vector<datagram_end*> datagrams;
    std::map<std::string, std::shared_ptr<serial_line>> serial_lines; ///< each by its name and by "/dev/" + name
    std::uint16_t ephemeral_port();

protected:
    ~machine() = default;

    bool up_ = true;
    unsigned boots_ = 1;
    /// @endcond

private:
    std::string name_, address_;
    std::uint16_t next_port_ = 49152;
    std::map<std::string, std::string> files_;
};

} // namespace ise::sim
