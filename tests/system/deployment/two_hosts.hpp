// Two instantiation servers, "boat" and "shore", and a name server: all of them processes that a test may kill.
#pragma once
#include "networks.hpp"

#include <support/catch.hpp>
#include <support/program.hpp>

#include <nlohmann/json.hpp>

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace deployment_test {

using nlohmann::json;

class two_hosts {
public:
    /// Both on this machine's own network, or each on its own: then the command line runs on "shore", the name server
    /// on "boat", and the instantiation servers, which listen on loopback only, are reached through tunnels.
    explicit two_hosts(const networks* apart = nullptr);
    ~two_hosts();
    two_hosts(const two_hosts&) = delete;
    two_hosts& operator=(const two_hosts&) = delete;

    void install(const std::string& program);
    /// Starts the instantiation server of that name; the one before must have ended.
    void open(const std::string& host);
    /// kill -9 of it, and of the name server.
    void crash(const std::string& host);
    void crash_name_server();
    /// Starts the name server where it was.
    void start_name_server();

    ise_test::ran ise(std::vector<std::string> words);
    /// What a command that must succeed prints.
    std::string done(std::vector<std::string> words);
    /// What it tells with --json.
    json json_of(std::vector<std::string> words);
    /// `done` of a command about a deployment file.
    std::string up(const std::string& file, std::vector<std::string> more = {});

    /// Writes a deployment file: its path.
    std::string file(const std::string& name, const std::string& text);
    /// What instantiation servers tell of a path: the instance that runs, or else one that is over.
    json state(const std::string& path);
    bool is_ready(const std::string& path);
    /// Files that were left in the folders of the servers, but for their own state and the databases of components.
    std::vector<std::string> left_behind() const;
    const std::filesystem::path& folder() const { return folder_; }
    /// The port at which the instantiation server of a host listens, where they are apart.
    static int port_of(const std::string& host) { return host == "boat" ? 7501 : 7502; }
    const std::string& name_server() const { return name_server_; }

private:
    std::vector<std::string> on(const std::string& host, std::vector<std::string> words) const;

    const networks* apart_;
    std::filesystem::path folder_;
    std::string name_server_ = "tcp://127.0.0.1:0";
    std::unique_ptr<ise_test::program> names_;
    std::map<std::string, std::unique_ptr<ise_test::program>> servers_;
};

} // namespace deployment_test
