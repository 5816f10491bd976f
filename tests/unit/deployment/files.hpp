// Deployment files that are there for a test only.
#pragma once
#include <ise/deployment/reading.hpp>

#include <support/catch.hpp>

#include <map>
#include <string>

namespace deployment_test {

using namespace ise::deployment;

/// Files by name; "sea.toml" is the one that is read.
class files {
public:
    explicit files(std::string sea) { all["sea.toml"] = std::move(sea); }

    std::map<std::string, std::string> all;

    reading read(const settings& given = {}) const {
        auto find = [this](const std::string& path) -> ise::result<std::string> {
            auto found = all.find(path);
            if (found == all.end()) return ise::failure(ise::errc::io_failed, path + ": No such file or directory");
            return found->second;
        };
        return read_deployment("sea.toml", find, given);
    }
    /// What it describes; there must be no problem.
    deployment made(const settings& given = {}) const {
        auto parsed = read(given);
        for (const auto& one : parsed.problems) UNSCOPED_INFO(one.text());
        REQUIRE(parsed.problems.empty());
        return std::move(parsed.made);
    }
    /// All that is wrong, a line each.
    std::string wrong(const settings& given = {}) const {
        std::string text;
        for (const auto& one : read(given).problems) text += one.text() + "\n";
        return text;
    }
};

/// A file with a host "boat", and components.
inline files at_sea(const std::string& components) {
    return files("name = \"sea\"\n[hosts.boat]\n[hosts.shore]\n" + components);
}

} // namespace deployment_test
