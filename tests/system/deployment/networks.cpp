#include "networks.hpp"

#include <csignal>
#include <random>
#include <stdexcept>
#include <test_folders.hpp>
#include <unistd.h>

namespace deployment_test {
namespace {

std::string tool(const std::string& name) {
    for (const char* folder : {"/usr/sbin/", "/sbin/", "/usr/bin/", "/bin/"})
        if (::access((folder + name).c_str(), X_OK) == 0) return folder + name;
    throw std::runtime_error("there is no " + name);
}

} // namespace

networks::networks() : ip_(tool("ip")), suffix_(std::to_string(std::random_device()() % 100'000)) {
    auto done = [&](std::vector<std::string> words) {
        words.insert(words.begin(), ip_);
        auto ran = ise_test::run_program(words);
        if (ran.exit_code != 0) throw std::runtime_error("no network namespaces here: " + ran.err);
    };
    if (::geteuid() != 0) throw std::runtime_error("network namespaces take root");
    done({"netns", "add", "boat" + suffix_});
    try {
        done({"netns", "add", "shore" + suffix_});
        done({"link", "add", "b" + suffix_, "netns", "boat" + suffix_, "type", "veth", "peer", "name", "s" + suffix_,
              "netns", "shore" + suffix_});
        for (const char* host : {"boat", "shore"}) {
            auto wire = std::string(1, host[0]) + suffix_, space = host + suffix_;
            done({"-n", space, "address", "add", address(host) + "/24", "dev", wire});
            done({"-n", space, "link", "set", wire, "up"});
            done({"-n", space, "link", "set", "lo", "up"});
        }
    } catch (...) {
        for (const char* host : {"boat", "shore"}) ise_test::run_program({ip_, "netns", "delete", host + suffix_});
        throw;
    }
}

networks::~networks() {
    for (auto& one : tunnels_) {
        one->signal(SIGTERM);
        one->wait();
    }
    for (const char* host : {"boat", "shore"}) ise_test::run_program({ip_, "netns", "delete", host + suffix_});
}

std::vector<std::string> networks::inside(const std::string& host) const {
    return {ip_, "netns", "exec", host + suffix_};
}

void networks::dig(const std::string& host, int port) {
    auto words = inside(host);
    words.insert(words.end(), {tool("env"), "python3", ISE_SOURCE_DIR "/tests/system/deployment/tunnel.py",
                               address(host), std::to_string(port)});
    tunnels_.push_back(std::make_unique<ise_test::program>(words));
    if (tunnels_.back()->read_line().find("carries") == std::string::npos)
        throw std::runtime_error("no tunnel: is there python3?");
}

} // namespace deployment_test
