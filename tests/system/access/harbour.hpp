// A-Tirma with certificates, its access policy and audit logs, as processes.
#pragma once
#include <ise/ise.hpp>

#include <support/catch.hpp>
#include <support/program.hpp>

#include <nlohmann/json.hpp>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace access_test {

using nlohmann::json;

/// Name server and instantiation server, in a folder with a certificate of A-Tirma for each of its identities. The
/// policy is the one of apps/atirma.
class harbour {
public:
    harbour();
    ~harbour();
    harbour(const harbour&) = delete;
    harbour& operator=(const harbour&) = delete;

    /// `ise` with the certificate of `who`: "web", "ana", "shore", "boat".
    ise_test::ran ise(const std::string& who, std::vector<std::string> words);
    /// `atirma run` of a component, with the certificate of `who`. It runs until the harbour ends.
    void run(const std::string& who, const std::vector<std::string>& component);
    /// The same, not awaited, and the caller's.
    std::unique_ptr<ise_test::program> start(const std::string& who, const std::vector<std::string>& component) const;
    /// The lines of the audit log that name `who` so far.
    std::vector<json> audit_of(const std::string& who) const;
    void write_policy(const std::string& text);
    std::string policy() const;
    std::string file(const std::string& name) const { return (folder_ / name).string(); }
    const std::string& name_server() const { return name_server_; }
    /// For a node with nothing but the certificate of `who`.
    ise::node_options node_of(const std::string& who) const;

private:
    std::vector<std::string> command(const std::string& who, const std::vector<std::string>& component) const;

    std::filesystem::path folder_;
    std::string name_server_;
    std::vector<std::unique_ptr<ise_test::program>> processes_; // the servers first
};

} // namespace access_test
