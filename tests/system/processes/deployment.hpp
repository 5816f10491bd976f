#pragma once
#include <support/catch.hpp>
#include <support/program.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <unistd.h>
#include <vector>

/// Components of A-Tirma as processes of their own below one name server; a folder of theirs goes with them.
class deployment {
public:
    deployment() {
        std::filesystem::create_directory(folder_);
        auto listening = run("names", {"ise_name_server", "--listen", "tcp://127.0.0.1:0", "--fresh"});
        names_ = listening.substr(listening.find("tcp://"));
    }
    ~deployment() {
        processes_.clear();
        std::filesystem::remove_all(folder_);
    }
    deployment(const deployment&) = delete;
    deployment& operator=(const deployment&) = delete;

    /// Starts it, and gives the first line that it prints, or the first one with `word`.
    std::string run(const std::string& name, std::vector<std::string> command, const std::string& word = {}) {
        commands_[name] = command;
        processes_[name].reset();
        processes_[name] = std::make_unique<ise_test::program>(std::move(command), variables());
        auto line = processes_[name]->read_line();
        while (!line.empty() && line.find(word) == std::string::npos) line = processes_[name]->read_line();
        INFO(name << " says: " << line);
        REQUIRE_FALSE(line.empty());
        return line;
    }
    std::string run_atirma(const std::string& name, const std::string& type, std::vector<std::string> options,
                           const std::string& word = {}) {
        std::vector<std::string> command{"atirma", "run", "--log-level", "error", type};
        command.insert(command.end(), options.begin(), options.end());
        return run(name, std::move(command), word);
    }
    void run_again(const std::string& name) { run(name, commands_.at(name)); }
    void kill(const std::string& name) {
        processes_.at(name)->signal(SIGKILL);
        processes_.at(name)->wait();
    }
    ise_test::ran end(const std::string& name) {
        processes_.at(name)->signal(SIGTERM);
        return processes_.at(name)->wait();
    }

    /// As a person does it.
    ise_test::ran call(const std::string& whom, const std::string& service, const std::string& request,
                       const std::string& as = {}) {
        std::vector<std::string> words{"ise", "--wait", "--timeout", "60s"};
        if (!as.empty()) words.insert(words.end(), {"--as", as});
        words.insert(words.end(), {"call", whom, service, request});
        return ise_test::run_program(words, variables());
    }
    /// The newest trace of a call that this component made, drawn, once that holds all of these texts; else what was
    /// drawn last.
    std::string trace_of(const std::string& who, const std::string& service, const std::vector<std::string>& texts) {
        std::string drawn;
        until([&] {
            const auto id = newest_trace(who, service);
            if (id.empty()) return false;
            drawn = ise_test::run_program({"ise", "trace", file("spans.jsonl"), "--id", id}, variables()).out;
            return std::ranges::all_of(texts, [&](const auto& text) { return drawn.find(text) != drawn.npos; });
        });
        return drawn;
    }
    /// The next packet.
    std::string next_of(const std::string& whom, const std::string& service) {
        return ise_test::run_program({"ise", "--wait", "--timeout", "60s", "echo", "--count", "1", whom, service},
                                     variables())
            .out;
    }
    static bool until(const std::function<bool()>& done) {
        auto limit = std::chrono::steady_clock::now() + std::chrono::minutes(3); // only what is broken takes that long
        while (!done())
            if (std::chrono::steady_clock::now() > limit) return false;
        return true;
    }
    std::string file(const std::string& name) const { return folder_ + "/" + name; }

private:
    // A program writes its spans as a line of OTLP: the id of a trace stands before the name of its span.
    std::string newest_trace(const std::string& who, const std::string& service) const {
        std::ifstream in(file("spans.jsonl"));
        std::string id;
        for (std::string line; std::getline(in, line);) {
            const auto name = line.rfind("\"name\":\"" + service + "\",\"kind\":3");
            if (name == line.npos || line.find("\"stringValue\":\"" + who + "\"") == line.npos) continue;
            constexpr std::string_view before = "\"traceId\":\"";
            id = line.substr(line.rfind(before, name) + before.size(), 32);
        }
        return id;
    }

    ise_test::start_options variables() const {
        ise_test::start_options made;
        made.variables = {{"ATIRMA_ROCKBLOCK_PASSWORD", "atirma"}, {"ISE_TRACES", file("spans.jsonl")}};
        if (!names_.empty()) made.variables.emplace_back("ISE_NAME_SERVER", names_);
        return made;
    }

    std::string folder_ = fmt::format("{}/ise-nodes-{}-{:x}", std::filesystem::temp_directory_path().string(),
                                      ::getpid(), reinterpret_cast<std::uintptr_t>(this));
    std::string names_;
    std::map<std::string, std::vector<std::string>> commands_;
    std::map<std::string, std::unique_ptr<ise_test::program>> processes_;
};
