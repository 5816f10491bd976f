// Two network namespaces, joined by a pair of virtual interfaces, as two hosts on a wire would be.
#pragma once
#include <support/program.hpp>

#include <memory>
#include <string>
#include <vector>

namespace deployment_test {

/// "boat" is 10.77.0.1, "shore" 10.77.0.2; both are gone with this. Takes root.
class networks {
public:
    /// Throws std::runtime_error with what is missing.
    networks();
    ~networks();
    networks(const networks&) = delete;
    networks& operator=(const networks&) = delete;

    /// What goes before a command to run it on that host.
    std::vector<std::string> inside(const std::string& host) const;
    static std::string address(const std::string& host) { return host == "boat" ? "10.77.0.1" : "10.77.0.2"; }
    /// Makes what listens at that port of the host's loopback interface reachable from the other.
    void dig(const std::string& host, int port);

private:
    std::string ip_, suffix_;
    std::vector<std::unique_ptr<ise_test::program>> tunnels_;
};

} // namespace deployment_test
