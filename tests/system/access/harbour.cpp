#include "harbour.hpp"

#include <csignal>
#include <fstream>
#include <iterator>
#include <test_folders.hpp>
#include <unistd.h>

namespace access_test {
namespace {

std::string text_of(const std::filesystem::path& file) {
    std::ifstream from(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(from), {}};
}

} // namespace

harbour::harbour() {
    std::string pattern = (std::filesystem::temp_directory_path() / "ise-harbour-XXXXXX").string();
    if (!::mkdtemp(pattern.data())) throw std::runtime_error("no temporary folder");
    folder_ = pattern;
    auto keys = [&](std::vector<std::string> words) {
        words.insert(words.begin(), {"ise", "keys"});
        words.insert(words.end(), {"--authority", file("authority")});
        auto ran = ise_test::run_program(words);
        INFO(ran.err);
        REQUIRE(ran.exit_code == 0);
    };
    keys({"ca", "atirma"});
    for (const char* name : {"shore", "boat", "web", "operator/ana"}) {
        auto folder = file(std::filesystem::path(name).filename().string());
        auto ran = ise_test::run_program(
            {"ise", "keys", "request", std::string("ise://atirma/") + name, "--host", "127.0.0.1", "--folder", folder});
        INFO(ran.err);
        REQUIRE(ran.exit_code == 0);
        keys({"issue", folder});
    }
    write_policy(text_of(ISE_SOURCE_DIR "/apps/atirma/access.toml"));
    auto serve = [&](std::vector<std::string> words) {
        words.insert(words.end(), {"--tls", file("shore"), "--access", file("access.toml"), "--audit",
                                   file("audit.jsonl"), "--log-level", "error"});
        processes_.push_back(std::make_unique<ise_test::program>(words));
        auto line = processes_.back()->read_line();
        if (line.empty()) UNSCOPED_INFO(processes_.back()->wait().err);
        REQUIRE_FALSE(line.empty());
        return line;
    };
    auto listening = serve({"ise_name_server", "--listen", "tls://127.0.0.1:0", "--fresh"});
    name_server_ = listening.substr(listening.find("tls://"));
    std::filesystem::create_directory(folder_ / "programs");
    std::filesystem::create_symlink(ISE_BINARY_DIR "/bin/atirma", folder_ / "programs" / "atirma");
    serve({"ise_instantiation_server", "--programs", file("programs"), "--state", file("state"), "--name", "shore",
           "--name-server", name_server_, "--listen", "tls://127.0.0.1:0", "--allow-path", folder_.string()});
}

harbour::~harbour() {
    while (!processes_.empty()) { // the servers last
        processes_.back()->signal(SIGTERM);
        processes_.back()->wait();
        processes_.pop_back();
    }
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
}

ise_test::ran harbour::ise(const std::string& who, std::vector<std::string> words) {
    words.insert(words.begin(), {"ise", "--name-server", name_server_, "--tls", file(who)});
    return ise_test::run_program(std::move(words));
}

std::vector<std::string> harbour::command(const std::string& who, const std::vector<std::string>& component) const {
    std::vector<std::string> words{"atirma", "run",     "--name-server", name_server_,
                                   "--tls",  file(who), "--log-level",   "warning"};
    if (who != "web") words.insert(words.end(), {"--access", file("access.toml"), "--audit", file("audit.jsonl")});
    words.insert(words.end(), component.begin(), component.end());
    words.insert(words.end(), {"--listen", "tls://127.0.0.1:0"});
    return words;
}

std::unique_ptr<ise_test::program> harbour::start(const std::string& who,
                                                  const std::vector<std::string>& component) const {
    return std::make_unique<ise_test::program>(command(who, component));
}

void harbour::run(const std::string& who, const std::vector<std::string>& component) {
    processes_.push_back(start(who, component));
    auto line = processes_.back()->read_line();
    while (!line.empty() && line.find("started: ") == std::string::npos) line = processes_.back()->read_line();
    if (line.empty()) UNSCOPED_INFO(processes_.back()->wait().err);
    REQUIRE_FALSE(line.empty());
}

std::vector<json> harbour::audit_of(const std::string& who) const {
    std::vector<json> found;
    std::ifstream from(folder_ / "audit.jsonl");
    for (std::string line; std::getline(from, line);) {
        auto one = json::parse(line);
        if (one.at("who") == who) found.push_back(std::move(one));
    }
    return found;
}

void harbour::write_policy(const std::string& text) {
    auto fresh = folder_ / "access.toml.new"; // never half a file
    std::ofstream(fresh) << text;
    std::filesystem::permissions(fresh, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
    std::filesystem::rename(fresh, folder_ / "access.toml");
}

std::string harbour::policy() const { return text_of(folder_ / "access.toml"); }

ise::node_options harbour::node_of(const std::string& who) const {
    ise::node_options options;
    options.name_servers = {ise::endpoint::parse(name_server_).value()};
    options.security.tls_folder = file(who);
    options.log = {};
    return options;
}

} // namespace access_test
